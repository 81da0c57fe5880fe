"""How the process ends: its exit codes, and signals, which end it with one line.

While a command works, a signal raises an exception, after which the work is cleaned up. A kernel
may keep the main thread from hearing it: a thread that waits beside the work then removes the
temporary files and ends the process.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from types import FrameType
from typing import NoReturn

FAILED, WRONG_USAGE, SIGNALED = 1, 2, 128
EXIT_CODES = {
    "0": "the work is done, and no finding of `check` is as severe as `--fail-on`",
    f"{FAILED}": "a file, a mesh or a disk is at fault, a finding is as severe as `--fail-on`, or "
    "an asset of a build failed",
    f"{WRONG_USAGE}": "wrong usage",
    f"{SIGNALED} + N": "ended by the signal N: 130 by Ctrl-C, 143 by SIGTERM",
}
"""What the exit code of every command means. A bug exits with 1 and its traceback."""

_PATIENCE = 0.5  # seconds in which the work hears a signal and ends
_WORKING = threading.Event()
_LINE = threading.Lock()  # taken by whoever prints the line
_NAMES = "SIGINT", "SIGTERM", "SIGHUP"  # Windows has no SIGHUP
_ENDS = tuple(getattr(signal, name) for name in _NAMES if hasattr(signal, name))


class Terminated(KeyboardInterrupt):
    """A signal that ends the process. It is cleaned up after as after Ctrl-C."""

    def __init__(self, signal_number: int) -> None:
        super().__init__()
        self.signal_number = signal_number


@cache  # the second call has nothing to do
def end_cleanly_on_signals() -> None:
    """Make SIGTERM and SIGHUP end the work like Ctrl-C."""
    atexit.register(_ignore_signals)  # the exit code of a command that has ended stands
    for number in _ENDS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as `nohup` wants it
            signal.signal(number, _raise)
    sys.unraisablehook = _end_dropped
    if os.name != "nt":  # where only sockets can tell a thread of signals
        reader, writer = os.pipe()
        os.set_blocking(writer, False)
        signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
        threading.Thread(target=_end_unheard, args=(reader,), daemon=True).start()


@contextmanager
def raised_signals() -> Iterator[None]:
    """Let signals raise `KeyboardInterrupt` or `Terminated` within the block."""
    try:
        _WORKING.set()
        yield
    finally:
        _WORKING.clear()


def line_is_mine() -> bool:
    """Whether the caller is to print the line that follows a signal."""
    return _LINE.acquire(blocking=False)


def _ignore_signals() -> None:
    for number in _ENDS:
        signal.signal(number, signal.SIG_IGN)


def _raise(signal_number: int, frame: FrameType | None) -> NoReturn:
    _ignore_signals()  # a second one must not interrupt the cleanup
    if not _WORKING.is_set():
        _end(signal_number)
    raise KeyboardInterrupt if signal_number == signal.SIGINT else Terminated(signal_number)


def _end_dropped(unraisable: sys.UnraisableHookArgs) -> None:
    """End the process at a signal that came where Python drops exceptions, such as a finalizer."""
    if issubclass(unraisable.exc_type, KeyboardInterrupt):
        _end(getattr(unraisable.exc_value, "signal_number", signal.SIGINT))
    sys.__unraisablehook__(unraisable)


def _end_unheard(reader: int) -> None:
    """End the process at a signal if the work goes on all the same."""
    while (number := os.read(reader, 1)[0]) not in _ENDS:
        pass
    time.sleep(_PATIENCE)
    _end(number)


def _end(signal_number: int) -> NoReturn:
    """End the process at once, without temporary files."""
    unfinished = sys.modules.get("texbake.unfinished")
    if unfinished is not None:  # else there are none
        unfinished.clear_unfinished(_PATIENCE)
    said = "interrupted" if signal_number == signal.SIGINT else "terminated"
    with suppress(OSError):
        if line_is_mine():
            shown = b"\x1b[?25h\n" if os.isatty(2) else b""  # progress bars hide the cursor
            os.write(2, shown + f"texbake: {said}\n".encode())
    os._exit(SIGNALED + signal_number)
