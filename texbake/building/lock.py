"""Locks, which the system lets go of however a process ends.

One build at a time works in a folder; folders of work in hand are known to have an owner.
"""

from __future__ import annotations

import os
import secrets
import shutil
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from texbake.errors import FileError
from texbake.files import make_folder

_POLL_SECONDS = 0.2


@contextmanager
def locked(
    path: Path, *, wait: bool = True, told: Callable[[str], None] | None = None
) -> Iterator[None]:
    """Hold a lock within the block.

    Parameters
    ----------
    path
        Of the lock's file, whose folder is there; the file stays when the lock is let go.
    wait
        Wait until another process lets go of it, else raise.
    told
        Called once, with who holds it, before it is waited for.

    Raises
    ------
    FileError
        Another process holds it, the file cannot be made, or its file system has no locks.
    """
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise FileError(f"{path}: cannot be made: {error.strerror}") from error
    try:
        waiting = False
        while not _taken_at(path, descriptor):
            holder = _said(descriptor)
            message = f"{path.parent.parent}: another build works here ({holder or 'just begun'})"
            if not wait:
                raise FileError(f"{message}; wait for it, or build in another folder")
            if not waiting and told is not None:
                told(f"{message}; waiting for it")
            waiting = True
            time.sleep(_POLL_SECONDS)
        os.ftruncate(descriptor, 0)
        os.lseek(descriptor, 0, os.SEEK_SET)
        os.write(descriptor, f"process {os.getpid()} on {socket.gethostname()}\n".encode())
        yield
        os.ftruncate(descriptor, 0)
    finally:
        os.close(descriptor)


def _taken_at(path: Path, descriptor: int) -> bool:
    try:
        return _taken(descriptor)
    except OSError as error:
        raise FileError(
            f"{path}: cannot be locked: {error.strerror or error}; "
            "give a folder whose file system has locks with --folder"
        ) from error


@contextmanager
def owned_folder(parent: Path) -> Iterator[Path]:
    """Make a folder that is gone after the block, or by `clear` if the process is ended before.

    A lock beside it says that its owner lives.

    Raises
    ------
    FileError
        It cannot be made.
    """
    make_folder(parent)
    try:
        folder, descriptor = _owned(parent)
    except OSError as error:
        raise FileError(f"{parent}: cannot be used: {error.strerror or error}") from error
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(descriptor)
        with suppress(OSError):
            _lock_of(folder).unlink()


def _owned(parent: Path) -> tuple[Path, int]:
    while True:
        folder = parent / secrets.token_hex(8)
        descriptor = os.open(_lock_of(folder), os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
        try:
            if _owns(_lock_of(folder), descriptor):
                folder.mkdir()
                return folder, descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _owns(path: Path, descriptor: int) -> bool:
    """Whether a new lock is taken, and not cleared away as that of a dead owner before it was."""
    try:
        if not _taken(descriptor):
            return False
    except OSError:  # without locks nobody clears up either
        return True
    with suppress(FileNotFoundError):
        return os.path.samestat(os.fstat(descriptor), path.stat())
    return False


def clear(parent: Path) -> None:
    """Remove the folders of `owned_folder` whose owners were ended."""
    with suppress(OSError):
        for folder in {path.with_suffix("") for path in parent.iterdir()}:
            with suppress(OSError):
                _clear(folder)


def _clear(folder: Path) -> None:
    descriptor = os.open(_lock_of(folder), os.O_RDWR | os.O_CREAT, 0o666)
    try:
        if not _taken(descriptor):
            return
        shutil.rmtree(folder, ignore_errors=True)
        if not folder.exists():
            _lock_of(folder).unlink()
    finally:
        os.close(descriptor)


def _lock_of(folder: Path) -> Path:
    return folder.with_suffix(".lock")


def _said(descriptor: int) -> str:
    """What the holder of the lock wrote."""
    with suppress(OSError):  # Windows locks what is to be read, too
        os.lseek(descriptor, 0, os.SEEK_SET)
        return os.read(descriptor, 200).decode("utf-8", "replace").strip()
    return ""


if sys.platform == "win32":
    import msvcrt

    def _taken(descriptor: int) -> bool:
        with suppress(OSError):
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
            return True
        return False
else:
    import fcntl

    def _taken(descriptor: int) -> bool:
        with suppress(BlockingIOError):
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        return False
