"""Run the jobs of the bake commands, and print their warnings, figures and files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import texbake

from .bake_options import Asked
from .html import command_line
from .terminal import Terminal

# Files that only the bake of one mesh to one set of maps can write.
_OF_ONE_MESH = ("html", "hits")
_FILES = ("cage", "high_texture", "skew_mask", "offset_map", "miss_map", "report")


def bake_one(
    high: Path,
    low: Path,
    output: Path | Mapping[str, Path],
    terminal: Terminal,
    **choices: Any,
) -> None:
    """Bake the maps of two mesh files into a folder, or into one file per map.

    `choices` are files for the job and fields of `BakeOptions`.
    """
    names = (*_FILES, *_OF_ONE_MESH, "format", "name_pattern", "join_objects")
    given = {name: choices.pop(name) for name in names if name in choices}
    if isinstance(output, Mapping):
        choices["maps"] = tuple(output)
    options = texbake.BakeOptions(keep_hits=given.get("hits") is not None, **choices)
    with terminal.progress() as progress:
        done = texbake.bake_files(
            high,
            low,
            output,
            options,
            command=command_line(),
            progress=progress,
            clock=terminal.clock(),
            **given,
        )
    for warning in done.warnings:
        terminal.warn(warning)
    terminal.summary(done.report.table())
    terminal.wrote(done.files)


def bake_parts(asked: Asked, folder: Path, terminal: Terminal, **choices: Any) -> None:
    """Bake an asset of several meshes, or print the matching of its parts (`--dry-run`)."""
    for name in _OF_ONE_MESH:
        if choices.pop(name) is not None:
            raise texbake.OptionError(f"{name}: is for the bake of one mesh onto one set of maps")
    names = (*_FILES, "format", "name_pattern")
    given = {name: choices.pop(name) for name in names if name in choices}
    options = texbake.BakeOptions(**choices)
    if asked.dry_run:
        _print_matching(asked, given["report"], terminal)
        return
    with terminal.progress() as progress:
        done = texbake.bake_parts_files(
            asked.high,
            asked.low,
            folder,
            options,
            asked.options,
            name=asked.name,
            progress=progress,
            **given,
        )
    for warning in done.warnings:
        terminal.warn(warning)
    terminal.summary(done.report.table())
    terminal.wrote(done.files)


def _print_matching(asked: Asked, report: Path | None, terminal: Terminal) -> None:
    with terminal.progress() as progress:
        done = texbake.match_parts_files(
            asked.high, asked.low, asked.options, report=report, progress=progress
        )
    for warning in done.warnings:
        terminal.warn(warning)
    terminal.summary(done.report.table())
    terminal.wrote(done.files)


def bake_light_maps(
    scene: Path,
    folder: Path,
    terminal: Terminal,
    *,
    format: str,  # noqa: A002
    uv_set: str | None,
    **choices: Any,
) -> None:
    """Bake the light maps of a scene file; `choices` are fields of `BakeOptions`."""
    with terminal.progress() as progress:
        done = texbake.bake_light_map_files(
            scene, folder, texbake.BakeOptions(**choices), format=format, uv_set=uv_set,
            progress=progress,
        )  # fmt: skip
    for warning in done.warnings:
        terminal.warn(warning)
    terminal.summary(done.report.table())
    terminal.wrote(done.files)
