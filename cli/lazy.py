"""A group of commands, each imported only when it is asked for.

The module of a command has the command's name and holds it under that name, with `_` for `-`.
Modules of commands import click and the options' dataclasses, nothing heavy: that waits until the
command runs, so that `texbake --help` answers at once.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import click

from .failures import told_in_one_line
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
    """The commands of `COMMANDS`, in that order, with every failure told in one line."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Name the commands in the order in which a job uses them."""
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
        with told_in_one_line():
            context = super().make_context(info_name, args, parent, **extra)
        keep_command(context, words)
        return context

    def invoke(self, ctx: click.Context) -> Any:
        """Parse and run a command."""
        with told_in_one_line(ctx):
            return super().invoke(ctx)
