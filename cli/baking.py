"""What the three bake commands do: check the outputs, bake, write, tell."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from texbake.bake.options import BakeOptions
from texbake.files import check_writable
from texbake.pipeline.folder import check_folder, make_folder

from .outputs import check_distinct, check_picture, check_report
from .terminal import Terminal


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
    _check_outputs(files, folder, miss_map, report, options)
    import texbake
    from texbake.pipeline.report import write_report

    with terminal.progress() as progress:
        high_mesh, low_mesh = (texbake.read_mesh(path, progress=progress) for path in (high, low))
        cage_mesh = None if cage is None else texbake.read_mesh(cage, progress=progress)
        result = texbake.bake(high_mesh, low_mesh, options, cage=cage_mesh, progress=progress)
        written = {}
        if folder is not None:
            make_folder(folder)
        for name, path in files.items():
            file = result.maps[name].write(path)
            written[name] = {"path": str(path), "clipped": file.n_clipped, **file.metadata}
            if file.n_clipped:
                terminal.warn(
                    f"{path}: {file.n_clipped:,} values lie outside what --mid and --scale hold "
                    "and are clipped; give a greater --scale, or none"
                )
        if miss_map is not None:
            texbake.write_image(result.miss_map(), miss_map)
        if report is not None:
            write_report(report, {**result.report.to_json(), "files": written})
    for warning in result.report.warnings:
        terminal.warn(warning)
    terminal.summary(result.report.table())
    terminal.wrote(path for path in (*files.values(), miss_map, report) if path is not None)


def _check_outputs(
    files: dict[str, Path],
    folder: Path | None,
    miss_map: Path | None,
    report: Path | None,
    options: BakeOptions,
) -> None:
    from texbake.bake.maps import MAPS
    from texbake.texture.image import check_image_format

    check_distinct([*files.values(), miss_map, report])
    for name, path in files.items():
        check_image_format(path, options.bits, channels=MAPS[name].channels)
        if folder is None:
            check_writable(path)
    if folder is not None:
        check_folder(folder)
    check_picture(miss_map)
    check_report(report)
