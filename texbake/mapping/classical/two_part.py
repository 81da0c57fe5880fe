"""Two-part mapping: the texture goes onto a simple surface, and from there onto the object.

docs/explanation/mappings.md says which point of which surface belongs to a point x of the object.
With `reflection` it is where the ray x + k (2 (n . v) n - v) leaves it, v from x to the eye. The
surface encloses the mesh, about `center` and `axis`: a plane on the side that the axis points to, a
cylinder or a sphere through the points farthest from the axis or the center, or a box centered on
the center. A sphere by its own normals and a sphere by the centroid are the same.

Based on: Bier, Sloan, "Two-part texture mappings", IEEE Computer Graphics and Applications 6(9),
1986. It departs in that rays start at the object and only go outward.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.classical.cylindrical import center_about_axis
from texbake.mapping.classical.frames import (
    LocalPoints,
    center_of,
    frame_about,
    in_frame,
    points_about,
    upright_frame,
)
from texbake.mapping.classical.intermediate import Box, mapped_by_rays, surface_around
from texbake.mapping.corner_uvs import Projected
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.options.projection import AXES
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.normals import smooth_normals


def two_part(mesh: Mesh, options: UnwrapOptions) -> Projected:
    """Map a mesh through an intermediate surface."""
    frame = _frame(options)
    if options.surface == "cylinder":
        center = center_about_axis(mesh, options.center, frame)
    else:
        center = center_of(mesh, options.center)
    local = points_about(mesh, center, frame)
    used = mesh.used_vertices
    # Unused vertices may lie anywhere, but their rays are computed with the rest.
    local = replace(local, points=np.where(used[:, None], local.points, 0.0))
    by_normal = options.via == "surface-normal"
    if options.surface == "box":
        # The object's normals choose among the normals of the box.
        directions, tallies = _directions(mesh, local, center, frame, options)
        box = Box.around(local, mesh.faces, options)
        onto_box = box.mapped_by_normals if by_normal else box.mapped_by_rays
        mapped = onto_box(local.points, directions, mesh.faces)
    else:
        surface = surface_around(local, mesh.faces, options)
        # A ray from the center hits a sphere along its normal.
        if by_normal or (options.surface, options.via) == ("sphere", "centroid"):
            return surface.coordinates(local.points, mesh.faces, mesh.polygon_of)
        directions, tallies = _directions(mesh, local, center, frame, options)
        mapped = mapped_by_rays(surface, local.points, directions, mesh.faces, mesh.polygon_of)
    return replace(mapped, tallies=tallies | mapped.tallies)


def _frame(options: UnwrapOptions) -> FloatArray:
    """Rows of the surface's frame; the last is the axis."""
    if options.surface != "plane":
        return frame_about("y" if options.axis is None else options.axis)
    axis = "z" if options.axis is None else options.axis
    return upright_frame(AXES[axis] if isinstance(axis, str) else axis)


def _directions(
    mesh: Mesh, local: LocalPoints, center: FloatArray, frame: FloatArray, options: UnwrapOptions
) -> tuple[FloatArray, dict[str, int]]:
    """(V, 3) unit directions of rays, 0 for a vertex at the center; and tallies."""
    outward = _unit(local.points, local.rounding)
    if options.via == "centroid":
        return outward, {}
    directions = in_frame(smooth_normals(mesh), frame)
    if options.via == "reflection":
        assert options.eye is not None
        to_eye = np.array(options.eye) - center
        views = in_frame(to_eye[None] * local.scale, frame) - local.points
        directions = _mirrored(_unit(views, local.rounding), directions)
    rayless = (directions == 0.0).all(axis=1)
    directions[rayless] = outward[rayless]
    n_rayless = int(rayless[mesh.faces].sum())
    return directions, {"corners without a ray, sent from the center": n_rayless}


def _mirrored(views: FloatArray, normals: FloatArray) -> FloatArray:
    """Compute 2 (n . v) n - v for unit vectors; 0 where either is 0."""
    along = pm.vecdot(normals, views)[:, None]
    mirrored = _unit(2.0 * along * normals - views, 0.0)
    mirrored[(normals == 0.0).all(axis=1)] = 0.0
    return mirrored


def _unit(vectors: FloatArray, rounding: float) -> FloatArray:
    """(N, 3): vectors normalized; 0 for those no longer than `rounding`."""
    largest = np.abs(vectors).max(axis=1, keepdims=True)
    none = largest[:, 0] <= rounding
    scaled = vectors / np.where(none[:, None], 1.0, largest)  # so that no square overflows
    scaled[none] = 0.0
    lengths = np.sqrt(pm.vecdot(scaled, scaled))[:, None]
    return np.asarray(scaled / np.where(none[:, None], 1.0, lengths))
