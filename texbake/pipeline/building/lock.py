"""One build at a time in a folder, by a lock that the system lets go of however a process ends."""

from __future__ import annotations

import os
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from texbake.errors import FileError

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
        Another process holds it, or the file cannot be made.
    """
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise FileError(f"{path}: cannot be made: {error.strerror}") from error
    try:
        waiting = False
        while not _taken(descriptor):
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
