"""A mesh under a numbered checker, seen from four sides: where coordinates stretch, cut and mirror.

What numbers say of stretch, a person sees here at once: cells of equal size and shape are what the
texture is meant to look like, and names that read backwards are mirrored.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from texbake.mapping.areas import measurable_uvs, signed_areas
from texbake.mesh.mesh import Mesh
from texbake.progress import ProgressSink, Stages
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.panels import Panel, side_by_side
from texbake.rendering.studio import studio_scene
from texbake.texture.checker import checker_image

N_CELLS = 16
_TEXELS = 1024
_LEAST_CELL = 4  # texels: smaller ones could not be told apart
# Panels of four sides, with samples enough that cells far away do not flicker into patterns.
PANELS = RenderOptions(width=640, height=640, supersampling=3, view=(25.0, 20.0))
_SIDES = ((0.0, "front"), (90.0, "right"), (180.0, "back"), (270.0, "left"))


def render_checker(
    mesh: Mesh,
    options: RenderOptions | None = None,
    *,
    n_cells: int = N_CELLS,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> npt.NDArray[np.float32]:
    """Render a mesh with a numbered checker for its texture, from four sides in a row.

    Parameters
    ----------
    mesh : Mesh
        With texture coordinates. Where they leave the unit square the checker is repeated.
    options : RenderOptions, optional
        Of each picture; `view` is the first, and the others are 90 degrees apart. None for
        `PANELS`.
    n_cells : int
        Cells of the checker along each side of the texture, up to 26.
    threads
        None for every processor.
    progress
        Told of the stages.

    Returns
    -------
    (H, W, 3) float32
        Linear light, cropped to what is seen from any side.

    Raises
    ------
    UvError
        The mesh has no texture coordinates.
    OptionError
        There are no cells or too many.
    """
    options = options or PANELS
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
    """Texels of the checker: fewer where it is repeated, so that each is seen and none skipped.

    The more often the texture covers the surface, the smaller is one of it in the picture.
    """
    repeats = math.sqrt(max(float(np.abs(signed_areas(measurable_uvs(mesh))).sum()), 1.0))
    halvings = math.ceil(math.log2(repeats)) if repeats < _TEXELS else _TEXELS
    return max(_TEXELS >> min(halvings, 30), _LEAST_CELL * n_cells)
