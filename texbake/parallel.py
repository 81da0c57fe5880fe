"""Work divided into bands for a pool of threads, with the same result for any number of threads.

Kernels are compiled with `nogil=True` and write only to their own band, so that plain threads run
them in parallel, and the order in which they finish cannot change a byte of the result.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, as_completed

from texbake.errors import OptionError


def default_threads() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


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

    Parameters
    ----------
    work
        Handles the items from start to stop - 1 and writes no other item's results.
    band
        Items per call; independent of `threads`, so that no result can depend on it.
    threads
        None for every processor.
    advance
        Called in the calling thread with the number of items of each finished band.

    The first error of a band, or an interrupt, cancels the bands not yet started and is raised.
    """
    starts = range(0, n_items, band)
    threads = min(resolve_threads(threads), len(starts))
    if threads <= 1:
        for start in starts:
            stop = min(start + band, n_items)
            work(start, stop)
            if advance is not None:
                advance(stop - start)
        return
    pool = ThreadPoolExecutor(threads, thread_name_prefix="texbake")
    try:
        sizes: dict[Future[None], int] = {}
        for start in starts:
            stop = min(start + band, n_items)
            sizes[pool.submit(work, start, stop)] = stop - start
        for future in as_completed(sizes):
            future.result()
            if advance is not None:
                advance(sizes[future])
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
