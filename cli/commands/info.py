"""`texbake info`: what is in a mesh."""

from __future__ import annotations

import json
from pathlib import Path

import click

from ..options import mesh_argument
from ..terminal import Terminal, table, terminal_options


@click.command(
    epilog="""
    \b
    Example:
      texbake info scan.ply
      texbake info scan.ply --json
    """
)
@mesh_argument("mesh")
@click.option("--json", "as_json", is_flag=True, help="Print JSON alone.")
@terminal_options
def info(mesh: Path, as_json: bool, terminal: Terminal) -> None:
    """Tell what is in MESH.

    Counts, bounds, texture coordinates, normals, components, boundary and non-manifold edges, and
    degenerate faces.
    """
    import texbake

    with terminal.progress() as progress:
        found = texbake.mesh_info(texbake.read_mesh(mesh, progress=progress))
    if as_json:
        click.echo(json.dumps(found.to_json(), indent=2))
    else:
        table(found.table())
