"""Pictures of texture coordinates: the charts laid out flat, and a checker on the mesh.

On the checker a person sees at once what figures of stretch mean: where the cells have equal size
and shape the texture looks as it was painted, and where their names read backwards it is mirrored.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, quoted
from texbake.files import PathLike, check_writable, replacing
from texbake.mapping.corner_uvs import measurable_uvs, signed_areas
from texbake.mapping.layout import draw_layout
from texbake.mapping.layout_svg import layout_svg
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import Mesh
from texbake.progress import ProgressSink, Stages
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.panels import Panel, side_by_side
from texbake.rendering.studio import studio_scene
from texbake.texture.checker import checker_image
from texbake.texture.image import write_image

LAYOUT_SUFFIXES = (".png", ".svg")

N_CELLS = 16
_TEXELS = 1024
_LEAST_CELL = 4  # texels; smaller cells cannot be distinguished
# With enough samples that distant cells do not form moiré patterns.
CHECKER_PICTURE = RenderOptions(
    width=640, height=640, supersampling=3, view=(25.0, 20.0), exposure="auto"
)
_SIDES = ((0.0, "front"), (90.0, "right"), (180.0, "back"), (270.0, "left"))


def render_checker(
    mesh: MeshLike,
    options: RenderOptions | None = None,
    *,
    n_cells: int = N_CELLS,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> npt.NDArray[np.float32]:
    """Render a mesh with a numbered checker for its texture, from four sides in a row.

    Returns (H, W, 3) float32, linear light, cropped to what is seen from any side.
    """
    mesh = as_mesh(mesh)
    options = options or CHECKER_PICTURE
    with Stages(progress).stage("prepare"):
        checker = checker_image(_texels_for(mesh, n_cells), n_cells)
        scene = studio_scene(mesh, albedo=checker, options=options)
        prepared = prepare(scene, options, threads=threads)
    panels = []
    seen = np.zeros((options.height, options.width), dtype=bool)
    azimuth, *others = options.view
    for turn, side in _SIDES:
        view = replace(options, view=(azimuth + turn, *others))
        frame = draw(prepared, Camera.framing(mesh, options=view), progress=progress)
        seen |= frame.coverage > 0.0
        panels.append(Panel(frame.color, side, f"azimuth {(azimuth + turn) % 360.0:g}°"))
    return side_by_side(panels, seen)


def _texels_for(mesh: Mesh, n_cells: int) -> int:
    """Side of the checker in texels: smaller if it repeats, so that no texel is skipped.

    The more often the texture repeats over the surface, the smaller it is in the picture.
    """
    repeats = math.sqrt(max(float(np.abs(signed_areas(measurable_uvs(mesh))).sum()), 1.0))
    halvings = math.ceil(pm.log2(repeats)) if repeats < _TEXELS else _TEXELS
    return max(_TEXELS >> min(halvings, 30), _LEAST_CELL * n_cells)


def check_layout(path: PathLike) -> None:
    """Raise now if `write_layout` could not write there."""
    suffix = Path(path).suffix.lower()
    if suffix not in LAYOUT_SUFFIXES:
        raise FileFormatError(
            f"{path}: layouts cannot be written as {quoted(suffix)}; "
            f"use {' or '.join(LAYOUT_SUFFIXES)}"
        )
    check_writable(path)


def write_layout(
    mesh: MeshLike,
    path: PathLike,
    size: int | tuple[int, int] = 1024,
    *,
    heat: bool = False,
    threads: int | None = None,
) -> None:
    """Draw the texture coordinates of a mesh into a PNG or SVG file, by its suffix.

    `size`: pixels per side, or (width, height), of one tile.
    """
    mesh = as_mesh(mesh)
    check_layout(path)
    if Path(path).suffix.lower() == ".png":
        picture = draw_layout(mesh, size, heat=heat, threads=threads)
        write_image(picture, path, color=True, threads=threads)
        return
    document = layout_svg(mesh, size, heat=heat)
    with replacing(path) as temporary:
        temporary.write_text(document, encoding="utf-8")
