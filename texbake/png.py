"""Check PNG files before they are decoded, and read their description.

Based on: Portable Network Graphics (PNG) Specification, third edition, W3C, 2025.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

from texbake.errors import FileFormatError
from texbake.files import PathLike

SIGNATURE = b"\x89PNG\r\n\x1a\n"


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
