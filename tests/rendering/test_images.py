"""Images as slots look them up: channels, factors, transforms of coordinates, wraps, filters."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

from texbake import ImageTexture, Material, OptionError, Scene, SceneObject, write_image
from texbake.errors import FileFormatError, UvError
from texbake.mesh.shapes import cube
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.effects.images import wrap_of
from texbake.rendering.maps import (
    colors_and_opacity_from,
    colors_from,
    has_opacity,
    heights_from,
    normals_from,
)
from texbake.texture.encoding import decode_srgb, encode_normals
from texbake.texture.image import Image

RNG = np.random.default_rng(7)
TEXELS = RNG.random((6, 9, 3)).astype(np.float32)


def unlit(base_color, **fields):
    return Material(shading="unlit", base_color=base_color, **fields)


def nearest(texels, uvs):
    """Texels at coordinates, tiled; and which pixels are surely not beside another texel."""
    height, width = texels.shape[:2]
    x, y = uvs[..., 0] * width, (1 - uvs[..., 1]) * height
    sure = np.minimum(np.abs(x - np.round(x)), np.abs(y - np.round(y))) > 1e-4
    return texels[np.floor(y).astype(int) % height, np.floor(x).astype(int) % width], sure


@pytest.mark.parametrize("filter_name", ["trilinear", "ewa"])
def test_a_transform_of_the_image_is_one_of_the_coordinates_for_its_filter_too(wall, filter_name):
    # What a pixel covers is scaled and turned as well.
    large = RNG.random((64, 64, 3)).astype(np.float32)
    image = ImageTexture(image=large, filter=filter_name, wrap="repeat")
    angle = math.radians(25)
    matrix = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    matrix = matrix * (5.0, 1.5)
    moved = replace(image, scale=(5.0, 1.5), rotate=25.0, offset=(0.2, 0.1))
    uvs = wall.mesh().uvs @ matrix.T + (0.2, 0.1)
    np.testing.assert_allclose(
        wall.light(unlit(moved)), wall.light(unlit(image), uvs=uvs), atol=2e-5
    )


@pytest.mark.parametrize("factor", [0.5, (0.5, 2.0, 0.0)])
def test_a_factor_multiplies_what_is_looked_up(wall, factor):
    plain = ImageTexture(image=TEXELS, filter="bilinear")
    found = wall.light(unlit(replace(plain, factor=factor)))
    np.testing.assert_allclose(found, wall.light(unlit(plain)) * factor, rtol=1e-6)


def test_one_channel_stands_for_a_number_or_for_all_three(wall):
    for channel in range(3):
        image = ImageTexture(image=TEXELS, filter="nearest", channel=channel)
        found = wall.frame(unlit((1.0,) * 3, opacity=image)).color[..., 3]
        expected, sure = nearest(TEXELS[..., channel], wall.uvs)
        np.testing.assert_allclose(found[sure], expected[sure], rtol=1e-6)
        gray = wall.light(unlit(image))
        np.testing.assert_array_equal(gray[sure], expected[sure][:, None].repeat(3, 1))
    first = wall.frame(unlit((1.0,) * 3, opacity=ImageTexture(image=TEXELS, filter="nearest")))
    expected, sure = nearest(TEXELS[..., 0], wall.uvs)
    np.testing.assert_allclose(first.color[..., 3][sure], expected[sure], rtol=1e-6)


def test_an_image_repeats_where_coordinates_leave_the_unit_square_and_else_is_clamped():
    assert wrap_of(None) == wrap_of(np.empty((0, 2))) == "clamp"
    assert wrap_of(np.array([[0.0, 1.0], [0.5, 0.2]])) == "clamp"
    assert wrap_of(np.array([[0.0, 1.0 + 1e-7]])) == "clamp"  # rounding of a file
    assert wrap_of(np.array([[0.0, 1.1]])) == wrap_of(np.array([[-0.1, 0.0]])) == "repeat"


def test_codes_are_decoded_as_the_slot_has_them(wall, tmp_path):
    codes = RNG.integers(0, 256, (4, 4, 3), np.uint8)
    write_image(codes, tmp_path / "a.png", color=True)
    share = codes / 255.0
    texture = ImageTexture(image=tmp_path / "a.png", filter="nearest")
    expected, sure = nearest(decode_srgb(share), wall.uvs)
    np.testing.assert_allclose(wall.light(unlit(texture))[sure], expected[sure], rtol=1e-5)
    expected, sure = nearest(share, wall.uvs)
    as_data = wall.light(unlit(replace(texture, color=False)))
    np.testing.assert_allclose(as_data[sure], expected[sure], rtol=1e-6)
    as_number = wall.frame(unlit((1.0,) * 3, opacity=texture)).color[..., 3]
    np.testing.assert_allclose(as_number[sure], expected[sure][:, 0], rtol=1e-6)


def test_the_filter_of_the_options_goes_before_that_of_the_image(wall):
    image = ImageTexture(image=TEXELS, filter="nearest")
    found = wall.light(unlit(image), options=replace(wall.options, filter="bilinear"))
    other = wall.light(unlit(replace(image, filter="bilinear")))
    np.testing.assert_array_equal(found, other)


def test_an_image_of_several_objects_and_slots_is_read_once_for_each_use(wall, monkeypatch):
    images = sys.modules["texbake.rendering.effects.images"]
    calls = []
    for name in "colors_from", "channel_of", "mip_chain":
        real = getattr(images, name)
        monkeypatch.setattr(
            images, name, lambda *a, n=name, f=real, **k: (calls.append(n), f(*a, **k))[1]
        )
    image = ImageTexture(image=TEXELS)
    material = unlit(image, emission=image, opacity=replace(image, channel=0))
    items = [SceneObject(mesh=wall.mesh(), material=material) for _ in range(3)]
    prepared = prepare(Scene(objects=tuple(items)), wall.options)
    first, second = (draw(prepared, wall.camera) for _ in range(2))
    assert sorted(calls) == ["channel_of", "colors_from", "mip_chain", "mip_chain"]
    assert first.costs.by_name["images"].n_bytes == 4 * 6 * 9 * (3 + 1)
    assert first.color.tobytes() == second.color.tobytes()
    assert second.costs.by_name["mip maps"].n_bytes == 0 < first.costs.by_name["mip maps"].n_bytes


def test_what_does_not_fit_is_one_error(wall):
    def fails(texture, match, error=OptionError):
        with pytest.raises(error, match=match):
            wall.light(unlit(texture))

    fails(ImageTexture(image=np.zeros((4, 4, 0), np.float32)), "shape")
    fails(ImageTexture(image=np.zeros((0, 4, 3), np.float32)), "shape")
    fails(ImageTexture(image=TEXELS, factor=(1.0, 2.0)), "base_color.factor")
    fails(ImageTexture(image=TEXELS, border=(1.0, 2.0), wrap="border"), "base_color.border")
    scene = Scene(objects=(SceneObject(mesh=cube(), material=unlit(ImageTexture(image=TEXELS))),))
    camera = Camera.framing(cube(), options=wall.options)
    with pytest.raises(UvError, match="cube: it has no texture coordinates"):
        draw(prepare(scene, wall.options), camera)


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
    "metadata", [{"texbake:displacement_mid": "half"}, {"texbake:displacement_scale": float("inf")}]
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
