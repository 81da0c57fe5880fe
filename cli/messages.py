"""Messages of the library on a terminal: with the flags of a command, and safe to print.

The library writes parameters by their Python names. A message about parameters opens with their
names (`max_error: 'x' is ...`). Elsewhere they are in backticks, with a value if that helps: raise
`front`, or bake with `samples=16`. Only this module turns them into the flags of the running
command.
"""

from __future__ import annotations

import re

import click

from texbake import OptionError

_QUOTED = re.compile(r"`(\w+)(?:=([^`\s]+))?`")
COMMAND = "texbake.command"  # where the context keeps the command line
_FALSE, _QUOTES = "False", "\"'"


def with_flags(message: str, command: click.Command | None = None, *, opening: bool = True) -> str:
    """Replace the library's parameters in a message by the flags of a command.

    Without `opening` the first word stays, even if it is the name of a parameter.

    Examples
    --------
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
    r"""Return text with control characters as escapes: it moves no cursor and sets no color.

    >>> print(printable("red\x1b[31m"))
    red\x1b[31m
    """
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
