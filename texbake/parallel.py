"""Work divided into bands for a pool of threads, with the same result for any number of threads.

Kernels run without the GIL and write only to their own band, so that plain threads run them in
parallel, and the order in which they finish cannot change a byte of the result.
"""

from __future__ import annotations

import os
import sys
import threading
from collections import deque
from collections.abc import Callable
from pathlib import Path

from texbake.errors import require_least


def default_threads() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def module_path() -> str:
    """`PYTHONPATH` for child processes that must import the same modules as this one."""
    own = str(Path(__file__).resolve().parents[1])
    folders = [folder for folder in sys.path if folder]
    return os.pathsep.join(folders if own in folders else [own, *folders])


def resolve_threads(threads: int | None) -> int:
    """Return `threads`, or every processor for None; raise `OptionError` below 1."""
    if threads is None:
        return default_threads()
    require_least("threads", threads)
    return threads


def run_bands(
    work: Callable[[int, int], None],
    n_items: int,
    *,
    band: int,
    threads: int | None = None,
    advance: Callable[[int], None] | None = None,
) -> None:
    """Call `work(start, stop)` in bands; the first error or interrupt cancels the rest."""
    starts = range(0, n_items, band)
    n_helpers = min(resolve_threads(threads), len(starts)) - 1
    waiting, finished, errors = deque(starts), deque[int](), deque[BaseException]()

    def help_out() -> None:
        try:
            while waiting:
                finished.append(_run_next(work, waiting, band, n_items))
        except BaseException as error:
            waiting.clear()
            errors.append(error)

    def report() -> None:
        while finished:
            n = finished.popleft()
            if advance is not None:
                advance(n)

    helpers = [threading.Thread(target=help_out) for _ in range(n_helpers)]
    try:  # an interrupt may come at any line, also before all helpers have started
        for helper in helpers:
            helper.start()
        # The calling thread works like the others.
        while waiting:
            finished.append(_run_next(work, waiting, band, n_items))
            report()
    finally:
        waiting.clear()
        for helper in helpers:
            if helper.ident is not None:  # it has started
                helper.join()
    if errors:
        raise errors[0]
    report()


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
