"""Headers of EXR files: a small file can have many attributes or channels, compared pairwise.

Based on: "The OpenEXR File Layout", Academy Software Foundation.
"""

from __future__ import annotations

from pathlib import Path
from typing import IO

from texbake.errors import FileFormatError
from texbake.files import PathLike

_MAGIC = b"\x76\x2f\x31\x01"
_MOST_ATTRIBUTES = 10_000  # of all parts together; programs write some dozens
_MOST_BYTES_OF_CHANNELS = 1 << 18  # thousands of channels
_HAS_PARTS = 0x1000  # of the flags that follow the magic number
_LONGEST_WORD = 256


def require_few_attributes(path: PathLike) -> None:
    """Raise `FileFormatError` for an EXR file whose header has very many attributes or channels.

    The libraries that read it take time with the square of either.
    """
    with Path(path).open("rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
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
