"""What the three bake commands do: check the outputs, bake, write, tell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake.bake.options import BakeOptions
from texbake.files import check_folder, check_writable, make_folder
from texbake.progress import Stages

from .outputs import check_distinct, check_picture, check_report
from .terminal import Terminal

if TYPE_CHECKING:
    from texbake import WrittenMap


def bake_to_files(
    high: Path,
    low: Path,
    files: dict[str, Path],
    terminal: Terminal,
    *,
    folder: Path | None = None,
    cage: Path | None,
    miss_map: Path | None,
    report: Path | None,
    **choices: Any,
) -> None:
    """Bake maps of two mesh files.

    Parameters
    ----------
    files
        Map name to the file that it is written to.
    folder
        Of the files, where it is to be made if it is missing.
    cage, miss_map, report
        Files, where they are asked for.
    choices
        Fields of `BakeOptions`, all but `maps`.
    """
    options = BakeOptions(maps=tuple(files), **choices)
    check_distinct([*files.values(), miss_map, report], [high, low, cage])
    _check_outputs(files, folder, miss_map, report, options)
    import texbake
    from texbake.pipeline.report import write_report

    with terminal.progress() as progress:
        stages = Stages(progress)
        with stages.part("read meshes"):
            high_mesh, low_mesh = (
                texbake.read_mesh(path, progress=progress) for path in (high, low)
            )
            cage_mesh = None if cage is None else texbake.read_mesh(cage, progress=progress)
        result = texbake.bake(high_mesh, low_mesh, options, cage=cage_mesh, progress=progress)
        with stages.stage("write maps"):
            if folder is not None:
                make_folder(folder)
            written = {name: result.maps[name].write(path) for name, path in files.items()}
            if miss_map is not None:
                texbake.write_image(result.miss_map(), miss_map)
        reading, writing = stages.records
        figures = replace(result.report, stages=[reading, *result.report.stages, writing])
        if report is not None:
            coded = {name: asdict(file) for name, file in written.items()}
            write_report(report, {**figures.to_json(), "files": coded})
    for warning in [*figures.warnings, *_clipped(written)]:
        terminal.warn(warning)
    terminal.summary(figures.table())
    terminal.wrote(path for path in (*files.values(), miss_map, report) if path is not None)


def _clipped(written: Mapping[str, WrittenMap]) -> list[str]:
    return [
        f"{file.path}: {file.n_clipped:,} values lie outside what --mid and --scale hold and are "
        "clipped; give a greater --scale, or none"
        for file in written.values()
        if file.n_clipped
    ]


def _check_outputs(
    files: dict[str, Path],
    folder: Path | None,
    miss_map: Path | None,
    report: Path | None,
    options: BakeOptions,
) -> None:
    from texbake.bake.maps import MAPS
    from texbake.texture.image_formats import check_image_format

    for name, path in files.items():
        check_image_format(path, options.bits, channels=MAPS[name].channels, lossless=True)
        if folder is None:
            check_writable(path)
    if folder is not None:
        check_folder(folder)
    check_picture(miss_map)
    check_report(report)
