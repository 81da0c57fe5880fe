"""Write files atomically: write a temporary file in the same folder, then rename it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from texbake.errors import FileError

PathLike = str | os.PathLike[str]


@contextmanager
def replacing(path: PathLike) -> Iterator[Path]:
    """Yield a temporary path next to `path`; move the file to `path` if the block succeeds.

    If the block raises or is interrupted, the temporary file is removed and an existing file at
    `path` is left unchanged. The temporary path has the suffix of `path`, because many writers
    choose the format by it. If `path` is a symbolic link, the file it points to is replaced.

    Raises
    ------
    FileError
        The folder is missing or not writable, the disk is full, or `path` is a folder, a device or
        a pipe.
    """
    target = _target_of(path)
    # The name does not contain that of `path`: some writers accept only names that are UTF-8.
    temporary = target.with_name(f".texbake-{os.urandom(6).hex()}{target.suffix}")
    try:
        # Create the file first, so that an unwritable folder fails before the work, not after it.
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
    """Return the permissions of the file that is replaced, or those of the umask for a new one."""
    try:
        return target.stat().st_mode & 0o777
    except OSError:
        return 0o666


def check_writable(path: PathLike) -> None:
    """Raise `FileError` if a file cannot be written at `path`.

    Long jobs call this before they start.
    """
    target = _target_of(path)
    if not os.access(target.parent, os.W_OK):
        raise FileError(f"{path}: the folder {target.parent} cannot be written to")


def _target_of(path: PathLike) -> Path:
    """Resolve the symbolic links of a path; raise `FileError` if no file can be written there."""
    target = Path(os.path.realpath(path))
    try:
        target.lstat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:  # such as a name that is too long
        raise FileError(f"{path}: cannot be written: {error.strerror}") from error
    if target.is_dir():
        raise FileError(f"{path}: it is a folder; give the name of a file in it")
    if target.is_symlink():
        raise FileError(f"{path}: its links form a circle; give another name")
    if target.exists() and not target.is_file():
        # Renaming a file to a device such as /dev/full would remove it for the whole machine.
        raise FileError(f"{path}: it is a device or a pipe; give the name of a file")
    if not target.parent.is_dir():
        raise FileError(f"{path}: there is no folder {target.parent}; create it first")
    return target


def check_folder(folder: PathLike) -> None:
    """Raise `FileError` if files cannot be written to `folder`.

    The folder need not exist if it can be created.
    """
    there = Path(os.path.realpath(folder))
    try:
        while not there.exists():
            there = there.parent
    except OSError as error:  # such as a name that is too long
        raise FileError(f"{folder}: cannot be made: {error.strerror}") from error
    if not there.is_dir():
        raise FileError(f"{folder}: {there} is a file; give the name of a folder")
    if not os.access(there, os.W_OK):
        raise FileError(f"{folder}: the folder {there} cannot be written to")


def make_folder(folder: PathLike) -> Path:
    """Create a folder and its missing parents, and return its path.

    Raises
    ------
    FileError
        The folder cannot be created, or there is a file of that name.
    """
    path = Path(folder)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{path}: the folder cannot be made: {error.strerror}") from error
    return path


def write_files(folder: PathLike, files: Mapping[str, bytes]) -> list[Path]:
    """Write files into a folder, each whole or not at all, and return their paths.

    Parameters
    ----------
    folder
        Made if it does not exist.
    files
        Contents by name.

    Raises
    ------
    FileError
        A file cannot be written.
    """
    there = make_folder(folder)
    for name, content in files.items():
        with replacing(there / name) as path:
            path.write_bytes(content)
    return [there / name for name in files]
