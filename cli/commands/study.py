"""`texbake study`: what accuracy costs in time."""

from __future__ import annotations

from pathlib import Path

import click

import texbake
from texbake.study.options import KNOB_NAMES, StudyOptions

from ..options import MESH_SUFFIXES, number_option, output_folder, threads_option
from ..terminal import Terminal, columns, terminal_options
from ..types import FileOf

SCENE_SUFFIXES = (".toml", ".glb", ".gltf")


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
    help="Draw this scene where one is drawn.",
)
@click.option(
    "--knob",
    "knobs",
    type=click.Choice(KNOB_NAMES),
    multiple=True,
    metavar="NAME",
    help=f"Study only this; repeatable. {', '.join(KNOB_NAMES)}.  [default: all]",
)
@output_folder("Folder of the results.", default=Path("study"), show_default=True)
@number_option("--repeats", int, StudyOptions.repeats, "N", "Timed runs of each setting.")
@number_option(
    "--seconds",
    float,
    StudyOptions.seconds,
    "S",
    "Run a setting no more once it has taken as long, but at least twice.",
)
@click.option("--quick", is_flag=True, help="A small range on small meshes, in a minute.")
@threads_option
@terminal_options
def study(
    high: Path | None,
    low: Path | None,
    scene: Path | None,
    knobs: tuple[str, ...],
    output: Path,
    repeats: int,
    seconds: float,
    quick: bool,
    threads: int | None,
    terminal: Terminal,
) -> None:
    """Measure what each setting buys and costs.

    On the pair HIGH and LOW and on a scene, or on made ones whose truth is known. Writes a page
    that opens without a network, its plots, a contact sheet, and all figures as JSON and CSV.
    """
    options = StudyOptions(
        knobs=knobs or KNOB_NAMES, repeats=repeats, seconds=seconds, quick=quick, threads=threads
    )
    with terminal.progress() as progress:
        done = texbake.study_files(
            output, options, high=high, low=low, scene=scene, progress=progress
        )
    for warning in done.warnings:
        terminal.warn(warning)
    if not terminal.quiet:
        columns(texbake.study_rows(done.report), numbers=2)
    terminal.wrote(done.files[:1])
