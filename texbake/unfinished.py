"""Names of temporary files and folders, and the removal of those whose process was killed.

A name says which process of which machine it belongs to. Where a process makes its first temporary
file in a folder, it removes those of processes that have ended.
"""

from __future__ import annotations

import os
import re
import shutil
import stat
import threading
import zlib
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

PREFIX = ".texbake-"  # of files; folders have none of the dot
_NAME = re.compile(r"\.?texbake-([0-9a-f]{8})-([0-9]+)-[0-9a-z_]+(\.[^.]*)?")
_NOWHERE = "0" * 8
_LOOKED_THROUGH: set[Path] = set()
MOVING = threading.Lock()
"""Held while files take their names."""


def unfinished_name(folder: Path, suffix: str = "") -> str:
    """New name for a temporary file in a folder, which is cleared once of what was left."""
    clear_once(folder)
    return f"{PREFIX}{_owner()}-{os.urandom(6).hex()}{suffix}"


def scratch_prefix(folder: Path) -> str:
    """Return the prefix of temporary folders; like `unfinished_name`."""
    clear_once(folder)
    return f"{PREFIX[1:]}{_owner()}-"


def clear_once(folder: Path) -> None:
    """Remove what processes of this machine that have ended since its start left in a folder."""
    if folder not in _LOOKED_THROUGH:
        _LOOKED_THROUGH.add(folder)
        if _machine() != _NOWHERE:
            _clear(folder, lambda process: not _is_running(process))


def clear_unfinished(patience: float) -> None:
    """Remove temporary files of this process, which then ends; wait `patience` s for renames."""
    MOVING.acquire(timeout=patience)  # never released: no other files may take their names
    for folder in tuple(_LOOKED_THROUGH):
        _clear(folder, lambda process: process == os.getpid())


def _owner() -> str:
    return f"{_machine()}-{os.getpid()}"


@cache
def _machine() -> str:
    """Digits for this machine since its start, and for the processes that are seen here."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii")
        among = str(Path("/proc/self/ns/pid").readlink())
    except (OSError, ValueError):
        return _NOWHERE
    return f"{zlib.crc32(f'{boot} {among}'.encode()):08x}"


def _clear(folder: Path, is_doomed: Callable[[int], bool]) -> None:
    doomed = []
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            found = _NAME.fullmatch(entry.name)
            if found and found[1] == _machine() and is_doomed(int(found[2])):
                doomed.append(entry.path)
    for path in doomed:
        with suppress(OSError):
            status = os.lstat(path)
            if hasattr(os, "getuid") and status.st_uid != os.getuid():
                continue  # in a folder that users share
            if stat.S_ISDIR(status.st_mode):
                shutil.rmtree(path, ignore_errors=True)
            else:
                Path(path).unlink()


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # of another user, or no number of a process
        return True
    return True
