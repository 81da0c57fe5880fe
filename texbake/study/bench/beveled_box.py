"""A box whose edges are beveled and hard, and the cube that is its low-poly mesh.

Its mesh has normals, one for each of the six sides, twelve bevels and eight corners. Without them
no program could know that the edges are hard.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.parametric.grid import grid_quads, split_quads
from texbake.mesh.shapes import cube

_BOX, _BEVEL = 0.5, 0.08  # half its side, how far from an edge its bevel begins
_INNER = _BOX - _BEVEL


def box_value(points: FloatArray) -> FloatArray:
    """(n,) heights of points (n, 3) over the plane of the box that is farthest out."""
    x, y, z = np.abs(points).T
    sides = np.maximum(np.maximum(x, y), z) - _BOX
    edges = np.maximum(np.maximum(x + y, y + z), z + x) - (_BOX + _INNER)
    corners = x + y + z - (_BOX + 2.0 * _INNER)
    return np.asarray(
        np.maximum(np.maximum(sides, edges / math.sqrt(2.0)), corners / math.sqrt(3.0))
    )


def beveled_box(n_triangles: int) -> Mesh:
    """Six sides, twelve bevels and eight corners: a grid with one normal for each."""
    n = max(round(math.sqrt(n_triangles / 15.5)), 1)
    across = max(round(n * math.sqrt(0.5) * _BEVEL / _INNER), 1)
    points: list[FloatArray] = []
    faces: list[IntArray] = []
    counts: list[int] = []
    outs = [np.array(out) for out in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(out)]
    for out in outs:
        sides = {1: (n, n), 2: (across, n), 3: (across, across)}[int(np.abs(out).sum())]
        grid, triangles = _grid_between(_facet(out), *sides)
        a, b, c = np.moveaxis(grid[triangles], 1, 0)
        across_out = pm.vecdot(np.cross(b - a, c - a), out)
        triangles = triangles[np.abs(across_out) > 1e-15]
        faces.append(triangles[:, :: int(np.sign(across_out.sum()))] + sum(map(len, points)))
        points.append(grid)
        counts.append(len(triangles))
    ids = np.repeat(np.arange(len(outs)), counts)
    used, corners = np.unique(np.concatenate(faces), return_inverse=True)
    return Mesh(
        positions=np.concatenate(points)[used],
        faces=corners.reshape(-1, 3).astype(np.int32),
        normals=np.array(outs),
        normal_faces=np.stack([ids] * 3, axis=1).astype(np.int32),
        name="beveled box",
    )


def _facet(out: FloatArray) -> FloatArray:
    """(4, 3) corners in turn around the facet that faces a direction; of three, the last twice."""
    ring = ((-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0))
    axes, free = np.flatnonzero(out), np.flatnonzero(out == 0.0)
    chosen = [int(axes[i]) for i in ((0, 0, 0, 0), (0, 0, 1, 1), (0, 1, 2, 2))[len(axes) - 1]]
    corners = np.repeat(_INNER * out[None], 4, axis=0)
    for corner, axis, signs in zip(corners, chosen, ring, strict=True):
        corner[axis] = _BOX * out[axis]
        corner[free] = _INNER * np.array(signs)[2 - len(free) :]
    return corners


def _grid_between(corners: FloatArray, n_u: int, n_v: int) -> tuple[FloatArray, IntArray]:
    """Points and triangles of a grid between four corners."""
    u = np.linspace(0.0, 1.0, n_u + 1)[:, None, None]
    v = np.linspace(0.0, 1.0, n_v + 1)[None, :, None]
    a, b, c, d = corners
    grid = (1.0 - u) * ((1.0 - v) * a + v * b) + u * ((1.0 - v) * d + v * c)
    return grid.reshape(-1, 3), split_quads(grid_quads(n_u, n_v))


def cube_with_uvs() -> Mesh:
    """A cube of 8 vertices, its sides beside one another in three columns and two rows."""
    mesh = cube()
    corners = np.empty((12, 3, 2))
    for i, face in enumerate(mesh.faces):
        points = mesh.positions[face]
        normal = np.cross(points[1] - points[0], points[2] - points[0])
        axis, sign = int(np.abs(normal).argmax()), np.sign(normal[np.abs(normal).argmax()])
        side = axis + 3 * (sign < 0)
        first, second = points[:, (axis + 1) % 3], points[:, (axis + 2) % 3]
        square = np.stack([0.5 + sign * first, 0.5 + second], axis=1)
        corners[i] = (0.05 + 0.9 * square + [side % 3, side // 3]) / 3.0
    uvs, places = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    return mesh.replace(uvs=uvs, uv_faces=places.reshape(-1, 3).astype(np.int32))
