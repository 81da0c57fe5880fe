from functools import partial

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

from texbake.errors import FileError, FileFormatError, OptionError
from texbake.texture.dds import write_dds
from texbake.texture.encoding import decode_srgb
from texbake.texture.image import decode_image, read_header, read_image, write_image
from texbake.texture.image_formats import check_image_format, holds_floats

# What each format holds, and the most that a value in [0, 1] changes on the way: half a code, half
# a step of a half float below 1 (2^-12), nothing for floats, 1/256 for shared exponents.
FORMATS = [
    ("png", 8, 0.5 / 255),
    ("png", 16, 0.5 / 65535),
    ("exr", 16, 2**-12),
    ("exr", 32, 0.0),
    ("tif", 8, 0.5 / 255),
    ("tiff", 16, 0.5 / 65535),
    ("tif", 32, 0.0),
    ("tga", 8, 0.5 / 255),
    ("hdr", 32, 1 / 256),
    ("ppm", 8, 0.5 / 255),
    ("ppm", 16, 0.5 / 65535),
]
METADATA = {
    "texbake:displacement_mid": 32768 / 65535, "texbake:displacement_scale": 0.1 + 0.2,
    "texbake:space": "tangent", "texbake:convention": "directx", "count": 3,
}  # fmt: skip


@pytest.fixture
def pixels():
    return np.random.default_rng(5).random((9, 13, 3)).astype(np.float32)


@pytest.mark.parametrize(("suffix", "bits", "error"), FORMATS)
def test_data_comes_back(tmp_path, pixels, suffix, bits, error):
    path = tmp_path / f"a.{suffix}"
    write_image(pixels, path, bits=bits)
    image = read_image(path, color=False)
    assert image.pixels.shape == pixels.shape and image.pixels.dtype == np.float32
    assert (image.bits, image.name) == (bits, path.name)
    assert image.is_float == holds_floats(path, bits) == (suffix in ("exr", "hdr") or bits == 32)
    # 1e-7: float32 of a code's value.
    assert np.abs(image.pixels - pixels).max() <= error + 1e-7


@pytest.mark.parametrize("suffix", ["png", "tif", "tga", "exr", "jpg"])
def test_metadata_comes_back_exactly(tmp_path, pixels, suffix):
    write_image(pixels, tmp_path / f"a.{suffix}", metadata=METADATA)
    assert read_image(tmp_path / f"a.{suffix}", color=False).metadata == METADATA
    write_image(pixels, tmp_path / f"a.{suffix}")
    assert read_image(tmp_path / f"a.{suffix}", color=False).metadata == {}


@pytest.mark.parametrize("suffix", ["hdr", "ppm"])
def test_formats_without_a_place_for_metadata_leave_it_out(tmp_path, pixels, suffix):
    write_image(pixels, tmp_path / f"a.{suffix}", metadata=METADATA)
    assert read_image(tmp_path / f"a.{suffix}", color=False).metadata == {}


@pytest.mark.parametrize(("suffix", "dtype"), [
    ("png", np.uint8), ("png", np.uint16), ("tif", np.uint8), ("tif", np.uint16),
    ("tga", np.uint8), ("ppm", np.uint16),
])  # fmt: skip
def test_codes_are_written_as_they_are(tmp_path, suffix, dtype):
    top = np.iinfo(dtype).max
    codes = np.random.default_rng(0).integers(0, top, (64, 48, 3), dtype, endpoint=True)
    for color in (False, True):
        write_image(codes, tmp_path / f"a.{suffix}", color=color)
        source = oiio.ImageInput.open(str(tmp_path / f"a.{suffix}"))
        np.testing.assert_array_equal(source.read_image(source.spec().format), codes)


@pytest.mark.parametrize("suffix", ["png", "tif", "tga", "ppm"])
def test_color_is_srgb_in_integer_formats(tmp_path, suffix):
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    write_image(codes, tmp_path / f"a.{suffix}")
    linear = read_image(tmp_path / f"a.{suffix}", color=True).pixels
    np.testing.assert_allclose(linear, decode_srgb(codes / 255), rtol=1e-6, atol=1e-9)
    write_image(linear, tmp_path / f"b.{suffix}", color=True, bits=8)
    again = read_image(tmp_path / f"b.{suffix}", color=False).pixels
    np.testing.assert_array_equal(np.round(again * 255), codes)


@pytest.mark.parametrize(("suffix", "bits"), [("exr", 32), ("exr", 16), ("hdr", 32), ("tif", 32)])
def test_floats_are_linear_also_as_color(tmp_path, suffix, bits):
    pixels = np.array([[[0.25, 0.5, 4.0]]], np.float32)  # powers of two: exact in all of them
    write_image(pixels, tmp_path / f"a.{suffix}", color=True, bits=bits)
    np.testing.assert_array_equal(read_image(tmp_path / f"a.{suffix}", color=True).pixels, pixels)


