"""Meshes whose normals are those of their facets, and say nothing of where an edge is hard.

Scans, marching cubes and many exporters write one normal for each face. Read as hard edges, every
edge of a curved surface would be one.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.objects import weld_vertices
from texbake.mesh.topology import edge_neighbors
from texbake.mesh.weld import weld_rows

# Components of float32 unit vectors that are rounded differently differ by less.
_ROUNDING = 1e-6
# A surface is curved where half its facets turn by less than this from one to the next. Edges of
# what is built of flat sides, such as a crate, turn by more.
_CURVED = pm.cos(np.radians(30.0))


def is_flat_shaded(mesh: Mesh, *, threads: int | None = None) -> bool:
    """Whether a curved surface has a single normal on each of its facets.

    A facet is a triangle or a polygon that was cut into triangles. False for a mesh without normals
    and for one whose facets mostly meet at sharp edges.
    """
    if mesh.normals is None or mesh.normal_faces is None:
        return False
    corners = weld_rows(mesh.normals, threads=threads)[mesh.normal_faces]
    firsts = np.repeat(corners[:, :1], 3, axis=1)
    if _differ(mesh.normals, corners.ravel(), firsts.ravel()).any():
        return False
    neighbors = edge_neighbors(weld_vertices(mesh, threads=threads)[mesh.faces])
    a, b = corners[neighbors.first, 0], corners[neighbors.second, 0]
    hard = _differ(mesh.normals, a, b)
    return turn_gently(mesh.normals[a], mesh.normals[b], hard, _CURVED)


def turn_gently(
    one: FloatArray, other: FloatArray, turns: npt.NDArray[np.bool_], cosine: float
) -> bool:
    """Whether at least half of the pairs of normals turn, by less than an angle in the median."""
    if 2 * np.count_nonzero(turns) < len(turns) or not len(turns):
        return False
    return bool(np.median(pm.vecdot(one[turns], other[turns])) > cosine)


def _differ(normals: FloatArray, one: IntArray, other: IntArray) -> npt.NDArray[np.bool_]:
    """(n,) bool: pairs of normals, by their rows, that differ by more than rounding."""
    found: npt.NDArray[np.bool_] = one != other
    apart = np.abs(normals[one[found]] - normals[other[found]]).max(axis=1, initial=0.0)
    found[found] = apart > _ROUNDING
    return found
