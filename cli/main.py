"""The `texbake` command."""

from __future__ import annotations

import click

from texbake import __version__
from texbake.errors import heard_warnings
from texbake.limits import raised_limits

from .lazy import LazyGroup
from .signals import WRONG_USAGE


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
    """,
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
