"""What a build asks of a file system: locks, folders of its own, and cheap copies.

Only one build at a time works in a folder, and a folder of unfinished work is known to have a
living owner. The system releases a lock however its process ends, so that none becomes stale.
"""

from __future__ import annotations

import os
import secrets
import shutil
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from texbake.errors import FileError
from texbake.files import make_folder

_POLL_SECONDS = 0.2
_FICLONE = 0x40049409  # linux/fs.h: share the blocks of another file


@contextmanager
def locked(
    path: Path, *, wait: bool = True, note: Callable[[str], None] | None = None
) -> Iterator[None]:
    """Hold a lock within the block."""
    lock = FileLock(path)
    holder = path.with_name(f"{path.name}.holder")
    try:
        try:
            lock.acquire(blocking=False)
        except Timeout:
            by = _text_of(holder) or "just started"
            message = f"{path.parent.parent}: another build is running in this folder ({by})"
            if not wait:
                raise FileError(f"{message}; wait for it, or build in another folder") from None
            if note is not None:
                note(f"{message}; waiting for it")
            lock.acquire(poll_interval=_POLL_SECONDS)
    except FileError:
        raise
    except OSError as error:
        raise FileError(
            f"{path}: cannot be locked: {error.strerror or error}; "
            "give a `folder` on a file system that has locks"
        ) from error
    try:
        holder.write_text(f"process {os.getpid()} on {socket.gethostname()}", encoding="utf-8")
        yield
    finally:
        with suppress(OSError):
            holder.unlink()
        lock.release()


def _text_of(path: Path) -> str:
    with suppress(OSError, UnicodeDecodeError):
        return path.read_text(encoding="utf-8").strip()
    return ""


@contextmanager
def owned_folder(parent: Path) -> Iterator[Path]:
    """Make a folder that is removed after the block, or by `clear` if its process was killed.

    A lock beside the folder says that its owner lives.
    """
    make_folder(parent)
    try:
        folder, lock = _owned(parent)
    except OSError as error:
        raise FileError(f"{parent}: cannot be used: {error.strerror or error}") from error
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        lock.release()
        with suppress(OSError):
            _lock_of(folder).unlink()


def _owned(parent: Path) -> tuple[Path, FileLock]:
    while True:
        folder = parent / secrets.token_hex(8)
        lock = FileLock(_lock_of(folder))
        try:
            lock.acquire(blocking=False)
        except Timeout:  # `clear` has taken it for that of a dead owner
            continue
        except OSError:  # a file system without locks, on which nobody clears folders either
            pass
        folder.mkdir()
        return folder, lock


def clear(parent: Path) -> None:
    """Remove the folders of `owned_folder` whose owners were killed."""
    with suppress(OSError):
        for folder in {path.with_suffix("") for path in parent.iterdir()}:
            # The owner lives where the lock is not to be had: a timeout is an OSError too.
            with suppress(OSError), FileLock(_lock_of(folder)).acquire(blocking=False):
                shutil.rmtree(folder, ignore_errors=True)
                if not folder.exists():
                    _lock_of(folder).unlink()


def _lock_of(folder: Path) -> Path:
    return folder.with_suffix(".lock")


def copy_file(source: Path, target: Path) -> None:
    """Copy a file, sharing its blocks if the file system can."""
    with source.open("rb") as reader, target.open("wb") as writer:
        if not _cloned(reader.fileno(), writer.fileno()):
            shutil.copyfileobj(reader, writer, 1 << 20)


def _cloned(source: int, target: int) -> bool:
    try:
        import fcntl

        fcntl.ioctl(target, _FICLONE, source)
    except (ImportError, OSError):
        return False
    return True
