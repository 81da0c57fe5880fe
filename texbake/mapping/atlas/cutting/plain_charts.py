"""Charts cut by the normals of faces alone: what is left where better ways fail.

A chart grows over neighbors whose normals lie in a cone about those of the chart, and is laid flat
by projecting it along the axis of that cone. So no face is mirrored and none is squashed to less
than half its area; where a chart winds over itself, it may lie on itself.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mapping.adjacency import opposite_half_edges
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.weld import weld_rows

_CONE = math.cos(math.radians(60.0))
_TINY = np.finfo(np.float64).tiny


def plain_charts(
    points: FloatArray, faces: IntArray
) -> tuple[IntArray, FloatArray, npt.NDArray[np.int64]]:
    """Cut a mesh into charts by its normals.

    Parameters
    ----------
    points : (V, 3) float64
    faces : (F, 3) int32
        A face without area is a chart of its own, of no area either.

    Returns
    -------
    faces : (F, 3) int32
        Indices into `uvs`.
    uvs : (T, 2) float64
        In the unit of the points.
    chart_ids : (T,) int64
        Chart of each coordinate, numbered from 0 without gaps in the order of the first faces.
    """
    corners = weld_rows(points)[faces]
    solid = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    opposite = opposite_half_edges(corners, solid=solid)
    neighbors = np.where(opposite >= 0, opposite // 3, -1).astype(np.int32).reshape(-1, 3)
    places = points[faces]
    normals = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    charts = np.full(len(faces), -1, dtype=np.int32)
    axes = np.zeros((len(faces), 3))
    n_charts = _grow_kernel(neighbors, normals, charts, axes)

    coordinates = np.stack([corners, np.repeat(charts[:, None], 3, axis=1)], axis=2)
    used, indices = np.unique(coordinates.reshape(-1, 2), axis=0, return_inverse=True)
    across, up = _tangents(axes[:n_charts])
    where, chart_ids = points[used[:, 0]], used[:, 1].astype(np.int64)
    uvs = [np.einsum("ij,ij->i", where, side[chart_ids]) for side in (across, up)]
    return indices.reshape(-1, 3).astype(np.int32), np.stack(uvs, axis=1), chart_ids


def _tangents(axes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors across each axis, right-handed with it."""
    least = np.eye(3)[np.abs(axes).argmin(axis=1)]
    across = np.cross(least, axes)
    lengths = np.linalg.norm(across, axis=1, keepdims=True)
    across /= np.maximum(lengths, _TINY)
    return across, np.cross(axes, across)


@kernel
def _grow_kernel(neighbors, normals, charts, axes):  # type: ignore[no-untyped-def]
    """Grow a chart from each face that is in none yet; return their number.

    It grows twice: about the normal of its first face, which finds the mean normal of what is
    around, then about that mean, in whose cone the first face lies because it is in its own.
    """
    n_charts = 0
    stack = np.empty(len(charts), dtype=np.int32)
    seen = np.full(len(charts), -1, dtype=np.int64)
    for first in range(len(charts)):
        if charts[first] >= 0:
            continue
        axis = normals[first].copy()
        for growth in range(2):
            axis /= max(math.sqrt((axis * axis).sum()), _TINY)
            mean = np.zeros(3)
            stack[0], height = first, 1
            seen[first] = 2 * n_charts + growth
            while height > 0:
                height -= 1
                face = stack[height]
                if growth == 0:
                    mean += normals[face]
                else:
                    charts[face] = n_charts
                for side in range(3):
                    other = neighbors[face, side]
                    if other < 0 or charts[other] >= 0 or seen[other] == 2 * n_charts + growth:
                        continue
                    normal = normals[other]
                    length = math.sqrt((normal * normal).sum())
                    if length > 0.0 and (normal * axis).sum() >= _CONE * length:
                        seen[other] = 2 * n_charts + growth
                        stack[height] = other
                        height += 1
            if growth == 0:
                axis = mean
        axes[n_charts] = axis
        n_charts += 1
    return n_charts
