"""Replace the parameter names in messages of the library by the flags of a command.

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
