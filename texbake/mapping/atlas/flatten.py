"""Patches of triangles flattened with as little distortion as possible and a free boundary.

Charts that were flattened roughly, or by projection, are relaxed to the least stretch that their
layout leads to. That makes no chart worse, and makes none overlap itself.

Kernels: `core/flatten.c`, which names the methods.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from texbake.core import core
from texbake.errors import UvError
from texbake.mapping.atlas.charts import Charts, ChartSurface
from texbake.mapping.seams import merged_labels
from texbake.mapping.stretch import face_stretch
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.topology import opposite_half_edges
from texbake.mesh.weld import weld_rows
from texbake.parallel import run_bands
from texbake.records import dataclass


@dataclass(frozen=True, kw_only=True, eq=False)
class Flat:
    """A flattened patch, with the area that it has in space and without flipped triangles."""

    # (n, 2) float64; coordinates in the unit of the points, about the origin; 0 for unused
    # vertices.
    uvs: FloatArray
    # Stretch of the patch at this scale (Sander et al. 2001): √ of the mean of (Γ² + γ²) / 2, 1 at
    # best.
    l2: float
    energy: float  # mean of the symmetric Dirichlet energy at this scale, 4 at best
    injective: bool  # true if no two triangles overlap


def flatten(
    points: FloatArray,
    faces: IntArray,
    start: FloatArray | None = None,
    *,
    n_iterations: int = 50,
    accuracy: float = 1e-3,
    keep_apart: bool = False,
) -> Flat | None:
    """Flatten a patch with the least symmetric Dirichlet energy that its start leads to.

    `points` (n, 3) float64; `faces` (m, 3) int32: all with the same winding; `start` (n, 2)
    float64: a layout to start from, by default a circle; ignored if a triangle is flipped or has no
    area. `accuracy`: the iteration stops after a step that gains less than this share of the energy
    above 4; `keep_apart`: also stop each step before the boundary crosses itself. Returns None if
    the patch is not an oriented surface, or if it has no usable start and is no disk.

    >>> bent = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 1]], dtype=float)
    >>> flat = flatten(bent, np.array([[0, 1, 2], [0, 3, 1]], dtype=np.int32))
    >>> round(flat.energy, 6), round(flat.l2, 6), flat.injective
    (4.0, 1.0, True)
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    faces = np.ascontiguousarray(faces, dtype=np.int32)
    uvs = np.zeros((len(points), 2)) if start is None else np.array(start, dtype=np.float64)
    figures = np.empty(3)
    is_laid = core.flatten_patch(
        points, faces, start is not None, n_iterations, accuracy, keep_apart, uvs, figures
    )
    return _flat(uvs, figures) if is_laid else None


def measure_layout(points: FloatArray, faces: IntArray, uvs: FloatArray) -> Flat | None:
    """Move a layout to the origin, at its area in space, as `flatten`; None if it is invalid."""
    points = np.ascontiguousarray(points, dtype=np.float64)
    faces = np.ascontiguousarray(faces, dtype=np.int32)
    uvs = np.array(uvs, dtype=np.float64, order="C")
    figures = np.empty(3)
    is_measured = core.measure_layout(points, faces, uvs, figures)
    return _flat(uvs, figures) if is_measured else None


def _flat(uvs: FloatArray, figures: FloatArray) -> Flat:
    l2, energy, injective = figures.tolist()
    return Flat(uvs=uvs, l2=l2, energy=energy, injective=bool(injective))


def face_energies(corners: FloatArray, uvs: FloatArray) -> FloatArray:
    """(m,) float64: a quarter of the symmetric Dirichlet energy of each face, 1 at best."""
    edges, uv_edges = corners[:, 1:] - corners[:, :1], uvs[:, 1:] - uvs[:, :1]
    first = (edges[:, 0] ** 2).sum(axis=1)
    dot, second = (edges[:, 0] * edges[:, 1]).sum(axis=1), (edges[:, 1] ** 2).sum(axis=1)
    squares = first * second - dot**2  # of twice the area
    a, b = uv_edges[:, 0], uv_edges[:, 1]
    growth = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    sums = second * (a**2).sum(axis=1) - 2.0 * dot * (a * b).sum(axis=1)
    sums += first * (b**2).sum(axis=1)
    valid = (squares > 0.0) & (growth > 0.0)
    energies = np.ones(len(corners))
    np.divide(sums, 4.0 * squares, out=energies, where=valid)
    inverse = np.zeros(len(corners))
    np.divide(squares, growth**2, out=inverse, where=valid)
    return np.where(valid, np.minimum(energies * (1.0 + inverse), 1e6), 1.0)


