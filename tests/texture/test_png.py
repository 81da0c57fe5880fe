import struct
import zlib

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

from texbake.errors import FileFormatError
from texbake.metadata import SIGNATURE, is_png, png_description
from texbake.texture.image import read_image
from texbake.texture.png_files import write_png


def chunks(data):
    """Kind and data of each chunk."""
    found, at = [], 8
    while at < len(data):
        n_bytes, kind = struct.unpack(">I4s", data[at : at + 8])
        found.append((kind, data[at + 8 : at + 8 + n_bytes]))
        at += n_bytes + 12
    return found


@pytest.fixture
def codes():
    # Wide enough for several bands of a megabyte.
    x, y = np.meshgrid(np.arange(1200), np.arange(700))
    return np.stack([x * 50, y * 90, x * y], axis=2).astype(np.uint16)


@pytest.mark.parametrize("n_channels", [1, 2, 3, 4])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("size", [(1, 1), (3, 7), (700, 1200)])
def test_another_decoder_reads_the_codes(tmp_path, size, dtype, n_channels):
    rng = np.random.default_rng(1)
    codes = rng.integers(0, np.iinfo(dtype).max, (*size, n_channels), dtype, endpoint=True)
    write_png(tmp_path / "a.png", codes)
    wishes = oiio.ImageSpec()
    wishes.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(str(tmp_path / "a.png"), wishes)
    np.testing.assert_array_equal(source.read_image(source.spec().format), codes)
    parts = [data for kind, data in chunks((tmp_path / "a.png").read_bytes()) if kind == b"IDAT"]
    assert (len(parts) > 1) == (codes.nbytes > 1 << 20)
    assert len(zlib.decompress(b"".join(parts))) == codes.nbytes + len(codes)  # checks Adler-32


def fibonacci_bytes():
    """Bytes so unevenly frequent that Huffman codes without a limit have 23 bits."""
    counts = [1, 1]
    while len(counts) < 24:
        counts.append(counts[-1] + counts[-2])
    return np.random.default_rng(0).permutation(np.repeat(np.arange(24), counts))


@pytest.mark.parametrize("rows", [
    np.zeros((5, 70_000)),
    np.arange(256)[:, None] * np.ones(99),
    np.arange(300_000)[None] // 7 % 256,
    np.arange(90_000)[None] // np.arange(1, 90_001) % 2 * 255,
    # Differences from the left, with which the first row is stored.
    np.cumsum(fibonacci_bytes())[None] % 256,
    np.repeat(np.arange(520) % 3, np.arange(520))[None],
    np.random.default_rng(0).integers(0, 256, (1, 200_001)),
], ids=["flat", "lines", "short runs", "edges", "uneven", "all run lengths", "random"])  # fmt: skip
def test_another_decoder_reads_any_bytes(tmp_path, rows):
    codes = rows.astype(np.uint8)[:, :, None]
    write_png(tmp_path / "a.png", codes)
    data = b"".join(
        data for kind, data in chunks((tmp_path / "a.png").read_bytes()) if kind == b"IDAT"
    )
    source = oiio.ImageInput.open(str(tmp_path / "a.png"))
    np.testing.assert_array_equal(source.read_image("uint8").reshape(codes.shape), codes)
    # Where codes would be longer than the bytes, these are stored: five bytes more in each 65,535.
    assert len(data) <= codes.nbytes + len(codes) + 5 * (codes.nbytes // 65535 + 12) + 6


def test_bytes_do_not_depend_on_threads(tmp_path, codes):
    for threads in (1, 2, 3):
        write_png(tmp_path / f"{threads}.png", codes, threads=threads)
    first = (tmp_path / "1.png").read_bytes()
    assert (tmp_path / "2.png").read_bytes() == first == (tmp_path / "3.png").read_bytes()


def test_data_carries_no_color_chunk_and_color_does(tmp_path, codes):
    write_png(tmp_path / "data.png", codes[:4], description="{}")
    kinds = [kind for kind, _ in chunks((tmp_path / "data.png").read_bytes())]
    assert kinds == [b"IHDR", b"tEXt", b"IDAT", b"IEND"]
    write_png(tmp_path / "color.png", codes[:4], srgb=True)
    kinds = [kind for kind, _ in chunks((tmp_path / "color.png").read_bytes())]
    assert kinds == [b"IHDR", b"sRGB", b"IDAT", b"IEND"]


def test_description_comes_back(tmp_path, codes):
    write_png(tmp_path / "a.png", codes[:2], description='{"a":1}')
    assert png_description(tmp_path / "a.png") == '{"a":1}'
    write_png(tmp_path / "b.png", codes[:2])
    assert png_description(tmp_path / "b.png") == ""
    assert is_png(tmp_path / "a.png")


def test_a_file_cut_or_changed_anywhere_is_an_error(tmp_path, codes):
    write_png(tmp_path / "a.png", codes[:3, :5], description="text")
    data = (tmp_path / "a.png").read_bytes()
    for at in range(len(data)):
        for bad in data[:at], data[:at] + bytes([data[at] ^ 0x55]) + data[at + 1 :]:
            (tmp_path / "bad.png").write_bytes(bad)
            with pytest.raises(FileFormatError, match=r"bad\.png: "):
                png_description(tmp_path / "bad.png")


def png_of(header, *more):
    """A PNG file with this header, and checksums that fit."""
    pixels = zlib.compress(bytes(8))
    parts = [(b"IHDR", struct.pack(">IIBBBBB", *header)), *more, (b"IDAT", pixels), (b"IEND", b"")]
    return SIGNATURE + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in parts
    )


@pytest.mark.parametrize(("header", "complaint"), [
    ((0, 1, 8, 0, 0, 0, 0), "has 0 x 1 pixels"),
    ((1, 2**31, 8, 0, 0, 0, 0), "sides of a PNG file"),
    ((1_000_001, 1, 1, 0, 0, 0, 0), "sides of a PNG file"),
    ((1, 1, 8, 5, 0, 0, 0), "header of the PNG file is damaged"),
    ((1, 1, 1, 2, 0, 0, 0), "header of the PNG file is damaged"),
    ((1, 1, 8, 0, 1, 0, 0), "header of the PNG file is damaged"),
    ((1, 1, 8, 0, 0, 0, 2), "header of the PNG file is damaged"),
    ((1, 1, 8, 3, 0, 0, 0), "lacks its palette"),
])  # fmt: skip
def test_what_libpng_would_complain_about_is_one_error(tmp_path, capfd, header, complaint):
    (tmp_path / "a.png").write_bytes(png_of(header))
    with pytest.raises(FileFormatError, match=complaint):
        read_image(tmp_path / "a.png", color=False)
    assert capfd.readouterr().err == ""


def test_images_with_a_palette_are_read(tmp_path):
    (tmp_path / "a.png").write_bytes(png_of((1, 1, 8, 3, 0, 0, 0), (b"PLTE", bytes([9, 8, 7]))))
    assert read_image(tmp_path / "a.png", color=False).pixels.shape == (1, 1, 3)
