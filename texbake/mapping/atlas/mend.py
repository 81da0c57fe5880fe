"""What xatlas leaves undone in its charts, made good.

It rounds the width and height of every chart up to whole texels, which stretches small charts, and
leaves some charts mirrored: each chart gets the linear map that makes its stretch even over all
directions, and the area that its faces have in space. Slivers may come out mirrored, and a chart
of a surface that meets itself may lie on itself: such faces are taken out. And faces that it
ignores get a point for coordinates.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mapping.areas import signed_areas, surface_areas
from texbake.mapping.atlas.charts import Charts
from texbake.mapping.overlap import overlap_layers
from texbake.mapping.seams import connected_faces, edge_ids
from texbake.mesh.mesh import FloatArray, IntArray

# Cells along the longest side of the bounding box of the grid that points are snapped to.
# Positions that lie 1e6 sizes away from the origin carry 2^-33 of the size; with cells this much
# wider, hardly one coordinate in a thousand changes its cell by such a move.
GRID_CELLS = 2.0**20

_NO_CHART = np.uint32(2**32 - 1)
_NONE = np.empty(0, dtype=np.intp)

# Least width of a face in the plane, as a share of its width in space: what is squashed more than
# a hundred times, or mirrored, has lost its shape.
_LEAST_WIDTH = 0.01

# Faces narrower than this in space lose their shape by the snapping to the grid, which moves each
# corner by up to half a cell in each direction.
_SLIVER_WIDTH = 4.0 / GRID_CELLS

# Overlaps no deeper than this are two borders that snapping brought together.
_OVERLAP_DEPTH = 0.5 / GRID_CELLS


def mended_charts(
    points: FloatArray,
    mesh_faces: IntArray,
    faces: npt.NDArray[np.uint32],
    uvs: npt.NDArray[np.float32],
    chart_ids: npt.NDArray[np.uint32],
) -> Charts | None:
    """Turn what xatlas gives into charts that neither overlap nor are mirrored.

    Parameters
    ----------
    points : (V, 3) float64
        On the grid, in the unit cube.
    mesh_faces : (F, 3) int32
        Indices into `points`.
    faces : (F, 3) uint32
        Indices into `uvs`.
    uvs : (T, 2) float32
        Coordinates; those of a chart are meaningful up to a linear map.
    chart_ids : (T,) uint32
        2^32 - 1 for coordinates that lie in no chart.

    Returns
    -------
    Charts or None
        None where no face has an area.
    """
    solid = np.flatnonzero((chart_ids[faces] != _NO_CHART).all(axis=1)) if len(uvs) else _NONE
    if len(solid) == 0:
        return None
    corners = points[mesh_faces[solid]]
    kept, ids, flat = _renumbered(faces[solid].astype(np.int64), chart_ids)
    upright, n_mirrored = _turned_over(uvs[kept].astype(np.float64), flat, ids)
    evened = _evened(upright, flat, ids, corners)

    widths = _widths(surface_areas(corners), corners)
    lost = _widths(signed_areas(evened[flat]), evened[flat]) < _LEAST_WIDTH * widths
    keep = ~(lost & (widths < _SLIVER_WIDTH))
    if not keep.any():
        return None
    solid, corners, flat, lost = solid[keep], corners[keep], flat[keep], lost[keep]
    n_charts = len(np.unique(ids[flat[:, 0]]))
    flat, evened, ids = _taken_apart(corners, flat, evened, ids, lost)
    kept, ids, flat = _renumbered(flat, ids)
    return Charts(
        uvs=evened[kept],
        faces=_with_points(mesh_faces, solid, flat),
        chart_ids=ids,
        n_ignored=len(mesh_faces) - len(solid),
        n_mirrored=n_mirrored,
        n_split=int(ids.max()) + 1 - n_charts,
    )


def _renumbered(
    faces: npt.NDArray[np.int64], chart_ids: npt.NDArray[np.integer[Any]]
) -> tuple[npt.NDArray[np.int64], IntArray, npt.NDArray[np.int64]]:
    """Coordinates that faces use, the charts of those numbered without gaps, and the faces."""
    kept, new_faces = np.unique(faces, return_inverse=True)
    _, ids = np.unique(chart_ids[kept], return_inverse=True)
    return kept, ids.astype(np.int32), new_faces.reshape(-1, 3)


def _widths(areas: FloatArray, corners: FloatArray) -> FloatArray:
    """(F,) float64: height over the longest edge, in 2 or 3 dimensions, signed as the area is."""
    edges = corners - np.roll(corners, 1, axis=1)
    longest = np.sqrt((edges**2).sum(axis=2).max(axis=1))
    return np.asarray(2.0 * areas / np.maximum(longest, np.finfo(np.float64).tiny))


def _taken_apart(
    corners: FloatArray,
    faces: npt.NDArray[np.int64],
    uvs: FloatArray,
    chart_ids: IntArray,
    lost: npt.NDArray[np.bool_],
) -> tuple[npt.NDArray[np.int64], FloatArray, IntArray]:
    """Make charts of their own of `lost` faces, laid out anew, and of faces that lie on others.

    Returns faces, coordinates and their chart ids; some coordinates may be in no use any more.
    """
    charts = chart_ids[faces[:, 0]]
    layers = overlap_layers(uvs[faces], charts, depth=_OVERLAP_DEPTH)
    layers[lost] = 0
    if not (layers.any() or lost.any()):
        return faces, uvs, chart_ids
    # What is left of a chart may fall apart as well, or one part would enclose another.
    torn = np.isin(charts, charts[(layers > 0) | lost])
    n_layers = int(layers.max()) + 1
    joints = np.where(torn[:, None], faces * n_layers + layers[:, None], 0)
    joints[lost] = len(uvs) * n_layers + np.arange(3 * lost.sum()).reshape(-1, 3)
    new_charts = charts.astype(np.int64)
    new_charts[torn] = charts.max() + 1 + connected_faces(edge_ids(joints[torn]))

    uvs = np.concatenate([uvs, _laid_flat(corners[lost]).reshape(-1, 2)])
    faces = faces.copy()
    faces[lost] = np.arange(len(uvs) - 3 * lost.sum(), len(uvs)).reshape(-1, 3)
    pairs = np.stack([faces, np.repeat(new_charts[:, None], 3, axis=1)], axis=2).reshape(-1, 2)
    pairs, new_faces = np.unique(pairs, axis=0, return_inverse=True)
    return new_faces.reshape(-1, 3), uvs[pairs[:, 0]], pairs[:, 1].astype(np.int32)


def _laid_flat(corners: FloatArray) -> FloatArray:
    """(F, 3, 2) float64: triangles laid into the plane with their lengths, counter-clockwise."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    lengths = np.linalg.norm(first, axis=1)
    flat = np.zeros((len(corners), 3, 2))
    flat[:, 1, 0] = lengths
    flat[:, 2, 0] = np.einsum("ij,ij->i", first, second) / lengths
    flat[:, 2, 1] = 2.0 * surface_areas(corners) / lengths
    return flat


