"""Connected parts of a mesh with a bounded number of faces, each flattened whole, as one chart.

The time that charts take grows faster than the mesh, so that large meshes are charted in parts,
whose borders follow creases. A part that stretches too much is divided. A part is here any set of
faces that is flattened together, not a part of an asset that is matched by name.

Kernels: `core/face_parts.c` and `core/chart_cutting.c`, which name the methods.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import islice

import numpy as np

from texbake.core import core
from texbake.mapping.atlas.bevels import labels_of_planes
from texbake.mapping.atlas.charts import Charts
from texbake.mapping.atlas.cutting.repair import MOST_STRETCH, OVERLAP_DEPTH, repair_charts
from texbake.mapping.seams import merged_labels
from texbake.mesh.compose import offset_joined
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands
from texbake.records import dataclass

# Rounds of averaging normals over neighbors beforehand, so that noise makes no creases.
_SMOOTHINGS = 1

# Width of the band in which a border moves: rings of faces per edge of the border.
BAND_WIDTH = 0.25

# A step within a polygon: less than any other, as `core/chart_cutting.h` has it.
_WITHIN_POLYGON = -1e-300

# Labels of faces to divide, and of all others, as in `core/parts.h`.
_OPEN, _CLOSED = np.int32(-1), np.int32(-2)


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """Some faces of a mesh, and which of them are neighbors."""

    face_ids: IntArray  # (m,) int32; faces of the mesh, ascending
    # (3 m,) int32; opposite of each half-edge, numbered within the part; -1 where there is none.
    opposite: IntArray


def divide_parts(
    points: FloatArray,
    faces: IntArray,
    opposite: IntArray,
    parts: IntArray,
    *,
    part_faces: int,
    whole_faces: int,
    polygons: IntArray | None = None,
    planes: IntArray | None = None,
    weights: FloatArray | None = None,
) -> IntArray:
    """(F,) connected parts, new ones last, once those above `whole_faces` are divided.

    `planes`: (F,) int32; the plane that each face is in, or in the margin of, which is not divided;
    or -1.
    """
    large = (np.bincount(parts) > whole_faces)[parts]
    if not large.any():
        return parts
    neighbors = np.where(opposite >= 0, opposite // 3, -1).astype(np.int32).reshape(-1, 3)
    labels = np.where(large, _OPEN, _CLOSED)
    core.divide_into_parts(
        neighbors,
        step_lengths(points, faces, opposite, polygons, weights),
        parts,
        part_faces,
        labels,
    )
    if polygons is not None:  # all protected faces are one polygon, which may be large
        labels[large] = labels[np.flatnonzero(large)[_firsts_of(polygons[large])]]
    if planes is not None:
        labels = np.where(large, labels_of_planes(planes, labels, polygons), labels)
    _, ranks = np.unique(np.where(large, labels + len(faces), parts), return_inverse=True)
    numbers: IntArray = ranks.astype(np.int32)
    if weights is not None:
        core.straighten_borders(points, faces, opposite, weights, BAND_WIDTH, numbers)
    return numbers


def _firsts_of(groups: IntArray) -> IntArray:
    """(n,) the first item of the group of each item."""
    _, firsts, numbers = np.unique(groups, return_index=True, return_inverse=True)
    return np.asarray(firsts[numbers], dtype=np.int32)


def step_lengths(
    points: FloatArray,
    faces: IntArray,
    opposite: IntArray,
    polygons: IntArray | None = None,
    weights: FloatArray | None = None,
) -> FloatArray:
    """(F, 3) steps to neighbors, 0 for none, negative within a polygon; `core/face_parts.c`.

    The less a seam along an edge costs, by `weights` (F, 3), the longer is the step across it.
    """
    neighbors = np.where(opposite >= 0, opposite // 3, -1).astype(np.int32).reshape(-1, 3)
    lengths = np.empty((len(faces), 3))
    core.find_step_lengths(points, faces, neighbors, _SMOOTHINGS, lengths)
    if weights is not None:
        lengths /= np.sqrt(weights)
    if polygons is not None:
        is_within = (neighbors >= 0) & (polygons[neighbors] == polygons[:, None])
        lengths[is_within] = _WITHIN_POLYGON
    return lengths


def split_parts(opposite: IntArray, labels: IntArray) -> list[Part]:
    """Make a part of the faces of each label (F,) from 0 on; `opposite` (3 F,)."""
    order = np.argsort(labels, kind="stable").astype(np.int32)
    order = order[np.count_nonzero(labels < 0) :]
    sizes = np.bincount(labels[order])
    ends = np.cumsum(sizes)
    within = np.full(len(labels), -1, dtype=np.int32)
    within[order] = np.arange(len(order)) - np.repeat(ends - sizes, sizes)
    other = opposite // 3
    inner = (opposite >= 0) & (labels[other] == np.repeat(labels, 3))
    local = np.where(inner, 3 * within[other] + opposite % 3, -1).astype(np.int32).reshape(-1, 3)
    return [
        Part(face_ids=face_ids, opposite=local[face_ids].ravel())
        for face_ids in np.split(order, ends[:-1])
        if len(face_ids)
    ]


def connected_parts(opposite: IntArray) -> IntArray:
    """(F,) int32: connected piece of each face, numbered in the order of first faces."""
    half_edges = np.flatnonzero(opposite > np.arange(len(opposite))).astype(np.int32)
    return merged_labels(len(opposite) // 3, half_edges // 3, opposite[half_edges] // 3)


def face_batches(
    points: FloatArray, corners: IntArray, part: Part, *, part_faces: int, regions: IntArray
) -> list[IntArray]:
    """Divide faces into ascending batches of one region each, that xatlas cuts one at a time."""
    pieces = connected_parts(part.opposite)
    labels = divide_parts(
        points,
        corners[part.face_ids],
        part.opposite,
        pieces,
        part_faces=part_faces,
        whole_faces=part_faces + part_faces // 2,
    )
    batches = _batched(labels, pieces, regions[part.face_ids], part_faces)
    return [part.face_ids[batch.face_ids] for batch in split_parts(part.opposite, batches)]


def _batched(parts: IntArray, pieces: IntArray, regions: IntArray, batch_faces: int) -> IntArray:
    """(F,) batch of each face: each part of a divided piece is one, small pieces share one."""
    sizes = np.bincount(parts)
    first = np.unique(parts, return_index=True)[1]
    piece_of, region_of = pieces[first], regions[first]
    divided = np.bincount(piece_of)[piece_of] > 1
    # A new batch begins whenever the faces so far fill one.
    order = np.argsort(region_of, kind="stable")
    shared = np.where(divided, 0, sizes)[order]
    numbers = np.empty(len(sizes), dtype=np.int64)
    numbers[order] = (np.cumsum(shared) - shared) // batch_faces
    numbers[divided] = len(parts) + np.flatnonzero(divided)
    keys = region_of.astype(np.int64) << 32 | numbers
    batches: IntArray = np.unique(keys, return_inverse=True)[1].astype(np.int32)
    return batches[parts]


def faces_done(
    sizes: Sequence[int], advance: Callable[[int], None] | None
) -> Callable[[int], None]:
    """Function that takes how many parts, about in their order, are done, and reports faces."""
    remaining_sizes = iter(sizes)

    def report(n_parts: int) -> None:
        if advance is not None:
            advance(sum(islice(remaining_sizes, n_parts)))

    return report


# Most stretch of a face where the charts are those between marked seams.
MOST_MARKED = 1e3

# Faces of parts that are repaired together: enough for the fixed cost not to count.
_BATCH_FACES = 50_000


@dataclass(frozen=True, kw_only=True)
class ChartLimits:
    """Limits that charts must keep."""

    l2: float  # largest stretch, unless dividing does not lower it
    # length, area: a longer or larger chart is divided, unless it is nearly the whole mesh
    length: float
    area: float
    flat_area: float  # the same of a chart that is hardly stretched, if more
    total_area: float  # area of all charts
    tiny_area: float  # a chart of at most this area may stretch more to join another


def disk_charts(
    points: FloatArray,
    corners: IntArray,
    normals: FloatArray,
    lengths: FloatArray,
    weights: FloatArray,
    parts: Sequence[Part],
    *,
    limits: ChartLimits,
    threads: int | None = None,
    advance: Callable[[int], None] | None = None,
) -> tuple[list[tuple[IntArray, Charts]], IntArray]:
    """Flatten parts in few charts; return faces and charts, and faces (k,) left.

    `normals` (F, 3) show creases; `lengths`: those of `step_lengths`.
    """
    laid: list[_Laid | None] = [None] * len(parts)
    order = sorted(range(len(parts)), key=lambda number: -len(parts[number].face_ids))

    def lay(first: int, last: int) -> None:
        for number in order[first:last]:
            laid[number] = _cut(points, corners, normals, lengths, weights, parts[number], limits)

    report = faces_done([len(parts[number].face_ids) for number in order], advance)
    run_bands(lay, len(parts), band=1, threads=threads, advance=report)
    found = [each for each in laid if each is not None]
    batches = _batches(found)
    charts: list[Charts | None] = [None] * len(batches)

    def repair(first: int, last: int) -> None:
        for number in range(first, last):
            batch = batches[number]
            charts[number] = repair_charts(
                points[np.concatenate([corners[each.face_ids] for each in batch])],
                offset_joined([(each.faces, len(each.uvs)) for each in batch]),
                np.concatenate([each.uvs for each in batch]),
                offset_joined([(each.chart_ids, each.n_charts) for each in batch]),
                even=False,
                most_stretch=MOST_STRETCH if math.isfinite(limits.l2) else MOST_MARKED,
            )

    run_bands(repair, len(batches), band=1, threads=threads)
    pieces = [
        (np.concatenate([each.face_ids for each in batch]), made)
        for batch, made in zip(batches, charts, strict=True)
        if made is not None
    ]
    left = [each.left for each in found]
    return pieces, np.sort(np.concatenate([np.empty(0, np.int32), *left]))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Laid:
    """Charts of a part as they were flattened."""

    face_ids: IntArray  # (m,) int32; faces of the mesh that lie in a chart
    faces: IntArray  # (m, 3) int32; indices into `uvs`
    uvs: FloatArray  # (n, 2) float64
    chart_ids: IntArray  # (n,) int32
    n_charts: int
    left: IntArray  # (k,) int32; faces of the mesh without a chart


def _cut(
    points: FloatArray,
    corners: IntArray,
    normals: FloatArray,
    lengths: FloatArray,
    weights: FloatArray,
    part: Part,
    limits: ChartLimits,
) -> _Laid:
    """Flatten a part, divided if necessary. Kernel: `core/chart_cutting.c`."""
    ids = part.face_ids
    labels = np.empty(len(ids), dtype=np.int32)
    faces = np.empty((len(ids), 3), dtype=np.int32)
    uvs = np.empty((3 * len(ids), 2))
    n_vertices = np.empty(1, dtype=np.int64)
    n_charts = core.cut_charts(
        points, corners[ids], part.opposite, normals[ids], lengths[ids], weights[ids], limits.l2,
        limits.length, limits.area, limits.flat_area, limits.total_area, limits.tiny_area,
        OVERLAP_DEPTH,
        labels, faces, uvs, n_vertices,
    )  # fmt: skip
    laid = labels >= 0
    chart_ids = np.zeros(int(n_vertices[0]), dtype=np.int32)
    chart_ids[faces[laid]] = labels[laid, None]
    return _Laid(
        face_ids=ids[laid],
        faces=faces[laid],
        uvs=uvs[: len(chart_ids)].copy(),
        chart_ids=chart_ids,
        n_charts=n_charts,
        left=ids[~laid],
    )


def _batches(laid: Sequence[_Laid]) -> list[list[_Laid]]:
    """Parts with charts, in batches of some size."""
    batches: list[list[_Laid]] = []
    n_faces = _BATCH_FACES
    for each in laid:
        if each.n_charts == 0:
            continue
        if n_faces >= _BATCH_FACES:
            batches.append([])
            n_faces = 0
        batches[-1].append(each)
        n_faces += len(each.face_ids)
    return batches
