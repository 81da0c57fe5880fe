"""What is written stays written: files copied, and folders made, so that a power cut loses none."""

from __future__ import annotations

import os
import shutil
from contextlib import suppress
from pathlib import Path

_FICLONE = 0x40049409  # linux/fs.h: share the blocks of another file


def copy_file(source: Path, target: Path) -> None:
    """Copy the content of a file to the disk, sharing its blocks where the file system can."""
    with source.open("rb") as reader, target.open("xb") as writer:
        if not _cloned(reader.fileno(), writer.fileno()):
            shutil.copyfileobj(reader, writer, 1 << 20)
        writer.flush()
        os.fsync(writer.fileno())


def _cloned(source: int, target: int) -> bool:
    try:
        import fcntl

        fcntl.ioctl(target, _FICLONE, source)
    except (ImportError, OSError):
        return False
    return True


def to_disk(path: Path) -> None:
    """Have a file, or the names in a folder, written before what is done next.

    Raises
    ------
    OSError
        The content of a file cannot be written. Of folders that is not told: many systems cannot.
    """
    if path.is_dir():
        with suppress(OSError):
            _synchronize(path, os.O_RDONLY)
    else:
        _synchronize(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY)


def _synchronize(path: Path, how: int) -> None:
    descriptor = os.open(path, how)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def make_lasting(folder: Path) -> None:
    """Make a folder and those that it is in, and have their names on the disk."""
    if not folder.is_dir():
        make_lasting(folder.parent)
        folder.mkdir(exist_ok=True)
        to_disk(folder.parent)
