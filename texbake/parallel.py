"""Work divided into bands for a pool of threads, with the same result for any number of threads.

Kernels run without the GIL and write only to their own band, so that plain threads run them in
parallel, and the order in which they finish cannot change a byte of the result.
"""

from __future__ import annotations

import _thread
import os
import sys
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from texbake.errors import OptionError

if sys.platform == "linux":
    from mmap import MAP_ANONYMOUS, MAP_PRIVATE, mmap

_THREAD_BYTES = 16 << 20  # twice the stack that Linux gives a thread


def default_threads() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def module_path() -> str:
    """Return `PYTHONPATH` for child processes that must import the same modules as this one.

    It has the current folder only if this package was imported from there.
    """
    own = str(Path(__file__).resolve().parents[1])
    folders = [folder for folder in sys.path if folder]
    return os.pathsep.join(folders if own in folders else [own, *folders])


def resolve_threads(threads: int | None) -> int:
    """Return `threads`, or every processor for None; raise `OptionError` below 1."""
    if threads is None:
        return default_threads()
    if threads < 1:
        raise OptionError(f"threads: {threads} is too small; it must be at least 1")
    return threads


def run_bands(
    work: Callable[[int, int], None],
    n_items: int,
    *,
    band: int,
    threads: int | None = None,
    advance: Callable[[int], None] | None = None,
) -> None:
    """Call `work(start, stop)` over `range(n_items)` in bands of `band` items.

    The first error of a band, or an interrupt, cancels the bands not yet started and is raised.
    """
    starts = range(0, n_items, band)
    n_helpers = min(resolve_threads(threads), len(starts)) - 1
    waiting, finished, errors = deque(starts), deque[int](), deque[BaseException]()
    n_done = 0

    def help_out(at_work: _thread.LockType) -> None:
        with at_work:
            try:
                while waiting:
                    finished.append(_run_next(work, waiting, band, n_items))
            except BaseException as error:
                waiting.clear()
                errors.append(error)

    def report() -> None:
        nonlocal n_done
        while finished:
            n = finished.popleft()
            n_done += n
            if advance is not None:
                advance(n)

    # A thread for which there is no memory may end before its first line. `threading.Thread.start`
    # would wait for that line for ever; here only those that have begun are waited for. One that
    # begins later finds nothing to do.
    helpers = [_thread.allocate_lock() for _ in range(n_helpers)]
    try:  # an interrupt may come at any line, also before all helpers have started
        with suppress(RuntimeError, MemoryError):  # the system gives fewer threads for the work
            for at_work in helpers:
                require_thread_memory()
                _thread.start_new_thread(help_out, (at_work,))
        # The calling thread works like the others.
        while waiting:
            finished.append(_run_next(work, waiting, band, n_items))
            report()
    finally:
        waiting.clear()
        for at_work in helpers:
            with at_work:
                pass
    if errors:
        raise errors[0]
    report()
    if n_done != n_items:  # a thread had no memory even to keep its error
        raise MemoryError("a thread ended before its work")


def require_thread_memory() -> None:
    """Raise `MemoryError` where a thread would have none for its stack and its first objects.

    Such a thread would print a traceback that nobody can catch, and `threading.Thread.start` would
    wait for it for ever. This notices only a limit on
    memory, not a machine that runs out.
    """
    if sys.platform == "linux":
        try:
            mmap(-1, _THREAD_BYTES, flags=MAP_PRIVATE | MAP_ANONYMOUS).close()
        except OSError as error:
            raise MemoryError from error


def _run_next(
    work: Callable[[int, int], None], waiting: deque[int], band: int, n_items: int
) -> int:
    """Call `work` for the next band, if another thread has not taken it; return its items."""
    try:
        start = waiting.popleft()
    except IndexError:
        return 0
    stop = min(start + band, n_items)
    work(start, stop)
    return stop - start
