"""The option `--html`, and the command line shown on its pages."""

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
    """Store the arguments of a command for `command_line`."""
    context.meta[_COMMAND] = shlex.join([context.info_name or "texbake", *args])


def command_line() -> str:
    """Return the running command for a shell; "" if it has no arguments to show."""
    return str(click.get_current_context().meta.get(_COMMAND, ""))
