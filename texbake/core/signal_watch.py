"""Ends the process after a signal, or with its parent, also where Python itself cannot.

It cannot while a library holds the interpreter.

Kernel: `core/signal_watch.c`. NumPy is not imported here: this begins before the work does.
"""

from __future__ import annotations

import _thread
import ctypes
import os
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from texbake.core.library import core
from texbake.parallel import require_thread_memory
from texbake.unfinished import NOTES

_TO_BEGIN = 1.0  # seconds that a thread is waited for


def signal_watch(
    descriptor: int, flags: bytearray, *, patience: float, to_end: float
) -> Callable[[], object]:
    """Return a function that waits for a signal, then ends the process, whatever Python does.

    It removes temporary files and folders, prints one line, and exits with 128 and the number of
    the signal. For a thread of a program; not for Windows. The function returns only if the pipe
    is closed.

    Parameters
    ----------
    descriptor
        Reading end of the pipe of `signal.set_wakeup_fd`.
    flags
        Four bytes. Three are set to 1 by the program: that Python has heard the signal, that it
        takes the printing of the line upon itself, and that it has printed it. The second is set by
        the function, too, before it prints the line. The last one is 0 until the program has done
        its work, and then its exit code plus 1, with which the function ends it without a line.
    patience
        Seconds in which Python may hear the signal.
    to_end
        Seconds in which it may then end the process itself.

    Raises
    ------
    DependencyError
        The core is not there.
    """
    watch = core.library.end_after_signals
    number, seconds, memory = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
    watch.argtypes = [number, seconds, seconds, number, memory, number, memory]
    watch.restype = number
    shared = [
        value
        for part in (flags, NOTES)
        for value in (len(part), (ctypes.c_uint8 * len(part)).from_buffer(part))
    ]
    return partial(watch, descriptor, patience, to_end, *shared)


def end_with_parent(descriptor: int = 0) -> None:
    """Let this process end as soon as the other end of a pipe is closed, whatever Python does.

    For child processes. Not on Windows.
    """
    if os.name != "nt":
        wait = core.library.end_with_pipe
        wait.argtypes, wait.restype = [ctypes.c_int64], ctypes.c_int64
        runs = _thread.allocate_lock()
        runs.acquire()

        def run() -> None:
            runs.release()
            wait(descriptor)

        # `threading.Thread.start` would wait for ever for a thread that has no memory to begin.
        with suppress(RuntimeError, MemoryError):  # the system gives no more threads
            require_thread_memory()
            _thread.start_new_thread(run, ())
            # Work that keeps the interpreter to itself would keep the thread from beginning.
            runs.acquire(timeout=_TO_BEGIN)
