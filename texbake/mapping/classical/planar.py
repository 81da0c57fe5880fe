"""Mappings by a linear formula: planar from positions, parametric from the mesh's own (u, v).

Planar mapping drops the coordinate along the normal of a plane. A surface made from (u, v) stores
them as its texture coordinates; parametric mapping makes s = au u + bu v + cu and
t = av u + bv v + cv of them, which repeats, rotates or moves the texture.

Based on: K. Pearson, "On lines and planes of closest fit to systems of points in space",
Philosophical Magazine 2(11), 1901 (principal directions). It departs in integrating over the
surface, in closed form for each triangle, instead of summing over vertices, so that the directions
do not depend on how the surface is triangulated.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.mapping.classical.frames import LocalPoints, center_of, points_about, upright_frame
from texbake.mapping.corner_uvs import Projected, surface_areas
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.options.projection import AXES
from texbake.mesh.mesh import BoolArray, FloatArray, Mesh
from texbake.mesh.normals import AREA_ROUNDING

# Relative to the sum of variances. A smaller difference between two of them is rounding, also of
# float32 positions, and the directions between them are arbitrary.
_VARIANCE_ROUNDING = 1e-6

# Decimals to which the direction of least variance is kept.
_NORMAL_DIGITS = 12


def planar(mesh: Mesh, options: UnwrapOptions) -> Projected:
    """Map a mesh onto a plane, as seen from far away along the normal."""
    center = center_of(mesh, None)
    direction = options.normal or options.axis
    if direction is None and options.fit == "pca":
        direction = _flattest_normal(points_about(mesh, center, np.eye(3)).points, mesh)
    normal = "z" if direction is None else direction
    frame = upright_frame(AXES[normal] if isinstance(normal, str) else normal)
    if options.fit == "pca":
        frame = _turned_to_spread(frame, points_about(mesh, center, frame).points, mesh)
    local = points_about(mesh, center, frame)
    away, edge_on = _facing(local, mesh)
    counts = {"faces seen from behind": int(away.sum()), "faces seen edge-on": int(edge_on.sum())}
    return Projected(corners=_placed(local, mesh, away if options.sides else None), tallies=counts)


def _placed(local: LocalPoints, mesh: Mesh, aside: BoolArray | None) -> FloatArray:
    """(F, 3, 2): points in the plane, scaled to the unit square, or to halves with `aside`."""
    used = local.points[:, :2][mesh.faces]
    low = np.array([used[:, :, i].min() for i in (0, 1)])
    right, top = (float(used[:, :, i].max()) for i in (0, 1))
    width, height = right - low[0], top - low[1]
    # Divided, since multiplying by 1 / extent may round the far side beyond 1.
    extent = max(width if aside is None else 2.0 * width, height)
    if extent <= 2.0 * local.rounding:
        return np.zeros_like(used)
    corners = np.asarray((used - low) / extent)
    if aside is not None:
        corners[aside, :, 0] = 0.5 + (right - used[aside, :, 0]) / extent
    return corners


def _facing(local: LocalPoints, mesh: Mesh) -> tuple[BoolArray, BoolArray]:
    """(F,) bool each: faces that look away from the viewer, and faces seen edge-on."""
    x, y = local.points[:, 0][mesh.faces], local.points[:, 1][mesh.faces]
    ux, uy = x[:, 1] - x[:, 0], y[:, 1] - y[:, 0]
    vx, vy = x[:, 2] - x[:, 0], y[:, 2] - y[:, 0]
    across = ux * vy - uy * vx
    longest = np.sqrt(np.maximum(ux * ux + uy * uy, vx * vx + vy * vy))
    edge_on = np.abs(across) <= longest * (AREA_ROUNDING * longest + local.rounding)
    away = (across < 0.0) & ~edge_on
    if mesh.polygon_of is None:
        return away, edge_on
    # Triangles seen edge-on go with the others of their polygon.
    n_away, n_toward = (np.bincount(mesh.polygon_of, faces) for faces in (away, ~away & ~edge_on))
    return away | (edge_on & ((n_away > 0) & (n_toward == 0))[mesh.polygon_of]), edge_on


def _variances(points: FloatArray, mesh: Mesh) -> FloatArray:
    """(3, 3) float64: covariance of the surface; without area, all corners weigh the same."""
    corners = points[mesh.faces]
    areas = surface_areas(corners)
    if not areas.sum() > 0.0:
        areas = np.ones(len(corners))
    areas /= areas.sum()
    corners = corners - pm.vecmat(areas, corners.mean(axis=1))
    weights = np.repeat(areas, 4).reshape(-1, 4)
    x, y, z = (
        np.concatenate([column, column.sum(axis=1, keepdims=True)], axis=1)
        for column in (corners[:, :, 0], corners[:, :, 1], corners[:, :, 2])
    )
    # Not a matrix product, which sums in a different order with a different number of threads.
    return np.array([[float((weights * a * b).sum()) for b in (x, y, z)] for a in (x, y, z)])


def _flattest_normal(points: FloatArray, mesh: Mesh) -> tuple[float, float, float]:
    """Direction of least variance nearest to +z, +y, +x; reversed if 3/4 of the area faces away."""
    values, vectors = pm.eigh(_variances(points, mesh))
    free = vectors[:, values <= values[0] + _VARIANCE_ROUNDING * values.sum()]
    for axis in (2, 1, 0):
        normal = pm.matmul(free, free[axis])  # the axis projected onto the free directions
        if math.sqrt(pm.matmul(normal, normal)) > 0.5:  # true for one of the axes: 3^-1/2 > 0.5
            break
    # Libraries of linear algebra differ in the last digits, which mean nothing here.
    normal = np.round(normal, _NORMAL_DIGITS) + 0.0
    a, b, c = (points[mesh.faces[:, corner]] for corner in range(3))
    seen = pm.matvec(np.cross(b - a, c - a), normal)
    if seen.sum() < -0.5 * np.abs(seen).sum():
        normal = -normal
    return tuple(normal.tolist())


def _turned_to_spread(frame: FloatArray, points: FloatArray, mesh: Mesh) -> FloatArray:
    """Rotate a frame about its normal, by at most a quarter turn, so that s has the most spread."""
    variances = _variances(points, mesh)
    across = 2.0 * variances[0, 1]
    along = variances[0, 0] - variances[1, 1]
    if abs(across) <= _VARIANCE_ROUNDING * np.trace(variances):
        across = 0.0  # else rounding would choose between two opposite directions
    if pm.hypot(across, along) <= _VARIANCE_ROUNDING * np.trace(variances):
        return frame
    angle = pm.arctan2(across, along) / 2.0
    right, up, normal = frame
    cos, sin = pm.cos(angle), pm.sin(angle)
    return np.array([cos * right + sin * up, cos * up - sin * right, normal])


def parametric(mesh: Mesh, options: UnwrapOptions) -> Projected:
    """Map the mesh's own (u, v) to (s, t) by `linear`: (au, bu, cu, av, bv, cv)."""
    mesh.corner_uvs()  # raises where there are none
    assert mesh.uvs is not None and mesh.uv_faces is not None
    au, bu, cu, av, bv, cv = options.linear
    u, v = mesh.uvs[:, 0], mesh.uvs[:, 1]
    with np.errstate(over="ignore", invalid="ignore"):
        mapped = np.stack([au * u + bu * v + cu, av * u + bv * v + cv], axis=-1)
    corners = mapped[mesh.uv_faces]
    if not np.isfinite(corners).all():
        raise OptionError(f"linear: {options.linear} makes coordinates that are not finite")
    return Projected(corners=corners)
