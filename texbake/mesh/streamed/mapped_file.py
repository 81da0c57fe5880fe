"""A mesh file mapped into memory, of which pages come in as they are touched.

Kernel: `core/mapped_files.c`.
"""

from __future__ import annotations

import mmap
import weakref
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texbake.core import core
from texbake.errors import FileError, FileFormatError
from texbake.files import PathLike, require_file
from texbake.mesh.files.source import ByteArray


@dataclass(frozen=True, eq=False)
class MappedFile:
    """The bytes of a file, read from it where they are touched.

    If the file becomes shorter, the missing bytes are zeros, and `require_whole` raises an error.

    Attributes
    ----------
    path
        For messages.
    data : (n_bytes,) uint8
        Read-only.
    pages
        The mapping that `data` is a view of.
    n_lost : int
        How many mappings had lost pages when this one was made.
    """

    path: PathLike
    data: ByteArray
    pages: mmap.mmap
    n_lost: int

    def require_whole(self) -> None:
        """Raise `FileError` if the file has become shorter since it was opened."""
        if core.count_lost_mappings() != self.n_lost:
            raise FileError(
                f"{self.path}: it became shorter while it was read; read it again once it is "
                "written"
            )

    def release(self) -> None:
        """Let the pages that were read count no longer as memory of this process."""
        if hasattr(mmap, "MADV_DONTNEED"):
            self.pages.madvise(mmap.MADV_DONTNEED)
        self.require_whole()


def map_file(path: PathLike) -> MappedFile:
    """Map a file into memory."""
    require_file(path)
    n_lost = core.count_lost_mappings()
    try:
        with Path(path).open("rb") as file:
            pages = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except ValueError as error:
        raise FileFormatError(f"{path}: the file is empty; write it again") from error
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror or error}") from error
    data = np.frombuffer(pages, dtype=np.uint8)
    weakref.finalize(pages, core.release_mapping, core.guard_mapping(data))
    return MappedFile(path, data, pages, n_lost)
