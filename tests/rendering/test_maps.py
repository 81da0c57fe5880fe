import numpy as np
import pytest

from texbake.errors import FileFormatError, OptionError
from texbake.rendering.maps import (
    colors_and_opacity_from,
    colors_from,
    has_opacity,
    heights_from,
    normals_from,
)
from texbake.texture.encoding import encode_normals
from texbake.texture.image import Image, write_image


def some_normals():
    vectors = np.random.default_rng(1).normal(size=(4, 6, 3))
    vectors[..., 2] = np.abs(vectors[..., 2])
    return (vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)).astype(np.float32)


@pytest.mark.parametrize("convention", ["opengl", "directx"])
@pytest.mark.parametrize("space", ["tangent", "object", "world"])
def test_a_normal_map_says_how_it_is_decoded(convention, space):
    vectors = some_normals()
    pixels = encode_normals(vectors, bits=16, convention=convention) / np.float32(65535)
    image = Image(pixels, {"texbake:convention": convention, "texbake:space": space})
    decoded, found = normals_from(image)
    assert found == space
    # Half a 16-bit step of 2 / 65535, and what normalizing adds to it.
    np.testing.assert_allclose(decoded, vectors, atol=4e-5)


def test_an_array_is_decoded_already():
    vectors = some_normals()
    decoded, space = normals_from(vectors)
    assert space == "tangent"
    np.testing.assert_array_equal(decoded, vectors)


def test_heights_are_decoded_as_their_file_says():
    pixels = np.array([[[0.0], [0.5], [1.0]]], np.float32)
    metadata = {"texbake:displacement_mid": 0.5, "texbake:displacement_scale": 4.0}
    np.testing.assert_array_equal(heights_from(Image(pixels, metadata))[0, :, 0], [-2, 0, 2])
    np.testing.assert_array_equal(heights_from(Image(pixels)), pixels)
    np.testing.assert_array_equal(heights_from(pixels[..., 0]), pixels)


def test_colors_have_three_channels():
    gray = np.array([[[0.25], [0.5]]], np.float32)
    np.testing.assert_array_equal(colors_from(gray), np.repeat(gray, 3, axis=2))
    with_alpha = np.arange(8, dtype=np.float32).reshape(1, 2, 4)
    np.testing.assert_array_equal(colors_from(Image(with_alpha)), with_alpha[..., :3])


@pytest.mark.parametrize("n_channels", [1, 2, 3, 4])
def test_the_last_of_two_or_four_channels_is_an_opacity(n_channels, tmp_path):
    pixels = np.full((2, 2, n_channels), 0.25, np.float32)
    write_image(pixels, tmp_path / "map.exr")
    for source in pixels, Image(pixels), tmp_path / "map.exr":
        _, opacity = colors_and_opacity_from(source)
        assert has_opacity(source) == (opacity is not None) == (n_channels in (2, 4))


@pytest.mark.parametrize(
    "metadata",
    [
        {"texbake:displacement_mid": "half"},
        {"texbake:displacement_scale": float("inf")},
    ],
)
def test_heights_with_a_wrong_coding_are_errors(metadata):
    image = Image(np.zeros((1, 1, 1), np.float32), metadata, name="h.exr")
    with pytest.raises(FileFormatError, match=r"h\.exr: its texbake:displacement"):
        heights_from(image)


@pytest.mark.parametrize("key", ["texbake:convention", "texbake:space"])
def test_normals_with_a_wrong_coding_are_errors(key):
    image = Image(np.zeros((1, 1, 3), np.float32), {key: "upside down"}, name="n.png")
    with pytest.raises(FileFormatError, match=rf"n\.png: its {key} 'upside down'"):
        normals_from(image)


@pytest.mark.parametrize("shape", [(4, 4), (4, 4, 2), (0, 4, 3)])
def test_arrays_of_a_wrong_shape_are_errors(shape):
    with pytest.raises(OptionError, match="give another map"):
        normals_from(np.zeros(shape, np.float32))