def _with_points(
    mesh_faces: IntArray, solid: npt.NDArray[np.integer[Any]], faces: npt.NDArray[np.int64]
) -> IntArray:
    """(F, 3) int32: `faces` for the solid ones; one coordinate for the corners of each other.

    It is one that a solid face has at one of its vertices, where there is one.
    """
    none = np.iinfo(np.int32).max
    at_vertex = np.full(int(mesh_faces.max()) + 1, none, dtype=np.int64)
    np.minimum.at(at_vertex, mesh_faces[solid].ravel(), faces.ravel())
    anchors = at_vertex[mesh_faces].min(axis=1)
    all_faces = np.repeat(np.where(anchors < none, anchors, 0)[:, None], 3, axis=1)
    all_faces[solid] = faces
    return all_faces.astype(np.int32)


def _turned_over(
    uvs: FloatArray, faces: npt.NDArray[np.int64], chart_ids: IntArray
) -> tuple[FloatArray, int]:
    """Move each chart to the origin and mirror those with a negative area; and their number."""
    counts = np.bincount(chart_ids)
    means = [np.bincount(chart_ids, uvs[:, axis]) / counts for axis in (0, 1)]
    centered = uvs - np.stack(means, axis=1)[chart_ids]
    mirrored = np.bincount(chart_ids[faces[:, 0]], signed_areas(centered[faces])) < 0.0
    centered[:, 0] *= np.where(mirrored, -1.0, 1.0)[chart_ids]
    return centered, int(mirrored.sum())


def _evened(
    uvs: FloatArray, faces: npt.NDArray[np.int64], chart_ids: IntArray, corners: FloatArray
) -> FloatArray:
    """Give each chart the linear map that evens out its stretch, and its area in space.

    With J the Jacobian of a face from space to texture and A its area in space, H = Σ A J Jᵀ is a
    multiple of the identity where the chart is stretched alike in all directions, and H^(-1/2) is
    the linear map that makes it so; of all maps that keep areas it leaves the least Dirichlet
    energy.
    """
    face_charts = chart_ids[faces[:, 0]]
    edges, areas = corners[:, 1:] - corners[:, :1], surface_areas(corners)
    uv_edges = uvs[faces[:, 1:]] - uvs[faces[:, :1]]
    # J Jᵀ = U G⁻¹ Uᵀ with the edges U in texture and their Gram matrix G in space; |G| = 4 A².
    gram = np.einsum("fik,fjk->fij", edges, edges)
    adjugates = np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(2) - gram
    weights = adjugates / (4.0 * np.maximum(areas, np.finfo(np.float64).tiny))[:, None, None]
    moments = np.einsum("fik,fij,fjl->fkl", uv_edges, weights, uv_edges)
    sums = [np.bincount(face_charts, moments[:, i, j]) for i in (0, 1) for j in (0, 1)]
    maps = _inverse_square_roots(np.array(sums, dtype=np.float64).T.reshape(-1, 2, 2))
    uvs = np.einsum("tij,tj->ti", maps[chart_ids], uvs)

    flat_areas = np.bincount(face_charts, signed_areas(uvs[faces]))
    squares = np.zeros_like(flat_areas)
    np.divide(np.bincount(face_charts, areas), flat_areas, out=squares, where=flat_areas > 0.0)
    return np.asarray(uvs * np.sqrt(squares)[chart_ids, None])


def _inverse_square_roots(matrices: FloatArray) -> FloatArray:
    """H^(-1/2) of symmetric positive (n, 2, 2) matrices; the identity for one that is singular."""
    roots_det = np.sqrt(np.maximum(np.linalg.det(matrices), 0.0))
    traces = np.trace(matrices, axis1=1, axis2=2)
    singular = roots_det <= 1e-12 * traces  # a chart of 1 : 1e12 has no second direction
    roots_det, traces = np.where(singular, 1.0, roots_det), np.where(singular, 2.0, traces)
    matrices = np.where(singular[:, None, None], np.eye(2), matrices)
    # Cayley and Hamilton: H^(1/2) = (H + √|H| 1) / √(tr H + 2 √|H|), of determinant √|H|.
    norms = np.sqrt(traces + 2.0 * roots_det)[:, None, None]
    roots = (matrices + roots_det[:, None, None] * np.eye(2)) / norms
    adjugates = np.trace(roots, axis1=1, axis2=2)[:, None, None] * np.eye(2) - roots
    return np.asarray(adjugates / roots_det[:, None, None])
