"""Peak memory of a piece of work: how far resident memory rises above what it was before."""

from __future__ import annotations

import gc
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

Result = TypeVar("Result")

_STATUS = Path("/proc/self/status")
_CLEAR = Path("/proc/self/clear_refs")
_RESET_PEAK = "5"


def with_peak_memory(work: Callable[[], Result]) -> tuple[Result, int | None]:
    """Run `work`; return its result, and bytes by which resident memory rose at most meanwhile.

    Linux is asked to forget its high-water mark first. None where the system cannot do that.
    """
    gc.collect()
    _return_freed_memory()
    try:
        _CLEAR.write_text(_RESET_PEAK, encoding="ascii")
        before = _status_bytes("VmRSS")
    except (OSError, IndexError, ValueError):
        return work(), None
    result = work()
    return result, max(_status_bytes("VmHWM") - before, 0)


def _return_freed_memory() -> None:
    """Have the C library give back what it keeps of freed memory, which would hide what is used."""
    import ctypes

    try:
        ctypes.CDLL(None).malloc_trim(0)
    except (OSError, AttributeError, TypeError):  # not the GNU C library
        return


def _status_bytes(field: str) -> int:
    status = _STATUS.read_text(encoding="ascii", errors="replace")
    return int(status.split(f"{field}:")[1].split()[0]) * 1024
