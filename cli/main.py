"""The `texbake` command: a group that imports each of its commands only when it is used.

A command is built from the verb of the same name, or defined in one of the modules named here. They
import only click and the dataclasses of options. Everything heavy is imported when the command
runs, so that `texbake --help` answers at once.
"""

from __future__ import annotations

import shlex
from importlib import import_module
from typing import Any

import click

from texbake import __version__
from texbake.errors import heard_warnings
from texbake.limits import raised_limits

from .messages import COMMAND, failures_as_one_line
from .signals import EXIT_CODES, WRONG_USAGE

# Each with the first sentence of its help, so that the list of commands imports none of them.
GROUPS = {
    "Whole jobs": {
        "run": "Do the whole job: from HIGH to a finished asset.",
        "lighten": "Make MODEL smaller, with all of its materials.",
        "demo": "Do the whole job on an orange that is made by code.",
    },
    "Pipelines": {
        "build": "Build the assets of a pipeline file.",
        "watch": "Build again whenever a file changes, until Ctrl-C.",
        "schema": "Print the JSON Schema of pipeline files, scene files or bench results.",
    },
    "Meshes": {
        "info": "Print what is in MESH.",
        "check": "Find problems of a bake before it runs.",
        "make": "Make a mesh of a parametric surface.",
        "convert": "Write the mesh in SOURCE in the format of OUTPUT.",
        "repair": "Repair MESH without moving its surface.",
        "transform": "Scale, rotate and move MESH, or flip its faces.",
        "remesh": "Give MESH a new surface, closed or open.",
        "simplify": "Reduce MESH to fewer triangles.",
        "unwrap": "Give MESH texture coordinates.",
        "cage": "Fit a cage around HIGH, starting from LOW.",
    },
    "Bakes": {
        "bake-normals": "Bake a normal map of HIGH for LOW.",
        "bake-displacement": "Bake a displacement map of HIGH for LOW.",
        "bake": "Bake one or several maps of HIGH for LOW.",
        "bake-lightmap": "Bake the static lights of SCENE into light maps.",
        "bake-texture": "Bake a procedure or photographs into a texture.",
        "remap": "Make other maps from the hits of an earlier bake.",
    },
    "Images": {
        "pack-textures": "Pack several IMAGEs into one.",
        "pack-channels": "Pack gray maps as the channels of one image.",
        "split-channels": "Split IMAGE into a gray map for each channel.",
        "height-to-normal": "Make a normal map from the heights in HEIGHT.",
        "normal-to-height": "Make a height map from the normals in NORMAL.",
        "mipmap": "Write the mip levels of IMAGE, down to one texel.",
        "cubemap": "Convert SOURCE to a cube map, or from one.",
    },
    "Results": {
        "preview": "Draw a mesh with its maps, or a scene.",
        "compare": "Measure how close LOW with its maps comes to HIGH.",
        "export": "Write MESH and its maps for another program.",
    },
    "Accuracy and time": {
        "study": "Measure what each setting buys and costs.",
        "bench": "Compare texbake with other programs.",
    },
}
"""The commands, by purpose."""

# Modules of the commands that have no verb.
_MODULES = {"pipelines": ("build", "watch", "schema"), "measurements": ("study", "bench")}
COMMANDS = {name: purpose for group in GROUPS.values() for name, purpose in group.items()}


class LazyGroup(click.Group):
    """The commands of `COMMANDS`, in that order. Every failure is printed as one line."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands, group by group."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the module of a command and return the command, or None for an unknown name."""
        if cmd_name not in COMMANDS:
            return None
        from texbake.verbs.verb import find_verb

        from .verbs import command_of

        verb = find_verb(cmd_name)
        if verb is not None:
            return command_of(verb)
        module = next(module for module, names in _MODULES.items() if cmd_name in names)
        command = getattr(import_module(f".{module}", __package__), cmd_name)
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands by group, and what each is for."""
        longest = max(map(len, COMMANDS))
        for heading, commands in GROUPS.items():
            with formatter.section(heading):
                formatter.write_dl([(name.ljust(longest), text) for name, text in commands.items()])

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
        context.meta[COMMAND] = shlex.join([context.info_name or "texbake", *words])
        return context

    def invoke(self, ctx: click.Context) -> Any:
        """Parse and run a command."""
        with failures_as_one_line(ctx):
            return super().invoke(ctx)


@click.group(
    cls=LazyGroup,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="""
    \b
    Example:
      texbake run scan.ply -o asset --faces 500

    \b
    Completion in bash (zsh and fish alike, with their names):
      eval "$(_TEXBAKE_COMPLETE=bash_source texbake)"

    \b
    Exit codes:
    """
    + "".join(f"  {code:<9} {meaning}\n    " for code, meaning in EXIT_CODES.items()),
)
@click.version_option(__version__, prog_name="texbake")
@click.option(
    "--max-image",
    metavar="SIDE",
    type=int,
    help="Read images of up to SIDE x SIDE pixels, instead of 16384 x 16384.",
)
@click.option(
    "--max-triangles",
    metavar="N",
    type=click.IntRange(min=1),
    help="Read files that repeat meshes up to N triangles in total; the default depends on the "
    "format, 20,000,000 for glTF.",
)
@click.option(
    "--allow-outside",
    is_flag=True,
    help="Read files that a mesh or scene names outside its own folder.",
)
@click.pass_context
def texbake(
    ctx: click.Context, max_image: int | None, max_triangles: int | None, allow_outside: bool
) -> None:
    """Bake the detail of a high-poly mesh into maps for a low-poly one.

    Simplifies meshes, gives them texture coordinates, bakes normal, displacement and other maps,
    and renders the result, without a GPU or a display.
    """
    ctx.with_resource(heard_warnings(_warn))
    ctx.with_resource(
        raised_limits(max_image=max_image, max_triangles=max_triangles, allow_outside=allow_outside)
    )
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())
        ctx.exit(WRONG_USAGE)


def _warn(line: str) -> None:
    from .terminal import Terminal

    Terminal().warn(line)
