"""A mesh file mapped into memory, of which pages come in as they are touched."""

from __future__ import annotations

import mmap
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texbake.errors import FileError, FileFormatError
from texbake.files import PathLike, require_file
from texbake.mesh.files.source import ByteArray


@dataclass(frozen=True, eq=False)
class MappedFile:
    """The bytes of a file, read from it where they are touched."""

    path: PathLike  # for messages
    data: ByteArray  # (n_bytes,) uint8; read-only
    pages: mmap.mmap  # the mapping that `data` is a view of

    def release(self) -> None:
        """Let the pages that were read count no longer as memory of this process."""
        if hasattr(mmap, "MADV_DONTNEED"):
            self.pages.madvise(mmap.MADV_DONTNEED)


def map_file(path: PathLike) -> MappedFile:
    """Map a file into memory."""
    require_file(path)
    try:
        with Path(path).open("rb") as file:
            pages = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except ValueError as error:
        raise FileFormatError(f"{path}: the file is empty; write it again") from error
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror or error}") from error
    return MappedFile(path, np.frombuffer(pages, dtype=np.uint8), pages)