_ACCURACY = 1e-5  # at which `flatten` stops


def relax_charts(surface: ChartSurface, charts: Charts) -> Charts:
    """Relax charts at their area in space, unless energy, stretch or overlap get worse."""
    points, mesh_faces = surface.points, surface.faces
    whole = _in_one_piece(points, mesh_faces, charts)
    places = np.zeros((len(whole.uvs), 3))
    solid = np.flatnonzero(whole.solid)
    places[whole.faces[solid]] = points[mesh_faces[solid]]
    face_charts = whole.chart_ids[whole.faces[solid, 0]]
    sizes = np.bincount(face_charts, minlength=whole.n_charts)
    order = np.argsort(face_charts, kind="stable")
    groups = np.split(whole.faces[solid[order]], np.cumsum(sizes)[:-1])
    largest_first = np.argsort(-sizes, kind="stable")
    uvs = whole.uvs.copy()

    def relax(first: int, last: int) -> None:
        for chart in largest_first[first:last]:
            vertices, flat = np.unique(groups[chart], return_inverse=True)
            faces: IntArray = flat.reshape(-1, 3).astype(np.int32)
            uvs[vertices] = _relaxed(places[vertices], faces, whole.uvs[vertices])

    run_bands(relax, whole.n_charts, band=1, threads=surface.threads)
    return replace(whole, uvs=uvs)


def _relaxed(points: FloatArray, faces: IntArray, layout: FloatArray) -> FloatArray:
    """Return a better layout of a chart, or its present one."""
    flat = flatten(points, faces, layout, accuracy=_ACCURACY)
    if flat is not None and not flat.injective:
        flat = flatten(points, faces, layout, accuracy=_ACCURACY, keep_apart=True)
    if flat is None or not flat.injective:
        return layout
    before = measure_layout(points, faces, layout)
    if before is None or (flat.energy < before.energy and flat.l2 <= before.l2):
        return flat.uvs
    return layout


def _in_one_piece(points: FloatArray, mesh_faces: IntArray, charts: Charts) -> Charts:
    """Renumber coordinates and charts so that each chart is a connected surface."""
    solid = np.flatnonzero(charts.solid)
    corners = charts.faces[solid]
    rows = np.column_stack(
        [
            charts.chart_ids[corners.ravel()],
            points[mesh_faces[solid].ravel()],
            charts.uvs[corners.ravel()],
        ]
    )
    joints = weld_rows(rows).reshape(-1, 3)
    opposite = opposite_half_edges(joints)
    glued = np.flatnonzero(opposite >= 0).astype(np.int32)
    parts = merged_labels(len(joints), glued // 3, opposite[glued] // 3)
    _, first_faces = np.unique(parts, return_index=True)
    # Parts of the first chart come first, as their coordinates did.
    order = np.argsort(charts.chart_ids[corners[first_faces, 0]], kind="stable")
    new_charts = np.argsort(order, kind="stable")[parts]
    # A coordinate for each vertex of each part.
    owned = weld_rows(np.column_stack([joints.ravel(), np.repeat(parts, 3)]))
    firsts, numbers = np.unique(owned, return_inverse=True)
    anchors = np.full(len(charts.uvs), len(firsts), dtype=np.int64)
    np.minimum.at(anchors, corners.ravel(), numbers)
    faces = anchors[charts.faces]
    faces[solid] = numbers.reshape(-1, 3)
    return replace(
        charts,
        uvs=charts.uvs[corners.ravel()[firsts]],
        faces=np.where(faces < len(firsts), faces, 0).astype(np.int32),
        chart_ids=new_charts[firsts // 3].astype(np.int32),
        n_split=charts.n_split + len(first_faces) - charts.n_charts,
    )


def chart_stretch(points: FloatArray, mesh: Mesh, charts: Charts) -> float:
    """L2 stretch of the mesh, with all charts at one scale."""
    flat = mesh.replace(positions=points, uvs=charts.uvs, uv_faces=charts.faces)
    try:
        found = face_stretch(flat)
    except UvError:  # the areas of all faces are as small as their rounding
        return 1.0
    # Not a dot product, which sums in a different order with a different number of threads.
    return math.sqrt(float((found.areas * found.l2**2).sum()) / float(found.areas.sum()))
