"""Bands of work: all of it once, in any number of threads, and an error that stops it."""

import _thread
import errno
import sys
import threading

import numpy as np
import pytest

from texbake import parallel
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
    start, calls, begun = _thread.start_new_thread, [], []

    def interrupted(function, arguments):
        calls.append(function)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return start(function, arguments)

    def work(start, stop):
        begun.append(start)
        gate.wait(0.02)

    gate = threading.Event()
    monkeypatch.setattr(_thread, "start_new_thread", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_bands(work, 1000, band=1, threads=6)
    n_begun = len(begun)
    assert n_begun < 1000
    gate.wait(0.1)
    assert len(begun) == n_begun


def test_progress_is_reported_in_the_calling_thread():
    callers = set()
    run_bands(
        lambda start, stop: None,
        20,
        band=1,
        threads=4,
        advance=lambda n: callers.add(threading.get_ident()),
    )
    assert callers == {threading.get_ident()}


def test_threads_are_at_least_one():
    assert resolve_threads(None) >= 1
    assert resolve_threads(3) == 3
    with pytest.raises(OptionError, match="threads: 0"):
        resolve_threads(0)


def test_where_no_thread_starts_the_calling_thread_does_all_the_work(monkeypatch):
    def refuse(function, arguments):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(_thread, "start_new_thread", refuse)
    done = np.zeros(100, dtype=int)

    def work(start, stop):
        done[start:stop] += 1

    run_bands(work, 100, band=3, threads=4)
    assert (done == 1).all()


@pytest.mark.parametrize("name", ["_thread.start_new_thread", "threading._start_new_thread"])
def test_a_thread_that_never_begins_is_not_waited_for(monkeypatch, name):
    """Without memory, a thread that was started may end before its first line."""
    monkeypatch.setattr(name, lambda function, arguments: 1)
    done = np.zeros(100, dtype=int)

    def work(start, stop):
        done[start:stop] += 1

    run_bands(work, 100, band=3, threads=4)
    assert (done == 1).all()


def test_a_thread_that_begins_late_finds_nothing_to_do(monkeypatch):
    late = []
    monkeypatch.setattr(
        _thread, "start_new_thread", lambda function, arguments: late.append((function, arguments))
    )
    done = np.zeros(100, dtype=int)

    def work(start, stop):
        done[start:stop] += 1

    run_bands(work, 100, band=3, threads=4)
    for function, arguments in late:
        function(*arguments)
    assert len(late) == 3
    assert (done == 1).all()


def test_work_that_a_thread_has_lost_is_an_error(monkeypatch):
    """Without memory, a thread can neither do its work nor keep the error."""
    caller, run_next = threading.get_ident(), parallel._run_next
    lost = threading.Event()

    def losing(work, waiting, band, n_items):
        if threading.get_ident() == caller:
            lost.wait(10)
            return run_next(work, waiting, band, n_items)
        waiting.popleft()
        lost.set()
        return 0

    monkeypatch.setattr(parallel, "_run_next", losing)
    with pytest.raises(MemoryError, match="a thread ended before its work"):
        run_bands(lambda start, stop: None, 100, band=1, threads=2)


@pytest.mark.skipif(sys.platform != "linux", reason="only there is memory asked for")
def test_no_thread_is_started_without_memory_for_its_stack(monkeypatch):
    def refuse(*_, **__):
        raise OSError(errno.ENOMEM, "Cannot allocate memory")

    started = []
    monkeypatch.setattr(parallel, "mmap", refuse)
    monkeypatch.setattr(_thread, "start_new_thread", lambda *call: started.append(call))
    done = np.zeros(100, dtype=int)

    def work(start, stop):
        done[start:stop] += 1

    run_bands(work, 100, band=3, threads=4)
    assert (done == 1).all()
    assert not started
