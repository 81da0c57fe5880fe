"""Write PNG files with several threads.

Every byte is under control: no gamma or color chunk on data, no date, the same bytes for any number
of threads. Bands of rows are filtered and compressed to whole deflate blocks.

Based on: Portable Network Graphics (PNG) Specification, third edition, W3C, 2025; Adler, pigz,
2007, for compressing bands side by side.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

from texbake.core import core
from texbake.files import PathLike
from texbake.mesh.mesh import AnyArray
from texbake.metadata import SIGNATURE
from texbake.parallel import run_bands
from texbake.texture.encoding import quantize_srgb, quantize_unsigned

_COLOR_TYPES = {1: 0, 2: 4, 3: 2, 4: 6}  # channels: PNG's number for gray, gray + alpha, ...
# Bytes per band: enough that separate deflate blocks hardly cost more than a single stream.
_BAND_BYTES = 1 << 20
_ADLER_MODULUS = 65521
_MOST_SHOWN = 1024  # pixels along a side of a picture in a notebook


def write_png(
    path: PathLike,
    codes: AnyArray,
    *,
    srgb: bool = False,
    description: str = "",
    threads: int | None = None,
) -> None:
    """Write integer codes as a PNG file."""
    parts = png_parts(codes, srgb=srgb, description=description, threads=threads)
    with Path(path).open("wb") as file:
        file.writelines(parts)


def png_parts(
    codes: AnyArray, *, srgb: bool = False, description: str = "", threads: int | None = None
) -> list[bytes]:
    """Return the bytes of a PNG file of codes (H, W, C), in parts; no search for repeats."""
    height, width, n_channels = codes.shape
    header = struct.pack(
        ">IIBBBBB", width, height, 8 * codes.itemsize, _COLOR_TYPES[n_channels], 0, 0, 0
    )
    parts = [SIGNATURE, _chunk(b"IHDR", header)]
    if srgb:
        parts.append(_chunk(b"sRGB", b"\0"))
    if description:
        parts.append(_chunk(b"tEXt", b"Description\0" + description.encode("ascii")))
    parts += _compressed(codes, threads)
    parts.append(_chunk(b"IEND", b""))
    return parts


def picture_png(pixels: AnyArray, *, is_color: bool, is_averaged: bool = True) -> bytes:
    """PNG of (H, W, C) for notebooks, at most 1,024 px; linear floats as sRGB if `is_color`."""
    height, width, n_channels = pixels.shape
    step = -(-max(height, width) // _MOST_SHOWN)
    down, across = min(step, height), min(step, width)
    height, width = height // down, width // across
    blocks = pixels[: height * down, : width * across, : min(n_channels, 4)]
    blocks = blocks.reshape(height, down, width, across, -1)
    small = blocks.mean(axis=(1, 3)).astype(pixels.dtype) if is_averaged else blocks[:, 0, :, 0]
    if small.dtype.kind == "f":
        n_colors = small.shape[2] - (small.shape[2] in (2, 4))
        floats = small.astype(np.float32)
        small = (
            quantize_srgb(floats, 8, n_colors=n_colors)
            if is_color
            else quantize_unsigned(floats, 8)
        )
    return b"".join(png_parts(np.ascontiguousarray(small), srgb=is_color))


def _chunk(kind: bytes, data: bytes | memoryview) -> bytes:
    checksum = zlib.crc32(data, zlib.crc32(kind))
    return b"".join((struct.pack(">I", len(data)), kind, data, struct.pack(">I", checksum)))


def _compressed(codes: AnyArray, threads: int | None) -> list[bytes]:
    """Return the chunks with the pixels: a zlib stream in parts. Kernel: `core/png_rows.c`."""
    height, _, n_channels = codes.shape
    native = np.ascontiguousarray(codes, codes.dtype.newbyteorder("="))
    rows = native.view(np.uint8).reshape(height, -1)
    n_row_bytes = rows.shape[1]
    band = max(1, _BAND_BYTES // n_row_bytes)
    n_bands = -(-height // band)
    chunks: list[bytes] = [b""] * n_bands
    sums: list[tuple[int, int]] = [(1, 0)] * n_bands

    def work(start: int, stop: int) -> None:
        out = np.empty(core.bound_png_rows(stop - start, n_row_bytes), np.uint8)
        halves = np.empty(2, np.uint32)
        n_bytes = core.compress_png_rows(
            rows, out, halves, codes.itemsize, n_channels * codes.itemsize, start, stop,
            stop == height,
        )  # fmt: skip
        number = start // band
        sums[number] = int(halves[1]) << 16 | int(halves[0]), (stop - start) * (n_row_bytes + 1)
        part: bytes | memoryview = out[:n_bytes].data
        if start == 0:
            part = b"\x78\x01" + part
        # The last chunk waits for the checksum of all.
        chunks[number] = bytes(part) if stop == height else _chunk(b"IDAT", part)

    run_bands(work, height, band=band, threads=threads)
    checksum = 1
    for band_sum, n_bytes in sums:
        checksum = _adler32_joined(checksum, band_sum, n_bytes)
    chunks[-1] = _chunk(b"IDAT", chunks[-1] + struct.pack(">I", checksum))
    return chunks


def _adler32_joined(first: int, second: int, n_second: int) -> int:
    """Return the Adler-32 of two joined byte strings from that of each; RFC 1950, section 8.2."""
    low = (first & 0xFFFF) + (second & 0xFFFF) - 1
    high = (first >> 16) + (second >> 16) + n_second * ((first & 0xFFFF) - 1)
    return (high % _ADLER_MODULUS) << 16 | low % _ADLER_MODULUS
