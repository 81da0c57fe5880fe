"""A mesh cut into charts: in parts that are flattened whole and halved as needed, or by xatlas.

Points are first snapped to a grid, in a frame that depends neither on the size nor on the position
of the model, so that rounding in the model's coordinates does not affect the charts.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from texbake.errors import UnwrapError, require_library
from texbake.mapping.atlas.charts import Charts, ChartSurface, gather_charts
from texbake.mapping.atlas.cutting.parts import (
    ChartLimits,
    Part,
    connected_parts,
    disk_charts,
    divide_parts,
    face_batches,
    split_parts,
    step_lengths,
)
from texbake.mapping.atlas.cutting.repair import GRID_CELLS
from texbake.mapping.atlas.cutting.xatlas_charts import plain_piece, xatlas_charts
from texbake.mapping.atlas.edge_weights import edge_weights
from texbake.mapping.corner_uvs import surface_areas
from texbake.mapping.stretch import longest_squares
from texbake.mesh.distance import area_vectors
from texbake.mesh.frame import UnitGrid
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh
from texbake.mesh.normals import degenerate_faces
from texbake.records import dataclass

# Small pieces are cut together, about this many faces at a time.
_BATCH_FACES = 1_000

# Faces that xatlas, where it is asked for, gets at a time: it takes 0.3 s for 5,000 and 3 s for
# 20,000. And faces that are cut by their normals together.
_XATLAS_FACES = 20_000
_PLAIN_FACES = 3_000

# A chart is tiny below this share of the largest area, or less if there are many similar parts.
_TINY_SHARE = 0.007

# A longer chart would set the scale of all others: most sides of a square as large as all charts.
_MOST_SIDES = 1.6
# Faces that are longer than this many sides are a strip, which no cut makes shorter. Shorter faces
# stay apart from it, since the texture may show it shorter than it is, with all that it contains.
STRIP_SIDES = 3.0


@dataclass(frozen=True, kw_only=True)
class _Quality:
    """How large charts get."""

    # Faces of the parts that a large connected piece is divided into before flattening.
    part_faces: int
    whole_faces: int  # faces of the largest piece that is not divided
    most_l2: float  # largest stretch at which a part becomes one chart
    # Largest share of the area of the mesh in one chart: a few large charts do not fill a square.
    most_share: float
    most_flat_share: float = 0.0  # the same of one that is hardly stretched, if more


_QUALITIES = {
    "fast": _Quality(
        part_faces=4_000, whole_faces=6_000, most_l2=1.06, most_share=0.25, most_flat_share=0.35
    ),
    "good": _Quality(part_faces=6_000, whole_faces=9_000, most_l2=1.005, most_share=0.2),
    "best": _Quality(part_faces=10_000, whole_faces=15_000, most_l2=1.06, most_share=0.25),
}

# Marked seams allow no others, except where a chart cannot be flattened without them.
_AS_MARKED = _Quality(
    part_faces=1 << 30, whole_faces=1 << 30, most_l2=math.inf, most_share=math.inf
)


def surface_of(
    mesh: Mesh,
    regions: IntArray | None = None,
    threads: int | None = None,
    *,
    seams: BoolArray | None = None,
) -> ChartSurface:
    """Surface of a mesh, its points snapped to the grid."""
    return ChartSurface(
        points=snap_points(mesh),
        faces=mesh.faces,
        polygons=mesh.polygon_of,
        regions=regions,
        seams=seams,
        threads=threads,
    )


def may_stay_whole(surface: ChartSurface, quality: str) -> bool:
    """Whether each connected part may become one chart: it has a boundary, and not many faces."""
    opposite = surface.joints[2]
    parts = connected_parts(opposite)
    at_boundary = (opposite.reshape(-1, 3) < 0).any(axis=1)
    is_small = np.bincount(parts).max() <= _QUALITIES[quality].whole_faces
    return bool(is_small and len(np.unique(parts[at_boundary])) == len(np.unique(parts)))


def cut_charts(
    mesh: Mesh,
    surface: ChartSurface,
    *,
    weights: FloatArray | None = None,
    quality: str = "good",
    method: str = "texbake",
    timeout: float | None = None,
    area: float | None = None,
    advance: Callable[[int], None] | None = None,
) -> Charts:
    """Cut a surface into charts and flatten them.

    `weights`: (F, 3) costs of seams along edges, those of `edge_weights`; `timeout`: seconds of
    xatlas per batch; `area`: that of all charts, if there will be others too.
    """
    weights = edge_weights(surface).weights if weights is None else weights
    # On the grid of the points they may have one, depending on where the grid lies.
    if degenerate_faces(mesh).all():
        raise UnwrapError(_why_nothing(mesh))
    points, threads = surface.points, surface.threads
    corners, solid, opposite = surface.joints
    notes: tuple[str, ...] = ()
    if method == "xatlas":
        require_library("xatlas", "method")
        whole = Part(face_ids=np.arange(mesh.n_faces, dtype=np.int32), opposite=opposite)
        regions = np.zeros(mesh.n_faces, np.int32) if surface.regions is None else surface.regions
        batches = face_batches(points, corners, whole, part_faces=_XATLAS_FACES, regions=regions)
        pieces, notes = xatlas_charts(
            points, mesh.faces, batches, timeout=timeout, threads=threads, advance=advance
        )
    else:
        sizes = _QUALITIES[quality] if surface.seams is None else _AS_MARKED
        areas = surface_areas(points[corners])
        if area is None:
            area = float(areas[solid].sum())
        # Where charts are joined, joins along bevels are shorter than cuts along all of them.
        normals = surface.bevels.normals if quality == "fast" else area_vectors(points, corners)
        if surface.seams is None:
            opposite = _around_strips(points, corners, opposite, STRIP_SIDES * math.sqrt(area))
        labels = _labels(surface, opposite, sizes, weights)
        pieces, left = disk_charts(
            points,
            corners,
            normals,
            step_lengths(points, corners, opposite, surface.polygons, weights),
            weights,
            split_parts(opposite, np.where(solid, labels, -1)),
            limits=ChartLimits(
                l2=sizes.most_l2,
                length=math.inf if surface.seams is not None else _MOST_SIDES * math.sqrt(area),
                area=sizes.most_share * area,
                flat_area=sizes.most_flat_share * area,
                total_area=area,
                tiny_area=_TINY_SHARE * sizes.most_share * area * _typical_share(areas, opposite),
            ),
            threads=threads,
            advance=advance,
        )
        pieces += [
            charts
            for first in range(0, len(left), _PLAIN_FACES)
            if (charts := plain_piece(points, mesh.faces, left[first : first + _PLAIN_FACES]))
        ]
    if not pieces:
        raise UnwrapError(_why_nothing(mesh))
    return gather_charts(mesh.faces, pieces, notes)


def _around_strips(
    points: FloatArray, corners: IntArray, opposite: IntArray, strip_length: float
) -> IntArray:
    """(3 F,) int32: `opposite`, cut where long faces meet others of less than half their length."""
    if float(np.sum(np.ptp(points, axis=0) ** 2)) <= strip_length**2:  # no edge is longer
        return opposite
    lengths = np.sqrt(longest_squares(points[corners]))
    if not (lengths > strip_length).any():
        return opposite
    own, other = np.repeat(lengths, 3), lengths[opposite // 3]
    longer, shorter = np.maximum(own, other), np.minimum(own, other)
    return np.where((longer > strip_length) & (shorter < longer / 2.0), np.int32(-1), opposite)


def _typical_share(areas: FloatArray, opposite: IntArray) -> float:
    """Share of the area of the part that a random point lies in, on average: 1/n for n alike."""
    parts = np.bincount(connected_parts(opposite), areas)
    return float((parts**2).sum() / max(float(parts.sum()) ** 2, np.finfo(float).tiny))


def _labels(
    surface: ChartSurface, opposite: IntArray, quality: _Quality, weights: FloatArray
) -> IntArray:
    """(F,) int32: the part or batch in which each face is cut."""
    labels = connected_parts(opposite)
    if np.bincount(labels).max() > quality.whole_faces:
        labels = divide_parts(
            surface.points,
            surface.corners,
            opposite,
            labels,
            part_faces=quality.part_faces,
            whole_faces=quality.whole_faces,
            polygons=surface.polygons,
            planes=surface.bevels.owners,
            weights=weights,
        )
    sizes = np.bincount(labels)
    small = sizes < _BATCH_FACES
    numbers = np.where(small, 0, np.arange(len(sizes)))
    numbers[small] = len(sizes) + np.cumsum(sizes[small]) // _BATCH_FACES
    return numbers.astype(np.int32)[labels]


def snap_points(mesh: Mesh) -> FloatArray:
    """(V, 3) positions of a mesh, its longest side 1, about the origin on a grid of 2^-20."""
    return UnitGrid.around(mesh).to_grid(mesh.positions, GRID_CELLS)


def _why_nothing(mesh: Mesh) -> str:
    if degenerate_faces(mesh).all():
        return f"{mesh.name}: no face has an area; look for the cause with: texbake info"
    return (
        f"{mesh.name}: each of its {mesh.n_polygons} faces is narrower than 4 millionths of the "
        "size of the mesh; remove parts that lie far away, or split the mesh"
    )
