"""Writing files whole or not at all: beside their place, then renamed. Folders for them."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from texbake.errors import FileError

PathLike = str | os.PathLike[str]


@contextmanager
def replacing(path: PathLike) -> Iterator[Path]:
    """Yield a path beside `path` to write to; move it into place if the block ends well.

    If the block raises, or is interrupted, what it wrote is removed and a file that already stood
    at `path` is left as it was. The path yielded has the suffix of `path`, because many writers
    choose the format by it. Through a symbolic link the file it points to is replaced.

    Raises
    ------
    FileError
        The folder is missing or cannot be written, the disk is full, or `path` is a folder, a
        device or a pipe.
    """
    target = _target_of(path)
    # Not the target's own name: some writers take only names that are UTF-8.
    temporary = target.with_name(f".texbake-{secrets.token_hex(6)}{target.suffix}")
    try:
        # Created first, so that an unwritable folder is noticed before the work and not after it.
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, _mode_for(target)))
        yield temporary
        temporary.replace(target)
    except OSError as error:
        if isinstance(error, FileError):
            raise
        raise FileError(
            f"{path}: cannot be written: {error.strerror or error}; nothing was changed"
        ) from error
    finally:
        temporary.unlink(missing_ok=True)


def _mode_for(target: Path) -> int:
    """Permissions for a new file: those of the file it replaces, else what the umask leaves."""
    try:
        return target.stat().st_mode & 0o777
    except OSError:
        return 0o666


def check_writable(path: PathLike) -> None:
    """Raise `FileError` now if a file at `path` could not be written later.

    Long work calls this first, so that an hour is not spent on a result that cannot be written.
    """
    target = _target_of(path)
    if not os.access(target.parent, os.W_OK):
        raise FileError(f"{path}: the folder {target.parent} cannot be written to")


def _target_of(path: PathLike) -> Path:
    """Return the file that a path leads to through links; its folder exists."""
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise FileError(f"{path}: it is a folder; give the name of a file in it")
    if target.is_symlink():
        raise FileError(f"{path}: its links form a circle; give another name")
    if target.exists() and not target.is_file():
        # Renaming over a device such as /dev/full would take it from the whole machine.
        raise FileError(f"{path}: it is a device or a pipe; give the name of a file")
    if not target.parent.is_dir():
        raise FileError(f"{path}: there is no folder {target.parent}; create it first")
    return target


def check_folder(folder: PathLike) -> None:
    """Raise `FileError` now if files could not be put into `folder` later.

    The folder need not exist yet, if it can be created.
    """
    there = Path(os.path.realpath(folder))
    while not there.exists():
        there = there.parent
    if not there.is_dir():
        raise FileError(f"{folder}: {there} is a file; give the name of a folder")
    if not os.access(there, os.W_OK):
        raise FileError(f"{folder}: the folder {there} cannot be written to")


def make_folder(folder: PathLike) -> Path:
    """Create a folder and its missing parents, and return its path.

    Raises
    ------
    FileError
        It cannot be created, or a file has its name.
    """
    path = Path(folder)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{path}: the folder cannot be made: {error.strerror}") from error
    return path
