"""Image files that take far more work than their size says, which are refused.

A small EXR file can have many attributes or channels, which are compared pairwise, and a small JPEG
file thousands of scans, each of which goes over all pixels.

Based on: "The OpenEXR File Layout", Academy Software Foundation.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import IO

from texbake.errors import FileFormatError
from texbake.files import PathLike

_EXR = b"\x76\x2f\x31\x01"
_MOST_ATTRIBUTES = 10_000  # of all parts together; programs write some dozens
_MOST_BYTES_OF_CHANNELS = 1 << 18  # thousands of channels
_HAS_PARTS = 0x1000  # of the flags that follow the magic number
_LONGEST_WORD = 256

_JPEG, _SCAN, _END_OF_IMAGE = b"\xff\xd8", b"\xff\xda", b"\xd9"
# Of segments, and of the end. Decoders pass over markers below these wherever they stand.
_MARKER = re.compile(rb"\xff+([\xc0-\xcf\xd9-\xfe])")
_MOST_SCANS = 64  # programs write some 10, and as many for a preview


def require_few_attributes(path: PathLike) -> None:
    """Raise `FileFormatError` for an EXR file whose header has very many attributes or channels.

    The libraries that read it take time with the square of either.
    """
    with Path(path).open("rb") as file:
        if file.read(len(_EXR)) != _EXR:
            return
        has_parts = int.from_bytes(file.read(4), "little") & _HAS_PARTS
        n_read = 0
        # The header of a part ends with an empty name, and the last one of several with two.
        while _word(file) or (has_parts and _word(file)):
            kind, size = _word(file), int.from_bytes(file.read(4), "little", signed=True)
            n_read += 1
            if size < 0:
                return
            if n_read > _MOST_ATTRIBUTES:
                raise FileFormatError(
                    f"{path}: it has more than {_MOST_ATTRIBUTES:,} attributes; save it again"
                )
            if kind == b"chlist" and size > _MOST_BYTES_OF_CHANNELS:
                raise FileFormatError(f"{path}: it has too many channels; save fewer layers")
            file.seek(size, 1)


def _word(file: IO[bytes]) -> bytes:
    """Read a name, up to the null byte behind it; b"" at the end of the file."""
    word = file.read(_LONGEST_WORD)
    end = word.find(b"\0")
    if end < 0:
        return b""
    file.seek(end + 1 - len(word), 1)
    return word[:end]


def require_few_scans(path: PathLike) -> None:
    """Raise `FileFormatError` for a JPEG file of many scans, each of which goes over all pixels."""
    with Path(path).open("rb") as file:
        if file.read(2) == _JPEG:
            data = file.read()
            # Phones add films and pictures after the image, in which anything may stand.
            n_scans = _scan_count(data) if data.count(_SCAN) > _MOST_SCANS else 0
            if n_scans > _MOST_SCANS:
                raise FileFormatError(
                    f"{path}: it has {n_scans:,} scans, more than {_MOST_SCANS}; save it again"
                )


def _scan_count(data: bytes) -> int:
    """Scans of a JPEG image; what is inside other segments or after its end is none of it."""
    n_scans = at = 0
    while (found := _MARKER.search(data, at)) and found[1] != _END_OF_IMAGE:
        n_scans += found[1] == _SCAN[1:]
        at = found.end() + int.from_bytes(data[found.end() : found.end() + 2], "big")
    return n_scans
