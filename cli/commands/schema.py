"""`texbake schema`: print the JSON Schema of pipeline and scene files."""

from __future__ import annotations

import json
from pathlib import Path

import click

from ..options import output_option
from ..terminal import Terminal, say, terminal_options
from ..types import FileOf


@click.command(
    epilog="""
    \b
    Example:
      texbake schema scene -o scene.schema.json
      texbake schema pipeline
    """
)
@click.argument("file", type=click.Choice(("pipeline", "scene")), metavar="pipeline|scene")
@output_option(
    FileOf((".json",)), "FILE.json", "Write the schema to this file.  [default: print it]"
)
@terminal_options
def schema(file: str, output: Path | None, terminal: Terminal) -> None:
    """Print the JSON Schema of pipeline or scene files.

    With it, an editor completes and checks TOML files as you type. In VS Code, install the
    extension Even Better TOML and put the line "#:schema scene.schema.json" at the top of a scene
    file.
    """
    from texbake.building.file import pipeline_schema, schema_file
    from texbake.rendering.scene.file.schema import scene_schema

    if output is None:
        contents = pipeline_schema() if file == "pipeline" else scene_schema()
        say(json.dumps(contents, indent=2))
    else:
        terminal.wrote(schema_file(file, output).files)
