"""Formats, bits and encodings of images that are derived from others."""

import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.mesh.files.conversion import media_type
from texbake.texture.image import Image, decode_image
from texbake.texture.image_files import (
    ENCODINGS,
    bits_for,
    clipped_share,
    encode_image,
    suffix_like,
    write_images,
)

PIXELS = np.full((2, 2, 3), 0.5, np.float32)


@pytest.mark.parametrize(
    ("name", "bits", "is_float", "suffix"),
    [
        ("a.hdr", 32, True, ".hdr"),
        ("a.EXR", 16, True, ".exr"),
        ("a.jpg", 8, False, ".png"),
        ("a.ppm", 8, False, ".png"),
        ("a.tif", 16, False, ".tif"),
        ("a.pfm", 32, True, ".exr"),
    ],
)
def test_files_like_another_lose_nothing(name, bits, is_float, suffix):
    assert suffix_like(Image(PIXELS, bits=bits, is_float=is_float, name=name)) == suffix


@pytest.mark.parametrize(
    ("target", "bits", "is_float", "greatest", "expected"),
    [
        ("a.png", 8, False, 1.0, None),
        ("a.png", 16, False, 1.0, 16),
        ("a.jpg", 16, False, 1.0, None),
        ("a.png", 32, True, 9.0, None),
        ("a.tif", 32, True, 9.0, 32),
        ("a.exr", 32, True, 9.0, None),
        ("a.exr", 32, True, 65505.0, 32),
    ],
)
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
def test_every_encoding_comes_back(encoding: str, n: int) -> None:
    data = encode_image(CODES[..., :n], encoding)
    has_alpha = n == 4 and encoding == "jpeg"
    assert media_type(data) == ("image/png" if has_alpha else f"image/{encoding}")
    back = np.rint(255 * decode_image(data, "image", color=False).pixels)
    apart = np.abs(back - CODES[..., :n])
    if media_type(data) == "image/png":
        assert not apart.any()
    assert apart.mean() < 1.5  # of 255, for a smooth picture at quality 90
    assert data == encode_image(CODES[..., :n], encoding)


def test_formats_that_are_not_written_are_named() -> None:
    with pytest.raises(OptionError, match="'ktx2' is not known; use webp, jpeg, png"):
        encode_image(CODES, "ktx2")
