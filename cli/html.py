"""The command line that pages show as the command that made them."""

from __future__ import annotations

import shlex

import click

_COMMAND = "texbake.command"


def keep_command(context: click.Context, args: list[str]) -> None:
    """Store the arguments of a command for `command_line`."""
    context.meta[_COMMAND] = shlex.join([context.info_name or "texbake", *args])


def command_line() -> str:
    """Return the running command for a shell; "" if it has no arguments to show."""
    return str(click.get_current_context().meta.get(_COMMAND, ""))
