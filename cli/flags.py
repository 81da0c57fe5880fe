"""Messages of the library, which name its parameters, in the words of a command: its flags.

The library writes a parameter as Python has it. A message that is about parameters opens with
their names (`max_error: 'x' is ...`); elsewhere they stand in backticks, with a value where that
helps: raise `front`, or bake with `samples=16`. Here, and only here, those become the flags of the
command that runs.
"""

from __future__ import annotations

import re

import click

_OPENING = re.compile(r"\w+(?:, \w+)*(?=: )")
_QUOTED = re.compile(r"`(\w+)(?:=([^`\s]+))?`")
_FALSE, _QUOTES = "False", "\"'"


def with_flags(message: str, command: click.Command | None = None) -> str:
    """Write a message with the flags of a command in place of the library's parameters.

    Parameters
    ----------
    message
        Of the library.
    command
        None: the one that runs. Parameters that it does not have stay as they are.

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
    opening = _OPENING.match(message)
    if opening is not None:
        names = opening[0].split(", ")
        shown = ", ".join(_flag(parameters[n]) if n in parameters else n for n in names)
        message = shown + message[opening.end() :]

    def flag(found: re.Match[str]) -> str:
        parameter = parameters.get(found[1])
        return found[0] if parameter is None else _flag(parameter, found[2])

    return _QUOTED.sub(flag, message)


def _flag(parameter: click.Parameter, value: str | None = None) -> str:
    if not isinstance(parameter, click.Option):
        return parameter.human_readable_name
    if not parameter.is_flag:
        flag = max(parameter.opts, key=len)
        return flag if value is None else f"{flag} {value.strip(_QUOTES)}"
    return (parameter.secondary_opts or parameter.opts)[0] if value == _FALSE else parameter.opts[0]
