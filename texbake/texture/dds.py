"""Write DDS files: block-compressed textures with mip levels, ready for upload to a GPU.

Each block of 4 x 4 texels becomes 8 or 16 bytes. The encoders come from etcpak, which is optional:
`pip install 'texbake[dds]'`. `read_image` reads DDS files, because OpenImageIO decodes them.

Based on: Microsoft, "Programming Guide for DDS" and "DXGI_FORMAT enumeration"; Khronos Group,
"Data Format Specification", version 1.3, sections on BC1 to BC7.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from texbake.errors import FileFormatError, OptionError, require_known, require_library
from texbake.files import PathLike, replacing
from texbake.mesh.mesh import ByteArray, Float32Array
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.texture.encoding import encode_normals, quantize_srgb, unit_normals
from texbake.texture.mipmaps import mip_chain


@dataclass(frozen=True)
class BlockFormat:
    """A block compression format."""

    channels: int  # number of channels that the format stores: the first 1, 2, 3 or 4
    block_bytes: int  # bytes per block of 4 x 4 texels
    dxgi: int  # number in DXGI_FORMAT for data; 0 if there is none
    dxgi_srgb: int  # and for sRGB colors


BLOCK_FORMATS = {
    "bc1": BlockFormat(3, 8, 71, 72),  # colors, half the size and quality of bc7
    "bc3": BlockFormat(4, 16, 77, 78),  # colors with an opacity
    "bc4": BlockFormat(1, 8, 80, 0),  # one channel, such as occlusion or roughness
    "bc5": BlockFormat(2, 16, 83, 0),  # x and y of normals, whose z the shader computes
    "bc7": BlockFormat(4, 16, 98, 99),  # colors and packed data
}
_MAX_SIZE = 16384

# Flags of the header: caps, height, width, pixel format, mip count and linear size; "complex" for
# textures with mip levels; the pixel format that announces the second header.
_FLAGS = 0x1 | 0x2 | 0x4 | 0x1000 | 0x20000 | 0x80000
_TEXTURE, _COMPLEX_MIPMAP = 0x1000, 0x8 | 0x400000
_FOUR_CC = 0x4
_TEXTURE_2D = 3

# Rows of blocks per band: a few milliseconds of work.
_BAND_BLOCKS = 1 << 13


def write_dds(
    values: Float32Array,
    path: PathLike,
    *,
    block_format: str,
    kind: str = "color",
    convention: str = "opengl",
    threads: int | None = None,
) -> None:
    """Write a linear (H, W, C) image as block-compressed DDS of a "color", "data" or "normal"."""
    if Path(path).suffix.lower() != ".dds":
        raise FileFormatError(f"{path}: block-compressed textures are DDS files; give a .dds name")
    require_known("block_format", block_format, BLOCK_FORMATS)
    form = BLOCK_FORMATS[block_format]
    if kind == "color" and not form.dxgi_srgb:
        raise OptionError(f"block_format: {block_format} cannot store colors; use bc7 or bc1")
    height, width = values.shape[:2]
    if height % 4 or width % 4 or max(height, width) > _MAX_SIZE:
        raise OptionError(
            f"{path}: {width} x {height} cannot be block-compressed; "
            f"both sides must be multiples of 4, at most {_MAX_SIZE}"
        )
    encode = _encoder(path, block_format)
    chain = mip_chain(values, kind=kind, wrap="clamp", threads=threads)
    levels = [
        _encoded(_codes(chain.level(i), kind, convention, threads), encode, form, threads)
        for i in range(chain.n_levels)
    ]
    with replacing(path) as temporary, temporary.open("wb") as file:
        file.write(_header(width, height, len(levels), form, is_srgb=kind == "color"))
        file.writelines(levels)


def _codes(level: Float32Array, kind: str, convention: str, threads: int | None) -> ByteArray:
    """Return (H, W, 4) codes of a level, padded to multiples of 4 by repeating the last texel."""
    if kind == "normal":
        codes = encode_normals(unit_normals(level), bits=8, convention=convention, threads=threads)
    else:
        n_colors = min(level.shape[2], 3) if kind == "color" else 0
        codes = quantize_srgb(level, 8, n_colors=n_colors, threads=threads)
    height, width, n_channels = codes.shape
    rgba = np.full((height, width, 4), 255, np.uint8)
    rgba[..., :n_channels] = codes
    if n_channels == 1:
        rgba[..., 1:3] = codes
    return np.pad(rgba, ((0, -height % 4), (0, -width % 4), (0, 0)), mode="edge")


def _encoded(
    codes: ByteArray,
    encode: Callable[[bytes, int, int], bytes],
    form: BlockFormat,
    threads: int | None,
) -> bytes:
    """Return the blocks of a level, row by row."""
    height, width = codes.shape[:2]
    n_rows, row_bytes = height // 4, width // 4 * form.block_bytes
    blocks = bytearray(n_rows * row_bytes)

    def work(start: int, stop: int) -> None:
        rows = np.ascontiguousarray(codes[4 * start : 4 * stop])
        blocks[start * row_bytes : stop * row_bytes] = encode(
            rows.tobytes(), width, 4 * (stop - start)
        )

    run_bands(work, n_rows, band=max(1, _BAND_BLOCKS // (width // 4)), threads=threads)
    return bytes(blocks)


def _header(width: int, height: int, n_levels: int, form: BlockFormat, *, is_srgb: bool) -> bytes:
    """Return the magic number and both headers."""
    caps = _TEXTURE | (_COMPLEX_MIPMAP if n_levels > 1 else 0)
    n_bytes = width // 4 * (height // 4) * form.block_bytes
    head = struct.pack("<4s7I44x", b"DDS ", 124, _FLAGS, height, width, n_bytes, 1, n_levels)
    pixel_format = struct.pack("<2I4s20x", 32, _FOUR_CC, b"DX10")
    dxgi = form.dxgi_srgb if is_srgb else form.dxgi
    return (
        head
        + pixel_format
        + struct.pack("<I16x", caps)
        + struct.pack("<5I", dxgi, _TEXTURE_2D, 0, 1, 0)
    )


def _encoder(path: PathLike, block_format: str) -> Callable[[bytes, int, int], bytes]:
    """Return etcpak's encoder, a function of the bytes of (H, W, 4) codes, width and height."""
    etcpak = require_library("etcpak", path, '"texbake[dds]"')
    encode: Any = getattr(etcpak, f"compress_{block_format}")
    if block_format != "bc7":
        return lambda data, width, height: bytes(encode(data, width, height))
    parameters = etcpak.BC7CompressBlockParams()
    parameters.init_linear_weights()  # all channels weigh the same, as packed data needs
    return lambda data, width, height: bytes(encode(data, width, height, parameters))
