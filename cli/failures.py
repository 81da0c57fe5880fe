"""Failures of a command: one line on stderr and an exit code of `EXIT_CODES`.

Any other exception is a bug and prints its traceback.
"""

from __future__ import annotations

import errno
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import click

from texbake import FileError, OptionError, TexbakeError
from texbake.errors import is_out_of_memory

from .messages import printable, with_flags
from .signals import FAILED, SIGNALED, WRONG_USAGE, Terminated, line_is_mine, raised_signals


class Failure(click.ClickException):
    """A failure of a command, printed as one line."""

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(" ".join(line.strip() for line in message.splitlines()))
        self.exit_code = exit_code  # type: ignore[misc]  # click reads it from the instance

    def show(self, file: IO[Any] | None = None) -> None:
        """Print the line on stderr, once after a signal."""
        if self.exit_code <= SIGNALED or line_is_mine():
            click.echo(printable(self.message), file=file, err=file is None)


@contextmanager
def failures_as_one_line(ctx: click.Context | None = None) -> Iterator[None]:
    """Turn the errors that a user can meet into a `Failure`."""
    try:
        with raised_signals():
            yield
    except click.UsageError as error:
        message = error.format_message()
        raise _wrong_usage(message[:1].lower() + message[1:], error.ctx or ctx) from error
    except OptionError as error:
        raise _wrong_usage(with_flags(str(error), _command(ctx)), ctx) from error
    except TexbakeError as error:
        # What is wrong with a file opens with its name, which may be that of a parameter.
        names_file = isinstance(error, FileError)
        message = with_flags(str(error), _command(ctx), opening=not names_file)
        raise Failure(f"texbake: {message}", FAILED) from error
    except Terminated as error:
        raise Failure("texbake: terminated", SIGNALED + error.signal_number) from error
    except KeyboardInterrupt as error:
        raise Failure("texbake: interrupted", SIGNALED + signal.SIGINT) from error
    except (MemoryError, OSError) as error:
        if is_out_of_memory(error):
            message = f"out of memory; {_memory_advice(_command(ctx))}"
        elif isinstance(error, FileNotFoundError) and _folder_was_deleted():
            message = "the current folder was deleted; change to another folder"
        elif isinstance(error, OSError) and error.errno == errno.ENOSPC:  # as click prints help
            message = f"{error.filename or 'standard output'}: cannot be written: {error.strerror}"
        else:
            raise
        raise Failure(f"texbake: {message}", FAILED) from error


def _folder_was_deleted() -> bool:
    try:
        Path.cwd()
    except FileNotFoundError:
        return True
    return False


def _memory_advice(command: click.Command | None) -> str:
    """Return what may take less memory, of what the command lets one choose."""
    flags = {flag for option in command.params for flag in option.opts} if command else set()
    ways = [
        way
        for flag, way in (
            ("--max-memory", "--max-memory 2G"),
            ("--size", "a smaller --size"),
            ("--samples", "fewer --samples"),
            ("--threads", "fewer --threads"),
        )
        if flag in flags
    ]
    return f"try {', '.join((*ways, 'a smaller mesh or image'))}"


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
    return Failure(f"{path}: {message} (see: {path} --help)", WRONG_USAGE)