def test_alpha_is_never_srgb_nor_multiplied_in(tmp_path):
    pixels = np.array([[[0.2, 0.5, 0.9, 0.5], [1.0, 1.0, 1.0, 0.0]]], np.float32)
    for suffix in ("png", "tif", "tga"):
        path = tmp_path / f"a.{suffix}"
        write_image(pixels, path, color=True, bits=8)
        stored = read_image(path, color=False).pixels
        assert stored[0, 0, 3] == np.float32(128 / 255)
        # Half a code of 8 bits, in linear light at most 2.3 times as much.
        np.testing.assert_allclose(
            read_image(path, color=True).pixels, pixels, atol=2.3 * 0.5 / 255
        )


@pytest.mark.parametrize("n_channels", [1, 2, 3, 4, 7])
@pytest.mark.parametrize(("suffix", "bits"), [("exr", 32), ("tif", 16), ("png", 16)])
def test_channels_stay_in_order(tmp_path, suffix, bits, n_channels):
    if suffix == "png" and n_channels == 7:
        with pytest.raises(OptionError, match="1 or 2 or 3 or 4 channels, not 7"):
            write_image(np.zeros((2, 2, 7)), tmp_path / "a.png")
        return
    pixels = np.broadcast_to(np.arange(n_channels) / 8, (3, 4, n_channels)).astype(np.float32)
    write_image(pixels, tmp_path / f"a.{suffix}", bits=bits)
    image = read_image(tmp_path / f"a.{suffix}", color=False)
    np.testing.assert_allclose(image.pixels, pixels, atol=1 / 65535)


@pytest.mark.parametrize(("suffix", "bits", "error"), FORMATS)
def test_equal_pixels_make_equal_bytes(tmp_path, pixels, suffix, bits, error, monkeypatch):
    write_image(pixels, tmp_path / f"1.{suffix}", bits=bits, metadata=METADATA, threads=1)
    # OpenImageIO takes its dates from the C library, which takes the time zone from here.
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    write_image(pixels, tmp_path / f"2.{suffix}", bits=bits, metadata=METADATA, threads=2)
    data = (tmp_path / f"1.{suffix}").read_bytes()
    assert data == (tmp_path / f"2.{suffix}").read_bytes()
    spec = oiio.ImageInput.open(str(tmp_path / f"1.{suffix}")).spec()
    assert spec.get_string_attribute("DateTime") == ""


