"""The options of `texbake unwrap` that make up `UnwrapOptions`, in sections."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import click

import texbake
from texbake import UnwrapOptions, option_field

from .options import Command, all_of, options_of
from .types import FileOf

# Headings of the help, with the options below them.
SECTIONS = {
    "Method": ("method", "size", "only", "uv_set"),
    "Atlas": (
        "padding",
        "quality",
        "max_stretch",
        "seams_at_hard_edges",
        "seam_angle",
        "tiles",
        "by_group",
        "keep",
        "charts",
        "timeout",
    ),
    "Classical mappings": (
        *("axis", "center", "normal", "fit", "sides", "theta", "height", "caps", "overlap"),
        *("surface", "via", "eye", "camera", "fov", "matrix", "unseen", "linear"),
    ),
    "Normals": ("normals", "angle"),
    "Afterwards, in this order": ("warp", "flip", "rotate", "scale", "texel_density", "offset"),
}
_NAMES = tuple(name for names in SECTIONS.values() for name in names)
_BEFORE, _AFTER = _NAMES[: _NAMES.index("matrix")], _NAMES[_NAMES.index("matrix") + 1 :]


def mapping_options(command: Command) -> Command:
    """Add the options of the mapping; the command receives them as `options`, `UnwrapOptions`."""

    @functools.wraps(command)
    def with_options(*args: Any, matrix: Path | None, **values: Any) -> None:
        chosen = {name: values.pop(name) for name in (*_BEFORE, *_AFTER)}
        if matrix is not None:
            chosen["matrix"] = texbake.read_matrix(matrix)
        command(*args, options=UnwrapOptions(**chosen), **values)

    matrix = click.option(
        "--matrix",
        type=FileOf((".txt",)),
        metavar="FILE",
        help=option_field(UnwrapOptions, "matrix").option.help,
    )
    flags = (options_of(UnwrapOptions, *_BEFORE), matrix, options_of(UnwrapOptions, *_AFTER))
    return all_of(flags)(with_options)  # type: ignore[no-any-return]
