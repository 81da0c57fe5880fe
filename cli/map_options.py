"""Options of the commands that make several maps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from texbake.baking.file_names import DEFAULT_PATTERN, map_file_names
from texbake.baking.options import VERTEX_COLORS, BakeOptions

from .options import choice_option, image_option, number_option
from .types import FileOf

Command = TypeVar("Command", bound=Callable[..., Any])

FORMATS = ("png", "exr", "tif", "tga")
HITS_SUFFIXES = (".npz",)

name_pattern_option = click.option(
    "--name-pattern",
    default=DEFAULT_PATTERN,
    show_default=True,
    metavar="PATTERN",
    help="Names of the files: {asset} is the light mesh's file without suffix, {map} the map, "
    "{set} the texture set, {udim} the tile (with it all tiles are baked), {ext} the format.",
)

curvature_scale_option = number_option(
    "--curvature-scale",
    float,
    BakeOptions.curvature_scale,
    "K",
    "Curvature that is white in integer files, in one by model units.  "
    "[default: what 99 % of the texels keep to]",
)

_SOURCE_OPTIONS = (
    image_option(
        "--high-texture",
        "Image on the dense mesh's own texture coordinates, for the map texture.  "
        "[default: what its file names]",
    ),
    choice_option(
        "--vertex-colors",
        VERTEX_COLORS,
        BakeOptions.vertex_colors,
        "What the dense mesh's vertex colors are; auto: linear in glTF files, else sRGB.",
    ),
    curvature_scale_option,
    name_pattern_option,
    click.option(
        "--hits",
        type=FileOf(HITS_SUFFIXES),
        metavar="FILE.npz",
        help="Also keep the trace, from which texbake remap makes other maps.",
    ),
)


def source_options(command: Command) -> Command:
    """Add what maps are made from beside rays, and what their files are called."""
    for option in reversed(_SOURCE_OPTIONS):
        command = option(command)
    return command


def map_files(
    folder: Path, pattern: str, light_mesh: str, maps: tuple[str, ...], suffix: str | None
) -> dict[str, Path]:
    """Files of maps of a light mesh, by the names of the maps."""
    names = map_file_names(
        pattern, asset=Path(light_mesh).stem, maps=maps, ext=suffix or FORMATS[0]
    )
    return {name: folder / file for name, file in names.items()}
