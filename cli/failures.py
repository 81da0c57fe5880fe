"""Failures of a command: one line on stderr and an exit code.

======================================  ====
a file, a mesh, a disk: a user's error     1
wrong usage                                2
Ctrl-C                                   130
another signal                   128 + its number
======================================  ====

Any other exception is a bug and prints its traceback.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import IO, Any, NoReturn

import click

from texbake import OptionError, TexbakeError, clear_unfinished

from .flags import with_flags
from .printable import printable

_PATIENCE = 0.5  # seconds in which the work hears a signal
_HEARD = threading.Event()
_NAMES = "SIGINT", "SIGTERM", "SIGHUP"  # Windows has no SIGHUP
_ENDS = tuple(getattr(signal, name) for name in _NAMES if hasattr(signal, name))


class Failure(click.ClickException):
    """A failure of a command, printed as one line."""

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(" ".join(line.strip() for line in message.splitlines()))
        self.exit_code = exit_code  # type: ignore[misc]  # click reads it from the instance

    def show(self, file: IO[Any] | None = None) -> None:
        """Print the line on stderr."""
        click.echo(printable(self.message), file=file, err=file is None)


class Terminated(KeyboardInterrupt):
    """A signal that ends the process. It is cleaned up after as after Ctrl-C."""

    def __init__(self, signal_number: int) -> None:
        super().__init__()
        self.signal_number = signal_number


def end_cleanly_on_signals() -> None:
    """Make SIGTERM and SIGHUP (a closed terminal) end the work like Ctrl-C.

    Python hears a signal only between its own steps, and a library may take seconds for one. So a
    thread waits beside the work, and ends the process if the work has not heard a signal in time.
    """
    for number in _ENDS:
        # A process started with `nohup` must keep ignoring the signal.
        if number != signal.SIGINT and signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _terminate)
    if os.name != "nt":  # where only sockets can tell a thread of signals
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, _interrupt)
        told, tells = os.pipe()
        os.set_blocking(tells, False)
        signal.set_wakeup_fd(tells, warn_on_full_buffer=False)
        threading.Thread(target=_end_unheard, args=(told,), daemon=True).start()


def _terminate(signal_number: int, frame: FrameType | None) -> NoReturn:
    _HEARD.set()
    signal.signal(signal_number, signal.SIG_IGN)  # a second one must not interrupt the cleanup
    raise Terminated(signal_number)


def _interrupt(signal_number: int, frame: FrameType | None) -> NoReturn:
    _HEARD.set()
    raise KeyboardInterrupt


def _end_unheard(told: int) -> NoReturn:
    """End the process at a signal that the work does not hear, without temporary files."""
    while True:
        number = os.read(told, 1)[0]
        if number in _ENDS and not _HEARD.wait(_PATIENCE):
            clear_unfinished(_PATIENCE)
            said = "interrupted" if number == signal.SIGINT else "terminated"
            with suppress(OSError):
                os.write(2, f"texbake: {said}\n".encode())
            os._exit(128 + number)


@contextmanager
def failures_as_one_line(ctx: click.Context | None = None) -> Iterator[None]:
    """Turn the errors that a user can meet into a `Failure`."""
    try:
        yield
    except click.UsageError as error:
        message = error.format_message()
        raise _wrong_usage(message[:1].lower() + message[1:], error.ctx or ctx) from error
    except OptionError as error:
        raise _wrong_usage(with_flags(str(error), _command(ctx)), ctx) from error
    except TexbakeError as error:
        raise Failure(f"texbake: {with_flags(str(error), _command(ctx))}", 1) from error
    except MemoryError as error:
        raise Failure(
            "texbake: out of memory; try a smaller --size, fewer --samples or fewer --threads", 1
        ) from error
    except Terminated as error:
        raise Failure("texbake: terminated", 128 + error.signal_number) from error
    except KeyboardInterrupt as error:
        raise Failure("texbake: interrupted", 130) from error


def _command(ctx: click.Context | None) -> click.Command | None:
    """Return the command that was called; for a group, the subcommand."""
    if ctx is None:
        return None
    group, name = ctx.command, ctx.invoked_subcommand
    if isinstance(group, click.Group) and name is not None:
        return group.get_command(ctx, name)
    return group


def _wrong_usage(message: str, ctx: click.Context | None) -> Failure:
    path = ctx.command_path if ctx is not None else "texbake"
    if ctx is not None and ctx.invoked_subcommand is not None:
        path = f"{path} {ctx.invoked_subcommand}"
    message = message.strip().rstrip(".")
    return Failure(f"{path}: {message} (see: {path} --help)", 2)