@pytest.mark.parametrize("suffix", ["png", "jpg", "exr", "tif", "hdr", "tga", "ppm"])
def test_damaged_files_are_one_clear_line_and_print_nothing(tmp_path, suffix, pixels, capfd):
    path = tmp_path / f"a.{suffix}"
    write_image(np.random.default_rng(0).random((200, 200, 3)), path)
    data = path.read_bytes()
    for damaged in (data[: len(data) // 2], data[:7], b"", b"garbage" * 100, bytes(100)):
        path.write_bytes(damaged)
        with pytest.raises(FileFormatError) as caught:
            read_image(path, color=False)
        message = str(caught.value)
        assert message.startswith(f"{path}: ") and "\n" not in message
    assert capfd.readouterr() == ("", "")


def test_a_file_that_is_not_there_or_a_folder_is_a_file_error(tmp_path):
    for path in (tmp_path / "none.png", tmp_path, tmp_path / "none" / "none.exr"):
        with pytest.raises(FileError, match=r"there is no such file|it is a folder"):
            read_image(path, color=False)


def stored(path, suffix):
    """Write an image by a library, under whatever name."""
    codes = np.random.default_rng(4).integers(0, 255, (8, 12, 3)).astype(np.uint8)
    made = path.with_name(f"made.{suffix}")
    output = oiio.ImageOutput.create(str(made))
    assert output.open(str(made), oiio.ImageSpec(12, 8, 3, "uint8")) and output.write_image(codes)
    assert output.close()
    made.rename(path)
    return codes


@pytest.mark.parametrize("suffix", ["png", "tif", "tga", "jpg", "webp", "bmp", "ppm", "dds"])
@pytest.mark.parametrize("name", ["a.tga", "a.png", "a.gif", "image"])
def test_an_image_is_read_whatever_its_suffix(tmp_path, suffix, name):
    path = tmp_path / name
    if suffix == "dds":
        write_dds(np.zeros((8, 12, 3), np.float32), tmp_path / "made.dds", block_format="bc1")
        (tmp_path / "made.dds").rename(path)
        codes = np.zeros((8, 12, 3))
    else:
        codes = stored(path, suffix)
    read = read_image(path, color=False).pixels[..., :3] * 255.0
    assert read.shape == codes.shape
    if suffix not in ("jpg", "webp"):
        np.testing.assert_allclose(read, codes, atol=1e-3)


@pytest.mark.parametrize("suffix", ["gif", "sgi", "ico", "rla", "iff", "jp2", "dpx"])
@pytest.mark.parametrize("name", ["a", "a.png", "a.tga"])
def test_other_formats_are_refused_unopened(tmp_path, monkeypatch, suffix, name):
    path = tmp_path / (name if "." in name else f"a.{suffix}")
    stored(path, suffix)
    monkeypatch.setattr(oiio.ImageInput, "open", None)
    for read in partial(read_image, color=True), read_header:
        with pytest.raises(FileFormatError, match="not an image that is read; save it as PNG"):
            read(path)
    with pytest.raises(FileFormatError, match=r"^inside: it is not an image that is read"):
        decode_image(path.read_bytes(), "inside", color=True)


def test_part_of_an_image_is_an_error(tmp_path):
    spec = oiio.ImageSpec(4, 4, 3, "half")
    spec.x, spec.full_width, spec.full_height = 2, 8, 8
    output = oiio.ImageOutput.create(str(tmp_path / "a.exr"))
    output.open(str(tmp_path / "a.exr"), spec)
    output.write_image(np.zeros((4, 4, 3), np.float32))
    output.close()
    with pytest.raises(FileFormatError, match="window"):
        read_image(tmp_path / "a.exr", color=False)


def test_other_types_are_read_as_values(tmp_path):
    spec = oiio.ImageSpec(2, 1, 1, "uint32")
    output = oiio.ImageOutput.create(str(tmp_path / "a.tif"))
    output.open(str(tmp_path / "a.tif"), spec)
    output.write_image(np.array([[[0], [2**32 - 1]]], np.uint32))
    output.close()
    assert read_image(tmp_path / "a.tif", color=False).pixels.ravel().tolist() == [0.0, 1.0]


def test_pixels_that_a_format_cannot_hold_are_an_error_before_anything_is_written(tmp_path, pixels):
    for suffix, bits, what in (
        ("tga", 16, r"TGA holds 8 bits per channel, not 16; use PNG or EXR or TIFF"),
        ("png", 32, r"PNG holds 8 or 16 bits per channel, not 32; use EXR or TIFF or HDR"),
        ("exr", 8, r"EXR holds 16 or 32 bits per channel, not 8"),
        ("tif", 12, r"not 12; use 8, 16 or 32"),
    ):
        with pytest.raises(OptionError, match=what):
            check_image_format(f"a.{suffix}", bits)
        with pytest.raises(OptionError, match=what):
            write_image(pixels, tmp_path / f"a.{suffix}", bits=bits)
    with pytest.raises(FileFormatError, match=r"'\.gif' is not known; use png, exr, tif"):
        write_image(pixels, tmp_path / "a.gif")
    with pytest.raises(OptionError, match="HDR holds 3 channels, not 1"):
        check_image_format("a.hdr", 32, channels=1)
    for codes, name, bits in ((pixels * 255, "a.png", 16), (pixels * 255, "a.exr", 16)):
        with pytest.raises(OptionError, match="pass floats"):
            write_image(codes.astype(np.uint8), tmp_path / name, bits=bits)
    for shape in ((), (3,), (0, 4, 3), (2, 2, 2, 2)):
        with pytest.raises(OptionError, match="not that of an image"):
            write_image(np.zeros(shape), tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


def test_colors_too_bright_for_half_floats_become_the_brightest(tmp_path):
    bright = np.array([[[1e6, -1e30, 65504.0]]], np.float32)
    write_image(bright, tmp_path / "bright.exr", color=True)
    found = read_image(tmp_path / "bright.exr", color=True).pixels
    np.testing.assert_array_equal(found, [[[65504.0, -65504.0, 65504.0]]])


@pytest.mark.parametrize("color", ["data", "linear", "", None, 1])
def test_color_is_true_or_false(color, tmp_path, pixels):
    write_image(pixels, tmp_path / "a.png", bits=8)
    with pytest.raises(OptionError, match=r"color: .* is neither True"):
        read_image(tmp_path / "a.png", color=color)


def test_bits_by_default():
    assert [check_image_format(f"a.{s}") for s in ("png", "exr", "tif", "tga", "hdr")] == [
        16, 32, 32, 8, 32,
    ]  # fmt: skip
    assert [check_image_format(f"A.{s}", color=True) for s in ("PNG", "EXR", "TIF")] == [8, 16, 8]
