"""A group of commands that imports each command only when it is used.

Each command is in a module of the same name, under the same name, with `_` for `-`. These modules
import only click and the dataclasses of options. Everything heavy is imported when the command
runs, so that `texbake --help` answers at once.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import click

from .failures import failures_as_one_line
from .html import keep_command

COMMANDS = (
    "info",
    "check",
    "make",
    "simplify",
    "unwrap",
    "cage",
    "bake-normals",
    "bake-displacement",
    "bake",
    "bake-lightmap",
    "remap",
    "bake-texture",
    "pack-textures",
    "height-to-normal",
    "normal-to-height",
    "mipmap",
    "cubemap",
    "preview",
    "compare",
    "export",
    "run",
    "build",
    "watch",
    "schema",
    "study",
    "demo",
)


class LazyGroup(click.Group):
    """The commands of `COMMANDS`, in that order. Every failure is printed as one line."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands in the order of a typical workflow."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the module of a command and return the command, or None for an unknown name."""
        if cmd_name not in COMMANDS:
            return None
        name = cmd_name.replace("-", "_")
        command = getattr(import_module(f".commands.{name}", __package__), name)
        assert isinstance(command, click.Command)
        return command

    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: click.Context | None = None,
        **extra: Any,
    ) -> click.Context:
        """Parse the options of the group itself."""
        words = list(args)  # parsing empties it
        with failures_as_one_line():
            context = super().make_context(info_name, args, parent, **extra)
        keep_command(context, words)
        return context

    def invoke(self, ctx: click.Context) -> Any:
        """Parse and run a command."""
        with failures_as_one_line(ctx):
            return super().invoke(ctx)
