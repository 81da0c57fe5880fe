"""Faces without neighbors, as soups of triangles have them: each is laid flat as it is.

Cutting, relaxing and joining take a fraction of a millisecond for each chart, and can do nothing
for one of a single face that no other one continues.
"""

from __future__ import annotations

import numpy as np

from texbake.mapping.atlas.charts import Charts
from texbake.mapping.atlas.cutting.repair import laid_flat
from texbake.mapping.corner_uvs import surface_areas
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.topology import opposite_half_edges
from texbake.mesh.weld import weld_rows

_MANY = 1000


def find_lone_faces(
    points: FloatArray,
    faces: IntArray,
    regions: IntArray | None,
    threads: int | None,
    *,
    polygons: IntArray | None = None,
) -> tuple[IntArray, IntArray]:
    """Find the faces that no other one continues across any edge, if there are many.

    `points` (V, 3) float64; `faces` (F, 3) int32; `regions` (F,) int32; `polygons` (F,) int32.
    Returns `lone` (n,) int32: such faces with an area; none if there are no more than a thousand;
    `others` (m,) int32: all other faces; without those of no area if there are lone ones.
    """
    corners = weld_rows(points, threads=threads)[faces]
    solid = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    opposite = opposite_half_edges(corners, solid=solid, regions=regions, polygons=polygons)
    continued = (opposite.reshape(-1, 3) >= 0).any(axis=1)
    lone = np.flatnonzero(solid & ~continued).astype(np.int32)
    lone = lone[surface_areas(points[faces[lone]]) > 0.0]
    if len(lone) <= _MANY:
        return lone[:0], np.arange(len(faces), dtype=np.int32)
    return lone, np.flatnonzero(continued).astype(np.int32)


def lone_charts(points: FloatArray, faces: IntArray) -> Charts:
    """Lay each face flat as a chart of its own.

    `points` (V, 3) float64; `faces` (F, 3) int32.
    """
    n_faces = len(faces)
    uvs = laid_flat(points[faces])
    return Charts(
        uvs=(uvs - uvs.mean(axis=1, keepdims=True)).reshape(-1, 2),
        faces=np.arange(3 * n_faces, dtype=np.int32).reshape(-1, 3),
        chart_ids=np.repeat(np.arange(n_faces, dtype=np.int32), 3),
        n_ignored=0,
        n_mirrored=0,
        n_split=0,
    )
