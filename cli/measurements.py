"""`texbake study` and `bench`: accuracy against time, and texbake beside other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from texbake.study.options import BenchOptions, StudyOptions

from .options import MESH_SUFFIXES, SCENE_SUFFIXES, options_of, output_folder
from .terminal import Terminal, columns, terminal_options
from .types import FileOf


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
    page that opens without a network, its plots, and all figures as JSON.
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


@click.command(
    epilog="""
    \b
    Example:
      texbake bench --quick
      texbake bench --blender ~/bpy/bin/python -o bench
      texbake bench --task bake-normals --case sphere --triangles 4000000 --size 2048
      texbake bench scan.ply low_uv.obj --task bake-normals --task bake-ao
      texbake bench --quick --export cases
      texbake bench --merge bench/bench.json --merge cases/blender.json -o merged
    """
)
@click.argument("high", type=FileOf(MESH_SUFFIXES), required=False)
@click.argument("low", type=FileOf(MESH_SUFFIXES), required=False)
@options_of(BenchOptions, "tasks", "cases", "programs", "sizes", "triangles", "blender")
@click.option(
    "--export",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="FOLDER",
    help="Write the cases for other programs into this folder, and run nothing.",
)
@click.option(
    "--merge",
    type=FileOf((".json",)),
    metavar="FILE",
    multiple=True,
    help="Add the results of this file, and measure the errors of its maps; repeatable. Programs "
    "are then run only where --program names them.",
)
@output_folder("Folder of the results.", default=Path("bench"), show_default=True)
@options_of(BenchOptions, "repeats", "seconds", "timeout", "quick")
@terminal_options
def bench(
    high: Path | None,
    low: Path | None,
    export: Path | None,
    merge: tuple[Path, ...],
    output: Path,
    terminal: Terminal,
    **choices: Any,
) -> None:
    """Compare texbake with other programs.

    Runs texbake, Blender, pymeshlab, xatlas, fast-simplification and meshoptimizer, those that are
    installed, on generated meshes whose true shape is a formula, or on the meshes HIGH and LOW.
    Times whole processes and measures errors, missed texels, failures and memory. Writes a page
    that opens without a network, its plots, Markdown tables, and all figures as JSON.
    """
    settings: dict[str, Any] = {name: value for name, value in choices.items() if value != ()}
    if high is not None:
        settings.setdefault("cases", ())
    options = BenchOptions(**settings)
    from texbake.study.bench.run import bench_files, bench_rows, export_files

    with terminal.progress() as progress:
        if export is not None:
            terminal.wrote(export_files(export, options, progress=progress).files)
            return
        done = bench_files(
            output,
            options,
            high=high,
            low=low,
            merge=merge,
            run=not merge or "programs" in settings,
            progress=progress,
        )
    for warning in done.warnings:
        terminal.warn(warning)
    if not terminal.quiet:
        columns(bench_rows(done.report), numbers=2)
    terminal.wrote(done.files[:1])
