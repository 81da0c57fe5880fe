"""A folder for results: looked at before the work, made when there is something to put into it."""

from __future__ import annotations

import os
from pathlib import Path

from texbake.errors import FileError
from texbake.files import PathLike


def check_folder(folder: PathLike) -> None:
    """Raise `FileError` now if files could not be put into `folder` later.

    It need not be there yet, if it can be made.
    """
    there = Path(os.path.realpath(folder))
    while not there.exists():
        there = there.parent
    if not there.is_dir():
        raise FileError(f"{folder}: {there} is a file; give the name of a folder")
    if not os.access(there, os.W_OK):
        raise FileError(f"{folder}: the folder {there} cannot be written to")


def make_folder(folder: PathLike) -> Path:
    """Make a folder, and those that it is in, where they are missing; return its path.

    Raises
    ------
    FileError
        It cannot be made, or a file has its name.
    """
    path = Path(folder)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{path}: the folder cannot be made: {error.strerror}") from error
    return path
