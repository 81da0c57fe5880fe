"""Formats, bits and encodings of images that are derived from others."""

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

from texbake.errors import FileFormatError, OptionError
from texbake.mesh.files.conversion import media_type
from texbake.texture.image import Image, decode_image, read_header
from texbake.texture.image_files import (
    ENCODINGS,
    bits_for,
    clipped_share,
    encode_image,
    suffix_like,
    write_images,
    write_layers,
)

PIXELS = np.full((2, 2, 3), 0.5, np.float32)


@pytest.mark.parametrize(("name", "bits", "is_float", "suffix"), [
    ("a.hdr", 32, True, ".hdr"),
    ("a.EXR", 16, True, ".exr"),
    ("a.jpg", 8, False, ".png"),
    ("a.ppm", 8, False, ".png"),
    ("a.tif", 16, False, ".tif"),
    ("a.pfm", 32, True, ".exr"),
])  # fmt: skip
def test_files_like_another_lose_nothing(name, bits, is_float, suffix):
    assert suffix_like(Image(PIXELS, bits=bits, is_float=is_float, name=name)) == suffix


@pytest.mark.parametrize(("target", "bits", "is_float", "greatest", "expected"), [
    ("a.png", 8, False, 1.0, None),
    ("a.png", 16, False, 1.0, 16),
    ("a.jpg", 16, False, 1.0, None),
    ("a.png", 32, True, 9.0, None),
    ("a.tif", 32, True, 9.0, 32),
    ("a.exr", 32, True, 9.0, None),
    ("a.exr", 32, True, 65505.0, 32),
])  # fmt: skip
def test_bits_follow_the_source(target, bits, is_float, greatest, expected):
    source = Image(PIXELS, bits=bits, is_float=is_float)
    assert bits_for(target, PIXELS * 2 * np.float32(greatest), source) == expected


def test_clipped_values_are_counted_where_a_file_cannot_hold_them():
    pixels = np.array([[[0.0, 1.0, 1.5, -0.1]]], np.float32)
    assert clipped_share("a.png", pixels, None) == 0.5
    assert clipped_share("a.exr", pixels, None) == 0.0
    assert clipped_share("a.tif", pixels, 32) == 0.0


def test_values_that_a_format_cannot_hold_are_refused_before_the_folder_is_made(tmp_path):
    with pytest.raises(OptionError, match="HDR holds 3 channels"):
        write_images({tmp_path / "new" / "a.hdr": PIXELS[..., :1]}, color=True)
    assert list(tmp_path.iterdir()) == []


RAMP = np.linspace(0, 255, 64)
SMOOTH = np.stack(np.broadcast_arrays(RAMP[:, None], RAMP, 255.0 - RAMP, RAMP[:, None]), axis=2)
CODES = np.rint(SMOOTH).astype(np.uint8)


@pytest.mark.parametrize("encoding", sorted(ENCODINGS))
@pytest.mark.parametrize("n", [3, 4])
def test_every_encoding_comes_back(encoding, n):
    data = encode_image(CODES[..., :n], encoding)
    has_alpha = n == 4 and encoding == "jpeg"
    assert media_type(data) == ("image/png" if has_alpha else f"image/{encoding}")
    back = np.rint(255 * decode_image(data, "image", color=False).pixels)
    apart = np.abs(back - CODES[..., :n])
    if media_type(data) == "image/png":
        assert not apart.any()
    assert apart.mean() < 1.5  # of 255, for a smooth picture at quality 90
    assert data == encode_image(CODES[..., :n], encoding)


def test_formats_that_are_not_written_are_named():
    with pytest.raises(OptionError, match="'ktx2' is not known; use webp, jpeg, png"):
        encode_image(CODES, "ktx2")


CHANNELS = {1: "Y", 2: "YA", 3: "RGB", 4: "RGBA"}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.exr"


@pytest.fixture
def layers():
    rng = np.random.default_rng(0)
    return {
        "normal": Image(
            pixels=rng.random((6, 5, 3), np.float32).astype(np.float16).astype(np.float32),
            bits=16, metadata={"texbake:space": "tangent"},
        ),
        "displacement": Image(
            pixels=rng.random((6, 5, 1), np.float32) * 1e-7 - 1e6,
            metadata={"texbake:displacement_scale": 0.1},
        ),
        "base-color": Image(pixels=np.ones((6, 5, 4), np.float32), bits=8),
        "gray": Image(pixels=rng.random((6, 5, 2), np.float32)),
    }  # fmt: skip


def test_layers_come_back_with_their_metadata(path, layers):
    write_layers(layers, path)
    source = oiio.ImageInput.open(str(path))
    names = source.spec().channelnames
    pixels = source.read_image(0, 0, 0, len(names), oiio.FLOAT)
    for layer, image in layers.items():
        places = [names.index(f"{layer}.{name}") for name in CHANNELS[image.pixels.shape[2]]]
        np.testing.assert_array_equal(pixels[..., places], image.pixels)
    metadata = {f"{layer}.{k}": v for layer, i in layers.items() for k, v in i.metadata.items()}
    assert read_header(path).metadata == metadata


def test_channels_are_named_after_their_layer(path, layers):
    write_layers(layers, path)
    spec = oiio.ImageInput.open(str(path)).spec()
    kinds = dict(zip(spec.channelnames, map(str, spec.channelformats), strict=True))
    assert kinds == {
        "normal.R": "half", "normal.G": "half", "normal.B": "half", "displacement.Y": "float",
        "base-color.R": "half", "base-color.G": "half", "base-color.B": "half",
        "base-color.A": "half", "gray.Y": "float", "gray.A": "float",
    }  # fmt: skip


def test_invalid_layers_are_an_error(tmp_path, path, layers):
    small = {"a": Image(pixels=np.zeros((2, 3, 1), np.float32))}
    for wrong, message in (
        ({}, "there is no layer"),
        (layers | small, r"differ in size \(3 x 2, 5 x 6\)"),
        ({"a.b": small["a"]}, "'a.b' is not a layer name"),
        ({"a": Image(pixels=np.full((1, 1, 1), 1e6, np.float32), bits=16)}, "beyond half"),
        ({"a": Image(pixels=np.zeros((1, 1, 5), np.float32))}, "more than four channels"),
    ):
        with pytest.raises(OptionError, match=message):
            write_layers(wrong, path)
    with pytest.raises(FileFormatError, match=r"give a \.exr file"):
        write_layers(small, tmp_path / "a.png")
    assert not path.exists()
