"""Bands of work: all of it once, in any number of threads, and an error that stops it."""

import threading

import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.parallel import resolve_threads, run_bands


@pytest.mark.parametrize("threads", [1, 2, 7, None])
@pytest.mark.parametrize(("n_items", "band"), [(0, 4), (1, 4), (12, 4), (13, 4), (3, 100)])
def test_every_item_is_worked_on_once(threads, n_items, band):
    counts = np.zeros(n_items, dtype=int)
    bands, done = [], []

    def work(start, stop):
        counts[start:stop] += 1
        bands.append((start, stop))

    run_bands(work, n_items, band=band, threads=threads, advance=done.append)
    assert (counts == 1).all()
    assert sum(done) == n_items
    # The same bands whatever the threads, so that no result can depend on them.
    assert sorted(bands) == [(i, min(i + band, n_items)) for i in range(0, n_items, band)]


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("error", [ZeroDivisionError, KeyboardInterrupt])
def test_an_error_is_raised_and_stops_pending_calls(threads, error):
    begun = []

    def work(start, stop):
        begun.append(start)
        if start == 0:
            raise error
        gate.wait(0.02)

    gate = threading.Event()
    with pytest.raises(error):
        run_bands(work, 1000, band=1, threads=threads)
    assert len(begun) < 1000


def test_an_interrupt_while_threads_are_started_stops_those_that_run(monkeypatch):
    start, calls, begun = threading.Thread.start, [], []

    def interrupted(thread):
        calls.append(thread)
        if len(calls) == 3:
            raise KeyboardInterrupt
        start(thread)

    def work(start, stop):
        begun.append(start)
        gate.wait(0.02)

    gate = threading.Event()
    monkeypatch.setattr(threading.Thread, "start", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_bands(work, 1000, band=1, threads=6)
    n_begun = len(begun)
    assert n_begun < 1000
    gate.wait(0.1)
    assert len(begun) == n_begun


def test_progress_is_reported_in_the_calling_thread():
    callers = set()
    run_bands(
        lambda start, stop: None, 20, band=1, threads=4,
        advance=lambda n: callers.add(threading.get_ident()),
    )  # fmt: skip
    assert callers == {threading.get_ident()}


def test_threads_are_at_least_one():
    assert resolve_threads(None) >= 1
    assert resolve_threads(3) == 3
    with pytest.raises(OptionError, match="threads: 0"):
        resolve_threads(0)
