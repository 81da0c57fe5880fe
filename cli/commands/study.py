"""`texbake study`: measure accuracy against time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from texbake.study.options import StudyOptions

from ..options import MESH_SUFFIXES, SCENE_SUFFIXES, options_of, output_folder
from ..terminal import Terminal, columns, terminal_options
from ..types import FileOf


@click.command(
    epilog="""
    \b
    Example:
      texbake study --quick
      texbake study scan.ply low_uv.obj -o study
      texbake study scan.ply low_uv.obj --knob texture-size --knob samples
      texbake study --scene room.toml --knob shadow-map
    """
)
@click.argument("high", type=FileOf(MESH_SUFFIXES), required=False)
@click.argument("low", type=FileOf(MESH_SUFFIXES), required=False)
@click.option(
    "--scene",
    type=FileOf(SCENE_SUFFIXES),
    metavar="SCENE",
    help="Scene to draw, for settings that are studied on pictures.  [default: a generated one]",
)
@options_of(StudyOptions, "knobs")
@output_folder("Folder of the results.", default=Path("study"), show_default=True)
@options_of(StudyOptions, "repeats", "seconds", "quick", "threads")
@terminal_options
def study(
    high: Path | None,
    low: Path | None,
    scene: Path | None,
    output: Path,
    terminal: Terminal,
    **choices: Any,
) -> None:
    """Measure what each setting buys and costs.

    Uses the meshes HIGH and LOW and a scene, or generated ones with known answers. Writes a
    page that opens without a network, its plots, a contact sheet, and all figures as JSON and CSV.
    """
    options = StudyOptions(**{name: value for name, value in choices.items() if value != ()})
    from texbake.study.study import study_files, study_rows

    with terminal.progress() as progress:
        done = study_files(output, options, high=high, low=low, scene=scene, progress=progress)
    for warning in done.warnings:
        terminal.warn(warning)
    if not terminal.quiet:
        columns(study_rows(done.report), numbers=2)
    terminal.wrote(done.files[:1])
