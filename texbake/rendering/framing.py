"""Framing: a camera that fills the picture with surfaces, seen from a given direction.

`Camera.framing` fits a sphere into the picture, which suits pictures from all around but leaves a
long mesh small. Here the four sides of the picture touch the surfaces themselves. For a direction,
each vertex and side give one inequality for the position of the eye; the tightest for each side is
the extreme of a linear function of the vertices.

A few triangles far from everything else, and triangles without area, are strays and ignored, so
that the rest of the mesh fills the picture.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import MeshError
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.parallel import run_bands
from texbake.rendering.camera import NEAR, Camera, used_positions, view_axes
from texbake.rendering.options import RenderOptions

# Share of the picture's width or height that the surfaces fill.
_FILL = 0.9
# Least distance of the eye from the middle, in radii, so that perspective does not exaggerate.
_AWAY = 2.2
# Triangles are strays if they have at most _STRAY_AREA of the area and lie far from most of it: a
# box that leaves out at most _LEFT_OVER of the area on each side is _STRAY_SIZE times smaller than
# the box of the whole mesh.
_STRAY_AREA = 1e-3
_LEFT_OVER = 1e-2
_STRAY_SIZE = 8.0
# How many triangles are sampled to find the box around most of the area.
_SAMPLES = 1 << 13
# Points per band.
_BAND = 1 << 14


@dataclass(frozen=True, eq=False)
class Framed:
    """A camera, and how many triangles it leaves out because they lie far away."""

    camera: Camera
    n_strays: int


def fill_picture(meshes: Sequence[Mesh], options: RenderOptions) -> Framed:
    """Return a camera that fills the picture with meshes."""
    kept = _without_strays(meshes)
    n_strays = sum(mesh.n_faces for mesh in meshes) - sum(mesh.n_faces for mesh in kept)
    camera = _fit_camera([used_positions(mesh) for mesh in kept], options)
    if camera is None:
        raise MeshError(f"{meshes[0].name}: it is too large to render; scale it down")
    return Framed(camera, n_strays)


def _fit_camera(clouds: Sequence[FloatArray], options: RenderOptions) -> Camera | None:
    """Return the camera whose picture the points fill; None if they are too large for float64."""
    axes = view_axes(*(math.radians(angle) for angle in options.view[:2]), up=options.up)
    right, up, back = axes
    tall = _FILL * pm.tan(math.radians(options.fov) / 2)
    wide = tall * options.width / options.height
    # A point (x, y, z) along the axes is in the picture of an eye at (X, Y, Z) if
    # x + wide z <= X + wide Z and -x + wide z <= -X + wide Z, and likewise for y.
    sides = [right + wide * back, -right + wide * back, up + tall * back, -up + tall * back]
    reach = _extremes(clouds, np.stack([*sides, *axes, *-axes]))
    low, high = -reach[7:], reach[4:7]
    radius = 0.5 * _diagonal(np.stack([low, high])) or 1.0
    if not math.isfinite(radius) or not np.isfinite(reach).all():
        return None
    to_right, to_left, to_top, to_bottom = reach[:4]
    away = max(
        (to_right + to_left) / (2.0 * wide),
        (to_top + to_bottom) / (2.0 * tall),
        0.5 * (low[2] + high[2]) + _AWAY * radius,
    )
    across, above = 0.5 * (to_right - to_left), 0.5 * (to_top - to_bottom)
    return Camera(
        eye=across * right + above * up + away * back,
        axes=axes,
        fov=math.radians(options.fov),
        near=NEAR * radius,
    )


def _extremes(clouds: Sequence[FloatArray], directions: FloatArray) -> FloatArray:
    """(D,) float64: the greatest dot product of any point with each direction."""
    found = []
    for points in clouds:
        extremes = np.empty((-(-len(points) // _BAND), len(directions)))

        def work(
            start: int, stop: int, points: FloatArray = points, extremes: FloatArray = extremes
        ) -> None:
            heights = pm.matmul(points[start:stop], directions.T)
            extremes[start // _BAND] = heights.max(axis=0)

        run_bands(work, len(points), band=_BAND)
        found.append(extremes.max(axis=0))
    return np.asarray(np.max(found, axis=0))


def _without_strays(meshes: Sequence[Mesh]) -> list[Mesh]:
    """Return the meshes without the few triangles that lie far from all others."""
    step = -(-sum(mesh.n_faces for mesh in meshes) // _SAMPLES)
    corners = np.concatenate([mesh.positions[mesh.faces[::step]] for mesh in meshes])
    areas = _areas(corners)
    if step > 1:  # a stray among the samples may be the only one of its size
        areas = np.minimum(areas, 0.5 * _LEFT_OVER * areas.sum())
    box = _box_of_most(corners, areas)
    bounds = np.array([mesh.bounds for mesh in meshes])
    whole = np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])
    if box is None or not _diagonal(whole) > _STRAY_SIZE * _diagonal(box):
        return list(meshes)
    room = _diagonal(box)
    kept, area, stray_area = [], 0.0, 0.0
    for mesh in meshes:
        corners = mesh.positions[mesh.faces]
        inside = ((corners >= box[0] - room) & (corners <= box[1] + room)).all(axis=(1, 2))
        areas = _areas(corners)
        area, stray_area = area + float(areas.sum()), stray_area + float(areas[~inside].sum())
        if inside.any():
            kept.append(Mesh(positions=mesh.positions, faces=mesh.faces[inside], name=mesh.name))
    return kept if stray_area <= _STRAY_AREA * area else list(meshes)


def _box_of_most(corners: FloatArray, areas: FloatArray) -> FloatArray | None:
    """(2, 3) box around the triangles with most of the area; None if all areas are 0."""
    middles = corners.mean(axis=1)
    inside = areas > 0.0
    for k in range(3):
        order = np.argsort(middles[:, k], kind="stable")
        below = np.cumsum(areas[order])
        total = below[-1]
        if not 0.0 < total < math.inf:
            return None
        is_low = below <= _LEFT_OVER * total
        is_high = below - areas[order] >= (1.0 - _LEFT_OVER) * total
        inside[order[is_low | is_high]] = False
    if not inside.any():
        return None
    points = corners[inside].reshape(-1, 3)
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _areas(corners: FloatArray) -> FloatArray:
    """(F,) float64: twice the area of each triangle."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    with np.errstate(over="ignore", invalid="ignore"):
        crossed = np.cross(a, b)
        return np.asarray(np.sqrt((crossed * crossed).sum(axis=1)))


def _diagonal(box: FloatArray) -> float:
    with np.errstate(over="ignore"):
        return float(np.sqrt(((box[1] - box[0]) ** 2).sum()))
