"""Print the library's messages, with the flags of the command, and its failures on a terminal.

The library writes parameters by their Python names. A message about parameters opens with their
names (`max_error: 'x' is ...`). Elsewhere they are in backticks, with a value if that helps: raise
`front`, or bake with `samples=16`. Only this module turns them into the flags of the running
command.

A failure of a command is one line on stderr and an exit code of `EXIT_CODES`. Any other exception
is a bug and prints its traceback.
"""

from __future__ import annotations

import errno
import re
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import click

from texbake import FileError, OptionError, TexbakeError
from texbake.errors import is_out_of_memory

from .signals import FAILED, SIGNALED, WRONG_USAGE, Terminated, line_is_mine, raised_signals

_QUOTED = re.compile(r"`(\w+)(?:=([^`\s]+))?`")
COMMAND = "texbake.command"  # where the context keeps the command line
STREAMS = "texbake.streams"  # ... and the folder of files that stand for standard streams
_FALSE, _QUOTES = "False", "\"'"


def with_flags(message: str, command: click.Command | None = None, *, opening: bool = True) -> str:
    """Replace the library's parameters in a message by flags, but the first word without `opening`.

    >>> bake = click.Command("bake", params=[click.Option(["--max-error"])])
    >>> with_flags("max_error: 'x' is no error; give `max_error=0.01%` or `samples`", bake)
    "--max-error: 'x' is no error; give --max-error 0.01% or `samples`"
    """
    if command is None:
        context = click.get_current_context(silent=True)
        if context is None:
            return message
        command = context.command
    parameters = {parameter.name: parameter for parameter in command.params}
    names = OptionError(message).parameters if opening else ()
    shown = ", ".join(_flag(parameters[n]) if n in parameters else n for n in names)
    message = shown + message.removeprefix(", ".join(names))

    def flag(found: re.Match[str]) -> str:
        parameter = parameters.get(found[1])
        return found[0] if parameter is None else _flag(parameter, found[2])

    return _QUOTED.sub(flag, message)


def _flag(parameter: click.Parameter, value: str | None = None) -> str:
    if not isinstance(parameter, click.Option):
        return parameter.human_readable_name
    if not parameter.is_flag:
        flag = next((name for name in parameter.opts if name.startswith("--")), parameter.opts[0])
        return flag if value is None else f"{flag} {value.strip(_QUOTES)}"
    return (parameter.secondary_opts or parameter.opts)[0] if value == _FALSE else parameter.opts[0]


# Control characters but the line feed, marks that reorder a line, and what stands for bytes that
# are not UTF-8.
_UNSAFE = re.compile(
    "[\x00-\x09\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)


def printable(text: str) -> str:
    r"""Return text with control characters as escapes, without the folder of standard streams.

    >>> print(printable("red\x1b[31m"))
    red\x1b[31m
    """
    context = click.get_current_context(silent=True)
    if context is not None and STREAMS in context.meta:
        text = text.replace(context.meta[STREAMS], "")
    return _UNSAFE.sub(lambda match: _escape(match[0]), text)


def in_line(text: str) -> str:
    r"""Return printable text without line feeds, so that a name cannot pass for a line of its own.

    >>> print(in_line("red\nwrote a.png"))
    red\x0awrote a.png
    """
    return printable(text).replace("\n", r"\x0a")


def _escape(character: str) -> str:
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:  # a byte of a file name
        code -= 0xDC00
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


def command_line() -> str:
    """Return the running command for a shell, as pages show it; "" if it has no arguments."""
    return str(click.get_current_context().meta.get(COMMAND, ""))


class Failure(click.ClickException):
    """A failure of a command, printed as one line."""

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(printable(" ".join(line.strip() for line in message.splitlines())))
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
        message = with_flags(str(error), _command(ctx), opening=not isinstance(error, FileError))
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
