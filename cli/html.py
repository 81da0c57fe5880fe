"""`--html`: the option, and the command line that its pages show."""

from __future__ import annotations

import shlex

import click

from .types import FileOf

_COMMAND = "texbake.command"

html_option = click.option(
    "--html",
    type=FileOf((".html",)),
    metavar="FILE.html",
    help="Also write an HTML page with the meshes, their maps, errors and times.",
)


def keep_command(context: click.Context, args: list[str]) -> None:
    """Keep the words of a command for `command_line`."""
    context.meta[_COMMAND] = shlex.join([context.info_name or "texbake", *args])


def command_line() -> str:
    """Return the command that runs, to paste; "" where it was not given as words."""
    return str(click.get_current_context().meta.get(_COMMAND, ""))
