"""Limits of the process that reads a USD file. The kernel enforces them.

They grow with the files that are read: layers, and images. The limit of computing time ends the
process by a signal; memory beyond the other is refused.
"""

from __future__ import annotations

import os
import signal
from contextlib import suppress
from pathlib import Path

_GIB = 1 << 30
# Where a file waits for something, no computing time passes; so much longer may all of it take.
_WAITING = 6


def seconds_allowed(n_bytes: int) -> int:
    """Return the computing time that files of a size may take: 10 s, and 1 s for each 4 MB.

    Text takes some 0.03 s for each MB.
    """
    return 10 + n_bytes // 4_000_000


def memory_allowed(n_bytes: int) -> int:
    """Return the memory that reading files of a size may take: 1 GiB, or 64 times their size.

    A compressed mesh takes some 40 times its size as arrays.
    """
    return max(_GIB, 64 * n_bytes)


class _Limits:
    """Limits of this process; none until `start` is called."""

    def __init__(self) -> None:
        self._n_bytes: int | None = None
        self._used = 0

    def start(self) -> None:
        """Limit what this process takes from now on."""
        self._n_bytes = 0
        self._used = _memory_in_use()

    def allow(self, n_bytes: int) -> None:
        """Allow what reading so many further bytes may take, if there are limits."""
        if self._n_bytes is None:
            return
        self._n_bytes += n_bytes
        seconds = seconds_allowed(self._n_bytes)
        with suppress(ImportError, ValueError, OSError):  # Windows; a lower limit of the system
            import resource

            memory = self._used + memory_allowed(self._n_bytes)
            for kind, limit in (resource.RLIMIT_CPU, seconds), (resource.RLIMIT_AS, memory):
                resource.setrlimit(kind, (limit, resource.getrlimit(kind)[1]))
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, _WAITING * seconds)


def _memory_in_use() -> int:
    """Bytes of address space of this process; 0 where the system does not tell."""
    with suppress(OSError, ValueError, AttributeError):
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        return pages * os.sysconf("SC_PAGE_SIZE")
    return 0


LIMITS = _Limits()
