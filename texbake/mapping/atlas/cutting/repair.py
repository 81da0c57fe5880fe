"""Charts repaired: mirrored, unevenly stretched and overlapping ones made good.

xatlas rounds the width and height of every chart up to whole texels, which stretches small charts,
and leaves some charts mirrored. So each chart gets the linear map that evens out its stretch over
all directions, and the area that its faces have in space. Slivers may come out mirrored, and a
chart may overlap itself: such faces become charts of their own. Faces that xatlas ignores get a
single point as their coordinates.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mapping.atlas.charts import Charts, flatten_triangles
from texbake.mapping.corner_uvs import signed_areas, surface_areas
from texbake.mapping.overlap import overlap_layers
from texbake.mapping.seams import connected_faces
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.topology import edge_ids

# Cells of the grid that points are snapped to, along the longest side of the bounding box.
# Positions 1e6 sizes away from the origin are precise to 2^-33 of the size; with cells this much
# wider, hardly one coordinate in a thousand changes its cell after such a move.
GRID_CELLS = 2.0**20

NO_CHART = 2**32 - 1  # chart id of coordinates without a chart
_TINY = np.finfo(np.float64).tiny
_NONE = np.empty(0, dtype=np.intp)

# Most L2 stretch of a face: one that is squashed or sheared more, or mirrored, has lost its shape.
MOST_STRETCH = 10.0

# Faces narrower than this in space lose their shape by snapping to the grid, which moves each
# corner by up to half a cell in each direction. They are taken out if their stretch is more than
# `_MOST_SLIVER_STRETCH`; nobody could see them.
_SLIVER_WIDTH = 4.0 / GRID_CELLS
_MOST_SLIVER_STRETCH = 4.0

# Overlaps up to this depth are two borders that snapping brought together.
OVERLAP_DEPTH = 0.5 / GRID_CELLS


def repair_charts(
    corners: FloatArray,
    faces: npt.NDArray[np.integer[Any]],
    uvs: npt.NDArray[np.floating[Any]],
    chart_ids: npt.NDArray[np.integer[Any]],
    *,
    even: bool = True,
    most_stretch: float = MOST_STRETCH,
) -> Charts | None:
    """Repair charts so that none is mirrored or overlaps itself.

    `corners` (F, 3, 3) float64: positions on the grid, in the unit cube; `faces` (F, 3) int:
    indices into `uvs`; `uvs` (T, 2) float; `chart_ids` (T,) int: `NO_CHART` for coordinates without
    a chart; `even`: give each chart the linear map that evens out its stretch, and the area of its
    faces in space; `most_stretch`: faces that are stretched more become charts of their own.
    Returns None if no face has an area.
    """
    solid = np.flatnonzero((chart_ids[faces] != NO_CHART).all(axis=1)) if len(uvs) else _NONE
    if len(solid) == 0:
        return None
    n_faces, corners = len(corners), corners[solid]
    kept, ids, flat = _renumbered(faces[solid].astype(np.int64), chart_ids)
    laid, n_mirrored = _turned_over(uvs[kept].astype(np.float64), flat, ids)
    if even:
        laid = _evened(laid, flat, ids, corners)

    widths = _widths(corners)
    squares = _squared_stretch(corners, laid[flat])
    lost = squares > most_stretch**2
    keep = (widths >= _SLIVER_WIDTH) | (squares <= _MOST_SLIVER_STRETCH**2)
    if not keep.any():
        return None
    solid, corners, flat, lost = solid[keep], corners[keep], flat[keep], lost[keep]
    n_charts = int(np.count_nonzero(np.bincount(ids[flat[:, 0]])))
    flat, laid, ids = _taken_apart(corners, flat, laid, ids, lost)
    kept, ids, flat = _renumbered(flat, ids)
    all_faces = np.zeros((n_faces, 3), dtype=np.int32)
    all_faces[solid] = flat
    return Charts(
        uvs=laid[kept],
        faces=all_faces,
        chart_ids=ids,
        n_ignored=n_faces - len(solid),
        n_mirrored=n_mirrored,
        n_split=int(ids.max()) + 1 - n_charts,
    )


def _renumbered(
    faces: npt.NDArray[np.int64], chart_ids: npt.NDArray[np.integer[Any]]
) -> tuple[npt.NDArray[np.int64], IntArray, npt.NDArray[np.int64]]:
    """Coordinates that faces use, their charts numbered without gaps, and the faces renumbered."""
    is_kept = np.zeros(len(chart_ids), dtype=np.bool_)
    is_kept[faces] = True
    kept = np.flatnonzero(is_kept)
    _, ids = np.unique(chart_ids[kept], return_inverse=True)
    return kept, ids.astype(np.int32), (np.cumsum(is_kept) - 1)[faces]


def _widths(corners: FloatArray) -> FloatArray:
    """(F,) float64: height of a face over its longest edge, in space."""
    edges = corners - np.roll(corners, 1, axis=1)
    longest = np.sqrt((edges**2).sum(axis=2).max(axis=1))
    return np.asarray(2.0 * surface_areas(corners) / np.maximum(longest, _TINY))


def _squared_stretch(corners: FloatArray, uvs: FloatArray) -> FloatArray:
    """(F,) float64: (Γ² + γ²) / 2 of the map from the plane; infinite for a mirrored face."""
    edges, uv_edges = corners[:, 1:] - corners[:, :1], uvs[:, 1:] - uvs[:, :1]
    # The columns of the map are (edges · uv_edges⁻¹); the inverse is the adjugate over 2 A.
    across = edges[:, 0] * uv_edges[:, 1, 1:] - edges[:, 1] * uv_edges[:, 0, 1:]
    up = edges[:, 1] * uv_edges[:, 0, :1] - edges[:, 0] * uv_edges[:, 1, :1]
    areas = 2.0 * signed_areas(uvs)
    squares = np.full(len(corners), np.inf)
    sums = (across**2).sum(axis=1) + (up**2).sum(axis=1)
    np.divide(sums, 2.0 * areas**2, out=squares, where=areas > 0.0)
    return squares


def _taken_apart(
    corners: FloatArray,
    faces: npt.NDArray[np.int64],
    uvs: FloatArray,
    chart_ids: IntArray,
    lost: npt.NDArray[np.bool_],
) -> tuple[npt.NDArray[np.int64], FloatArray, IntArray]:
    """Give `lost` faces, flattened again, and overlapping ones charts; some uvs stay unused."""
    charts = chart_ids[faces[:, 0]]
    layers = overlap_layers(uvs[faces], charts, depth=OVERLAP_DEPTH)
    layers[lost] = 0
    if not (layers.any() or lost.any()):
        return faces, uvs, chart_ids
    # The rest of a chart may fall apart too; otherwise one part could enclose another.
    torn = np.isin(charts, charts[(layers > 0) | lost])
    n_layers = int(layers.max()) + 1
    joints = np.where(torn[:, None], faces * n_layers + layers[:, None], 0)
    joints[lost] = len(uvs) * n_layers + np.arange(3 * lost.sum()).reshape(-1, 3)
    new_charts = charts.astype(np.int64)
    new_charts[torn] = charts.max() + 1 + connected_faces(edge_ids(joints[torn]))

    uvs = np.concatenate([uvs, flatten_triangles(corners[lost]).reshape(-1, 2)])
    faces = faces.copy()
    faces[lost] = np.arange(len(uvs) - 3 * lost.sum(), len(uvs)).reshape(-1, 3)
    pairs = np.stack([faces, np.repeat(new_charts[:, None], 3, axis=1)], axis=2).reshape(-1, 2)
    pairs, new_faces = np.unique(pairs, axis=0, return_inverse=True)
    return new_faces.reshape(-1, 3), uvs[pairs[:, 0]], pairs[:, 1].astype(np.int32)


def _turned_over(
    uvs: FloatArray, faces: npt.NDArray[np.int64], chart_ids: IntArray
) -> tuple[FloatArray, int]:
    """Move each chart to the origin, mirror those of negative area, and count these."""
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

    Let J be the Jacobian of a face from space to texture and A its area in space. H = Σ A J Jᵀ is a
    multiple of the identity if the chart is stretched equally in all directions, and H^(-1/2) is
    the linear map that makes it so; of all maps that keep areas, it leaves the least Dirichlet
    energy.
    """
    face_charts = chart_ids[faces[:, 0]]
    edges, areas = corners[:, 1:] - corners[:, :1], surface_areas(corners)
    uv_edges = uvs[faces[:, 1:]] - uvs[faces[:, :1]]
    # J Jᵀ = U G⁻¹ Uᵀ with the edges U in texture and their Gram matrix G in space; |G| = 4 A².
    gram = pm.matmul(edges, edges.swapaxes(1, 2))
    adjugates = np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(2) - gram
    weights = adjugates / (4.0 * np.maximum(areas, _TINY))[:, None, None]
    moments = pm.matmul(uv_edges.swapaxes(1, 2), pm.matmul(weights, uv_edges))
    sums = [np.bincount(face_charts, moments[:, i, j]) for i in (0, 1) for j in (0, 1)]
    maps = _inverse_square_roots(np.array(sums, dtype=np.float64).T.reshape(-1, 2, 2))
    uvs = pm.matvec(maps[chart_ids], uvs)

    flat_areas = np.bincount(face_charts, signed_areas(uvs[faces]))
    squares = np.zeros_like(flat_areas)
    np.divide(np.bincount(face_charts, areas), flat_areas, out=squares, where=flat_areas > 0.0)
    return np.asarray(uvs * np.sqrt(squares)[chart_ids, None])


def _inverse_square_roots(matrices: FloatArray) -> FloatArray:
    """H^(-1/2) of symmetric positive (n, 2, 2) matrices; the identity for a singular one."""
    roots_det = np.sqrt(np.maximum(pm.det(matrices), 0.0))
    traces = np.trace(matrices, axis1=1, axis2=2)
    # A chart 1e12 times as long as wide has no width, and one of rounding alone no size.
    singular = ~((traces > 0.0) & (roots_det > 1e-12 * traces))
    roots_det, traces = np.where(singular, 1.0, roots_det), np.where(singular, 2.0, traces)
    matrices = np.where(singular[:, None, None], np.eye(2), matrices)
    # Cayley and Hamilton: H^(1/2) = (H + √|H| 1) / √(tr H + 2 √|H|), of determinant √|H|.
    norms = np.sqrt(traces + 2.0 * roots_det)[:, None, None]
    roots = (matrices + roots_det[:, None, None] * np.eye(2)) / norms
    adjugates = np.trace(roots, axis1=1, axis2=2)[:, None, None] * np.eye(2) - roots
    return np.asarray(adjugates / roots_det[:, None, None])
