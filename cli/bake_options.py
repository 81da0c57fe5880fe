"""Flags of bakes that several commands share, and the meshes that a bake of parts reads."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

import texbake
from texbake import BakeOptions, FileError, PartsOptions

from .options import (
    MESH_SUFFIXES,
    Decorator,
    all_of,
    image_option,
    mesh_option,
    options_of,
    picture_option,
    report_option,
)
from .types import FileOf

FORMATS = ("png", "exr", "tif", "tga")
HITS_SUFFIXES = (".npz",)
_SECONDARY = ("secondary_rays", "denoise", "occluder_distance", "thickness_distance")
_PARTS = (
    *("match_by_name", "join_objects", "high_suffix", "low_suffix", "occluders"),
    "texture_sets",
)
# What only the bake of one mesh onto one set of maps can do.
OF_ONE_MESH = ("html", "hits", "time_budget", "max_memory")

maps_option = options_of(BakeOptions, "maps")
height_options = options_of(BakeOptions, "mid", "scale")
secondary_options = options_of(BakeOptions, *_SECONDARY)
format_option = click.option(
    "--format",
    "suffix",
    type=click.Choice(FORMATS),
    help="File format of the maps; exr and tif store heights as floats.  [default: png]",
)
name_pattern_option = click.option(
    "--name-pattern",
    default="{map}.{ext}",
    show_default=True,
    metavar="PATTERN",
    help="Names of the files: {asset} is the low-poly mesh's file without suffix, {map} the map, "
    "{set} the texture set, {udim} the tile (with it all tiles are baked), {ext} the format.",
)
bake_options = all_of(
    [
        options_of(BakeOptions, "size", "samples", "max_error", "time_budget"),
        options_of(BakeOptions, "space", "convention", "bits", "front", "back", "max_reach"),
        mesh_option(
            "--cage",
            "Start the rays on this mesh, which is the low-poly mesh with its vertices moved "
            "outwards.",
        ),
        options_of(BakeOptions, "rays"),
        image_option(
            "--skew-mask",
            "Blend the direction of the rays by this image on the low-poly mesh's coordinates, "
            "from --rays (0) to the face's normal (1).",
        ),
        image_option(
            "--offset-map",
            "Multiply the front distance, or the cage's offset, by this image. Values are 0 to 1; "
            "float files may hold greater ones.",
        ),
        options_of(BakeOptions, "orientation", "high_shading", "high_normal_maps"),
        options_of(BakeOptions, "cull_back_faces", "padding", "fill"),
        options_of(BakeOptions, "on_miss", "fail_on_miss", "bake_island"),
        picture_option("--miss-map", "Also draw where rays missed."),
        report_option,
        options_of(BakeOptions, "max_memory", "threads"),
    ]
)
source_options = all_of(
    [
        image_option(
            "--high-texture",
            "Image on the high-poly mesh's texture coordinates, for one map of its materials, such "
            "as base-color, or roughness, which is data.  [default: those that its file names]",
        ),
        options_of(BakeOptions, "vertex_colors", "curvature_scale"),
        name_pattern_option,
        click.option(
            "--hits",
            type=FileOf(HITS_SUFFIXES),
            metavar="FILE.npz",
            help="Also keep the hits, from which texbake remap makes other maps.",
        ),
    ]
)


def _more(side: str, kind: str) -> Decorator[Any]:
    return click.option(
        f"--{side}",
        f"more_{side}",
        type=FileOf(MESH_SUFFIXES),
        multiple=True,
        metavar="MESH|DIR",
        help=f"Another {kind} mesh, or a folder of them; repeatable.",
    )


parts_options = all_of(
    [
        _more("high", "high-poly"),
        _more("low", "low-poly"),
        options_of(PartsOptions, *_PARTS),
        click.option(
            "--dry-run",
            is_flag=True,
            help="Only print which parts would be baked from which, and what is left over.",
        ),
    ]
)
# Headings of the help of `texbake bake`, with the options below them.
SECTIONS = {
    "Rays": (
        *("front", "back", "max_reach", "cage", "rays", "skew_mask", "offset_map", "orientation"),
        *("high_shading", "high_normal_maps", "cull_back_faces", "on_miss", "fail_on_miss"),
        *("miss_map", "samples", "max_error", "time_budget"),
    ),
    "Values of the maps": (
        *("space", "convention", "bits", "mid", "scale", "vertex_colors", "high_texture"),
        *("curvature_scale", *_SECONDARY),
    ),
    "Assets of many parts": ("more_high", "more_low", *_PARTS, "dry_run"),
    "Files and resources": (
        *("fill", "bake_island", "name_pattern", "hits", "html", "report"),
        *("max_memory", "threads", "quiet", "progress"),
    ),
}


@dataclass(frozen=True)
class Asked:
    """The meshes and parts to bake.

    Attributes
    ----------
    high, low : tuple of Path
        Mesh files, including those in the folders that were given.
    name : str
        Name of the asset.
    """

    high: tuple[Path, ...]
    low: tuple[Path, ...]
    options: PartsOptions
    dry_run: bool
    name: str

    def is_plain(self, options: Mapping[str, Any]) -> bool:
        """Whether this is a bake of one high-poly and one low-poly mesh to one set of maps.

        Objects whose names pair up are parts, unless an option is only for the bake of one mesh.
        """
        pair = all(options[name] is None for name in OF_ONE_MESH)
        parts = texbake.needs_parts(self.high, self.low, self.options, pair=pair)
        return not (self.dry_run or parts)


def taken(
    context: click.Context,
    high: Path | None,
    low: Path | None,
    name_pattern: str,
    options: dict[str, Any],
) -> Asked:
    """Collect the meshes and parts from the arguments and the options of `parts_options`.

    With `--high`, a single argument is the low-poly mesh.
    """
    more_high, more_low = options.pop("more_high"), options.pop("more_low")
    if more_high and low is None:
        high, low = None, high
    highs = [path for path in (high, *more_high) if path is not None]
    lows = [path for path in (low, *more_low) if path is not None]
    for name, paths in (("HIGH", highs), ("LOW", lows)):
        if not paths:
            raise click.UsageError(f"Missing argument '{name}'.", context)
    chosen = {name: options.pop(name) for name in _PARTS}
    return Asked(
        tuple(_files(highs)),
        tuple(_files(lows)),
        PartsOptions(udim="{udim}" in name_pattern, **chosen),
        options.pop("dry_run"),
        lows[0].stem,
    )


def _files(paths: Iterable[Path]) -> list[Path]:
    """Return the files, and the meshes in folders sorted by name, without duplicates."""
    files: dict[Path, None] = {}
    for path in paths:
        if not os.path.isdir(path):  # noqa: PTH112  # no error for a name that is too long
            files[path] = None
            continue
        inside = sorted(file for file in path.iterdir() if file.suffix.lower() in MESH_SUFFIXES)
        if not inside:
            raise FileError(f"{path}: there is no mesh in it; give a folder of mesh files")
        files.update(dict.fromkeys(inside))
    return list(files)
