"""Charts flattened again, each with the least distortion that its present layout leads to.

Charts that were flattened roughly, or by projection, come to their least stretch. Relaxing makes no
chart worse, and makes none overlap itself.
"""

from __future__ import annotations

import numpy as np

from texbake.mapping.atlas.charts import Charts
from texbake.mapping.atlas.flattening.flatten import flatten, measured
from texbake.mapping.seams import merged_labels
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.topology import opposite_half_edges
from texbake.mesh.weld import weld_rows
from texbake.parallel import run_bands

_ACCURACY = 1e-5  # at which `flatten` stops


def relax_charts(
    points: FloatArray, mesh_faces: IntArray, charts: Charts, *, threads: int | None = None
) -> Charts:
    """Give each chart the layout of least symmetric Dirichlet energy near its own.

    `points` (V, 3) float64; `mesh_faces` (F, 3) int32. Returns charts with the area that their
    faces have in space. A chart keeps its layout if relaxing does not lower its energy, raises its
    stretch or makes it overlap itself.
    """
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

    run_bands(relax, whole.n_charts, band=1, threads=threads)
    return Charts(
        uvs=uvs,
        faces=whole.faces,
        chart_ids=whole.chart_ids,
        n_ignored=charts.n_ignored,
        n_mirrored=charts.n_mirrored,
        n_split=charts.n_split + whole.n_charts - charts.n_charts,
        notes=charts.notes,
    )


def _relaxed(points: FloatArray, faces: IntArray, layout: FloatArray) -> FloatArray:
    """Return a better layout of a chart, or its present one."""
    flat = flatten(points, faces, layout, accuracy=_ACCURACY)
    if flat is not None and not flat.injective:
        flat = flatten(points, faces, layout, accuracy=_ACCURACY, keep_apart=True)
    if flat is None or not flat.injective:
        return layout
    before = measured(points, faces, layout)
    if before is None or (flat.energy < before.energy and flat.l2 <= before.l2):
        return flat.uvs
    return layout


def _in_one_piece(points: FloatArray, mesh_faces: IntArray, charts: Charts) -> Charts:
    """Renumber coordinates and charts so that each chart is a connected surface.

    Coordinates at the same place become one, since files may repeat vertices within a chart. Faces
    of a chart that are not connected by edges get charts and coordinates of their own.
    """
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
    return Charts(
        uvs=charts.uvs[corners.ravel()[firsts]],
        faces=np.where(faces < len(firsts), faces, 0).astype(np.int32),
        chart_ids=new_charts[firsts // 3].astype(np.int32),
        n_ignored=charts.n_ignored,
        n_mirrored=charts.n_mirrored,
        n_split=charts.n_split,
    )
