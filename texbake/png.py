"""Write PNG files with several threads, and check PNG files before they are decoded.

Texbake writes PNG files itself to control every byte: no gamma or color chunk on data, no date, the
same bytes for any number of threads. Rows are filtered and compressed in bands. Each band is a
sequence of whole deflate blocks, so that the bands joined together are one valid stream.

Based on: Portable Network Graphics (PNG) Specification, third edition, W3C, 2025; Adler, pigz,
2007, for compressing bands side by side.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError
from texbake.files import PathLike
from texbake.parallel import run_bands

SIGNATURE = b"\x89PNG\r\n\x1a\n"
_COLOR_TYPES = {1: 0, 2: 4, 3: 2, 4: 6}  # channels: PNG's number for gray, gray + alpha, ...
_FILTER_SUB = 1
# Bytes per band: enough that separate deflate blocks hardly cost more than a single stream.
_BAND_BYTES = 1 << 20
_ADLER_MODULUS = 65521


def write_png(
    path: PathLike,
    codes: npt.NDArray[Any],
    *,
    srgb: bool = False,
    description: str = "",
    threads: int | None = None,
) -> None:
    """Write integer codes as a PNG file.

    Rows are stored as differences from the texel on the left, compressed by run lengths and Huffman
    codes only. For smooth maps, the files are as small as with the usual search for repeats, and
    are written twice as fast.

    Parameters
    ----------
    codes : (H, W, C) uint8 or uint16
        1 to 4 channels: gray, gray and alpha, RGB, RGBA.
    srgb
        Whether to mark the codes as sRGB colors. Data has no mark.
    description
        ASCII text, stored under the keyword "Description".
    """
    height, width, n_channels = codes.shape
    header = struct.pack(
        ">IIBBBBB", width, height, 8 * codes.itemsize, _COLOR_TYPES[n_channels], 0, 0, 0
    )
    with Path(path).open("wb") as file:
        file.write(SIGNATURE)
        _write_chunk(file, b"IHDR", header)
        if srgb:
            _write_chunk(file, b"sRGB", b"\0")
        if description:
            _write_chunk(file, b"tEXt", b"Description\0" + description.encode("ascii"))
        for part in _deflated(codes, threads):
            _write_chunk(file, b"IDAT", part)
        _write_chunk(file, b"IEND", b"")


def png_description(path: PathLike) -> str:
    """Check a PNG file; return the text under the keyword "Description", or "" if there is none.

    Raises
    ------
    FileFormatError
        The file is not a PNG file, it is truncated, or a checksum is wrong.
    """
    description = ""
    for kind, data in _chunks(path):
        if kind == b"tEXt" and data.startswith(b"Description\0"):
            description = data.split(b"\0", 1)[1].decode("latin-1")
    return description


def is_png(path: PathLike) -> bool:
    """Whether a file begins with the PNG signature."""
    with Path(path).open("rb") as file:
        return file.read(len(SIGNATURE)) == SIGNATURE


def _write_chunk(file: BinaryIO, kind: bytes, data: bytes) -> None:
    file.write(struct.pack(">I", len(data)) + kind)
    file.write(data)
    file.write(struct.pack(">I", zlib.crc32(data, zlib.crc32(kind))))


def _deflated(codes: npt.NDArray[Any], threads: int | None) -> list[bytes]:
    """Return the zlib stream of the filtered rows, in parts."""
    height, width, n_channels = codes.shape
    rows_per_band = max(1, _BAND_BYTES // (width * n_channels * codes.itemsize))
    n_bands = -(-height // rows_per_band)
    parts: list[bytes] = [b""] * n_bands
    sums: list[tuple[int, int]] = [(1, 0)] * n_bands

    def work(start: int, stop: int) -> None:
        for band in range(start, stop):
            rows = codes[band * rows_per_band : (band + 1) * rows_per_band]
            filtered = _filtered(rows)
            deflate = zlib.compressobj(1, zlib.DEFLATED, -15, 9, zlib.Z_RLE)
            end = zlib.Z_FINISH if band == n_bands - 1 else zlib.Z_SYNC_FLUSH
            parts[band] = deflate.compress(filtered.data) + deflate.flush(end)
            sums[band] = zlib.adler32(filtered.data), filtered.nbytes

    run_bands(work, n_bands, band=1, threads=threads)
    checksum = 1
    for band_sum, n_bytes in sums:
        checksum = _adler32_joined(checksum, band_sum, n_bytes)
    parts[0] = b"\x78\x01" + parts[0]
    parts[-1] += struct.pack(">I", checksum)
    return parts


def _filtered(rows: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    """Return the bytes of rows, big-endian, each minus the byte of the texel on its left."""
    n_rows, _, n_channels = rows.shape
    big_endian = rows.astype(rows.dtype.newbyteorder(">"), order="C")
    raw = big_endian.view(np.uint8).reshape(n_rows, -1)
    step = n_channels * rows.itemsize
    filtered = np.empty((n_rows, raw.shape[1] + 1), np.uint8)
    filtered[:, 0] = _FILTER_SUB
    filtered[:, 1 : 1 + step] = raw[:, :step]
    np.subtract(raw[:, step:], raw[:, :-step], out=filtered[:, 1 + step :])
    return filtered


def _adler32_joined(first: int, second: int, n_second: int) -> int:
    """Return the Adler-32 of two joined byte strings from that of each; RFC 1950, section 8.2."""
    low = (first & 0xFFFF) + (second & 0xFFFF) - 1
    high = (first >> 16) + (second >> 16) + n_second * ((first & 0xFFFF) - 1)
    return (high % _ADLER_MODULUS) << 16 | low % _ADLER_MODULUS


def _chunks(path: PathLike) -> Iterator[tuple[bytes, bytes]]:
    """Yield the kind and data of each chunk up to the end of the image; b"" for the pixels."""
    with Path(path).open("rb") as file:
        if file.read(len(SIGNATURE)) != SIGNATURE:
            raise FileFormatError(f"{path}: it is not a PNG file; save it as one")
        left = Path(path).stat().st_size - len(SIGNATURE)
        kind = b""
        while kind != b"IEND":
            head = file.read(8)
            n_bytes, kind = struct.unpack(">I4s", head) if len(head) == 8 else (left, b"")
            # 12 bytes: length, kind and checksum of the chunk. Checked before memory is allocated.
            left -= n_bytes + 12
            if left < 0:
                raise FileFormatError(f"{path}: the PNG file is cut short; get it again")
            data = file.read(n_bytes)
            if zlib.crc32(data, zlib.crc32(kind)) != int.from_bytes(file.read(4), "big"):
                raise FileFormatError(f"{path}: a checksum of the PNG file is wrong; get it again")
            yield kind, b"" if kind == b"IDAT" else data
