"""Signals that end the process: Ctrl-C, SIGTERM, and SIGHUP of a closed terminal.

While a command works, a signal raises an exception, after which the work is cleaned up. Before
that, while modules are imported, it ends the process at once. Once the command has ended, its exit
code stands: a signal ends the process with it, without a word.
"""

from __future__ import annotations

import _thread
import atexit
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from types import FrameType
from typing import NoReturn

_PATIENCE = 0.4  # seconds in which the work hears a signal
_TO_END = 0.3  # seconds in which it then ends; other threads may not hear anything
_AGAIN = 0.01  # seconds after which a signal that was dropped is sent once more
_HEARD = threading.Event()
_WORKING = threading.Event()
_FLAGS = bytearray(4)  # shared with the core
# Places in it: a signal was heard; somebody prints the line after it; Python has printed it; the
# command has ended, with an exit code that is one less.
_IS_HEARD, _SAID, _PRINTED, _ENDED = range(4)
_BEGINS = 0  # written to the pipe like a signal: the core waits from now on
_LINES = [True]  # one item until somebody prints the line: whoever pops it prints it
_PIPE: list[int] = []  # reading and writing end: Python writes the numbers of signals to it
_WATCH: list[Callable[[], object]] = []  # of the core
_NAMES = "SIGINT", "SIGTERM", "SIGHUP"  # Windows has no SIGHUP
_ENDS = tuple(getattr(signal, name) for name in _NAMES if hasattr(signal, name))


class Terminated(KeyboardInterrupt):
    """A signal that ends the process. It is cleaned up after as after Ctrl-C."""

    def __init__(self, signal_number: int) -> None:
        super().__init__()
        self.signal_number = signal_number


@cache  # the second call has nothing to do
def end_cleanly_on_signals() -> None:
    """Make SIGTERM and SIGHUP end the work like Ctrl-C.

    Python hears a signal only between its own steps, and a library may take seconds for one. What
    has heard it may wait for threads that have not. So a thread waits beside the work, and ends the
    process if it goes on after a signal. While a command works, it waits in the core, because it
    could not go on in Python where a library holds the interpreter.
    """
    atexit.register(_ignore_signals)  # the first one is called last
    for number in _ENDS:
        # A process started with `nohup` must keep ignoring the signal.
        if number != signal.SIGINT and signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _terminate)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)
    sys.unraisablehook = _raise_again
    if os.name != "nt":  # where only sockets can tell a thread of signals
        reader, writer = os.pipe()
        os.set_blocking(writer, False)
        signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
        # `threading.Thread.start` would wait for ever for a thread that has no memory to begin.
        with suppress(RuntimeError, MemoryError):  # the system gives no more threads
            _thread.start_new_thread(_end_unheard, (reader,))
            _PIPE[:] = reader, writer


@contextmanager
def raised_signals() -> Iterator[None]:
    """Let signals raise `KeyboardInterrupt` or `Terminated` within the block."""
    try:
        _WORKING.set()
        _let_core_watch()
        yield
    finally:
        _WORKING.clear()


def _let_core_watch() -> None:
    """Have the thread that waits for signals wait in the core."""
    if _PIPE and not _WATCH:
        import texbake

        # Loaded here: the thread then needs the interpreter only for a moment.
        with suppress(texbake.DependencyError, OSError):  # OSError: the pipe is full of signals
            reader, writer = _PIPE
            _WATCH.append(texbake.signal_watch(reader, _FLAGS, patience=_PATIENCE, to_end=_TO_END))
            os.write(writer, bytes([_BEGINS]))


def line_is_mine() -> bool:
    """Whether the caller is to print the line that follows a signal; `line_is_printed` ends it."""
    if not _PIPE:  # nobody else would
        return True
    if _FLAGS[_SAID]:
        return False
    try:
        _LINES.pop()  # in one step, whatever other threads do
    except IndexError:
        return False
    _FLAGS[_SAID] = 1
    return True


def line_is_printed() -> None:
    """Tell the core that it need not wait for the line."""
    _FLAGS[_PRINTED] = 1


def keep_exit_code(code: int) -> None:
    """Let a signal change the exit code no more: the command has ended with this one."""
    _FLAGS[_ENDED] = code + 1 if 0 <= code < 0xFF else 0


def _ignore_signals() -> None:
    """Ignore signals while Python takes its modules apart and hears none; that takes no time."""
    if _FLAGS[_ENDED]:
        for number in _ENDS:
            signal.signal(number, signal.SIG_IGN)


def _hear() -> None:
    _FLAGS[_IS_HEARD] = 1
    _HEARD.set()


def _terminate(signal_number: int, frame: FrameType | None) -> NoReturn:
    _hear()
    signal.signal(signal_number, signal.SIG_IGN)  # a second one must not interrupt the cleanup
    if not _WORKING.is_set():
        _end(signal_number)
    raise Terminated(signal_number)


def _interrupt(signal_number: int, frame: FrameType | None) -> NoReturn:
    _hear()
    if not _WORKING.is_set():
        _end(signal_number)
    raise KeyboardInterrupt


def _raise_again(unraisable: sys.UnraisableHookArgs) -> None:
    """Send a signal once more that came where Python drops exceptions, such as in a finalizer.

    Where memory was lacking, nothing is printed: the command ends with a line of its own.
    """
    if not issubclass(unraisable.exc_type, KeyboardInterrupt):
        from texbake import is_out_of_memory  # not before signals are heard

        error = unraisable.exc_value or unraisable.exc_type()
        if not is_out_of_memory(error):
            sys.__unraisablehook__(unraisable)
        return
    number = getattr(unraisable.exc_value, "signal_number", int(signal.SIGINT))
    signal.signal(number, _interrupt if number == signal.SIGINT else _terminate)
    with suppress(RuntimeError, MemoryError):
        _thread.start_new_thread(_send_later, (number,))


def _send_later(number: int) -> None:
    time.sleep(_AGAIN)
    # A signal of the system ends a wait of the main thread, too.
    if os.name == "nt":
        _thread.interrupt_main(signal.Signals(number))
    else:
        os.kill(os.getpid(), number)


def _end_unheard(reader: int) -> NoReturn:
    """End the process at a signal if the work goes on all the same."""
    while True:
        number = os.read(reader, 1)[0]
        if number == _BEGINS:
            _WATCH[0]()
        elif number in _ENDS:
            if _HEARD.wait(_PATIENCE):
                time.sleep(_TO_END)
            _end(number)


def clear_after_signal() -> None:
    """Remove temporary files that a signal left as they were being made; the process ends then."""
    unfinished = sys.modules.get("texbake.unfinished")  # not imported: then there are none
    if _HEARD.is_set() and unfinished is not None:
        unfinished.clear_unfinished(_PATIENCE)


def _takes_text(descriptor: int) -> bool:
    """Whether a stream takes text within a moment, unlike a paused terminal."""
    return os.name == "nt" or bool(select.select([], [descriptor], [], _PATIENCE)[1])


def _end(signal_number: int) -> NoReturn:
    """End the process at once, without temporary files."""
    _hear()
    clear_after_signal()
    if _FLAGS[_ENDED]:
        os._exit(_FLAGS[_ENDED] - 1)
    said = "interrupted" if signal_number == signal.SIGINT else "terminated"
    with suppress(OSError, ValueError):
        if line_is_mine() and _takes_text(2):
            shown = b"\x1b[?25h\n" if os.isatty(2) else b""  # progress bars hide the cursor
            os.write(2, shown + f"texbake: {said}\n".encode())
    line_is_printed()
    os._exit(128 + signal_number)
