"""Normals of FBX geometry that has none, from its smoothing: by edge, or by groups of polygons.

An edge is hard where its value is 0, or where the smoothing groups of its two polygons, a bit each,
have none in common. So 0 makes a polygon flat, which is also what programs mean that write 0 and 1
alone. Edges of more than two polygons are hard. Around each vertex, corners between hard edges
share a normal, weighted by angle.

Kernel: `core/union_find.c`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import FloatArray
from texbake.mesh.normals import weighted_normals

Indices = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Polygons:
    """Polygons by their corners.

    Attributes
    ----------
    vertices : (C,) int64
        Vertex of each corner.
    sizes : (P,) int64
        Corners of each polygon, in the order of `vertices`.
    """

    vertices: Indices
    sizes: Indices

    def next_corners(self) -> Indices:
        """(C,) corner that follows in the same polygon."""
        following = np.arange(1, len(self.vertices) + 1)
        ends = np.cumsum(self.sizes)
        following[ends - 1] = ends - self.sizes
        return following

    def edge_keys(self, following: Indices) -> Indices:
        """(C,) number of the edge that starts at each corner, the same in all its polygons."""
        heads = self.vertices[following]
        return np.minimum(self.vertices, heads) * (1 << 31) + np.maximum(self.vertices, heads)


def edge_mapping(edges: Indices, values: Indices, n_corners: int) -> tuple[Indices, Indices]:
    """Corners that edges start at, and the values of these edges, those that the file has both of.

    Parameters
    ----------
    edges : (n,) int64
        Corner by its number.
    values : (m,) int64
    n_corners
    """
    n = min(len(edges), len(values))
    edges, values = edges[:n], values[:n]
    is_there = (edges >= 0) & (edges < n_corners)
    return edges[is_there], values[is_there]


def smoothed_normals(
    positions: FloatArray,
    polygons: Polygons,
    slots: Indices,
    values: Indices,
    edges: Indices | None,
) -> dict[str, Any]:
    """Return normals as fields of a mesh: none where no edge is hard.

    Parameters
    ----------
    positions : (V, 3) float64
    polygons
    slots : (F, 3) int64
        Corners of the triangles.
    values
        Of the edges that start at the corners `edges`; 0 where they are hard. Where that is None,
        (C,) groups of the polygon of each corner, as bits.
    edges : (E,) int64, optional
    """
    n = len(polygons.vertices)
    following = polygons.next_corners()
    keys = polygons.edge_keys(following)
    one, other, n_more = _pairs(polygons.vertices, following, keys, slots)
    if edges is None:
        is_smooth = (values[one] & values[other]) != 0
    else:
        is_smooth = ~np.isin(keys[one], keys[edges[values == 0]])
    if is_smooth.all() and n_more == 0:
        return {}
    one, other = one[is_smooth], other[is_smooth]
    # Polygons that run along an edge in opposite ways have its ends at opposite corners.
    is_opposite = polygons.vertices[one] != polygons.vertices[other]
    here = np.where(is_opposite, following[other], other)
    there = np.where(is_opposite, other, following[other])
    labels = np.arange(n, dtype=np.int32)
    firsts = np.concatenate([one, following[one]]).astype(np.int32)
    core.merge_labels(labels, firsts, np.concatenate([here, there]).astype(np.int32))
    used, inverse = np.unique(labels[slots], return_inverse=True)
    rows = np.asarray(inverse.reshape(slots.shape), np.int32)
    faces = polygons.vertices[slots].astype(np.int32)
    return {"normals": weighted_normals(positions, faces, rows, len(used)), "normal_faces": rows}


def _pairs(
    vertices: Indices, following: Indices, keys: Indices, slots: Indices
) -> tuple[Indices, Indices, int]:
    """Corners at which the two polygons of an edge start it, and how many edges have more."""
    in_triangle = np.zeros(len(vertices), np.bool_)
    in_triangle[slots] = True  # left out are holes, and corners that are no vertices
    corners = np.flatnonzero(in_triangle & (vertices != vertices[following]))
    order = corners[np.argsort(keys[corners], kind="stable")]
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    counts = np.diff(np.append(starts, len(order)))
    pairs = starts[counts == 2]
    return order[pairs], order[pairs + 1], int(np.count_nonzero(counts > 2))
