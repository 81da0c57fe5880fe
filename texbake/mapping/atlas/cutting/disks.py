"""Parts of a mesh flattened whole, each as one chart, and divided where that stretches too much.

Kernel: `core/chart_cutting.c`, which names the method.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from texbake.core import core
from texbake.mapping.atlas.charts import Charts
from texbake.mapping.atlas.cutting.parts import Part
from texbake.mapping.atlas.cutting.repair import OVERLAP_DEPTH, repair_charts
from texbake.mesh.compose import offset_joined
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands

# Faces of parts that are repaired together: enough for the fixed cost not to count.
_BATCH_FACES = 50_000


@dataclass(frozen=True, kw_only=True)
class ChartLimits:
    """Limits that charts must keep."""

    l2: float  # largest stretch, unless dividing does not lower it
    # length, area: a longer or larger chart is divided, unless it is nearly the whole mesh
    length: float
    area: float
    total_area: float  # area of all charts


def disk_charts(
    points: FloatArray,
    corners: IntArray,
    lengths: FloatArray,
    parts: Sequence[Part],
    *,
    limits: ChartLimits,
    threads: int | None = None,
    advance: Callable[[int], None] | None = None,
) -> tuple[list[tuple[IntArray, Charts]], IntArray]:
    """Flatten parts of a mesh, each in as few charts as the stretch allows.

    `points` (V, 3) float64: points on the grid, in the unit cube; `corners` (F, 3) int32: indices
    into `points`; `lengths` (F, 3) float64: from `step_lengths`. Returns `pieces`: faces (m,) int32
    of some parts, and their charts; `left` (k,) int32: faces that could not be flattened,
    ascending.
    """
    laid: list[_Laid | None] = [None] * len(parts)
    order = sorted(range(len(parts)), key=lambda number: -len(parts[number].face_ids))
    n_counted = 0

    def count(n_parts: int) -> None:
        # Parts are of similar size, so that it does not matter which of them are done.
        nonlocal n_counted
        done = order[n_counted : n_counted + n_parts]
        n_counted += n_parts
        if advance is not None:
            advance(sum(len(parts[number].face_ids) for number in done))

    def lay(first: int, last: int) -> None:
        for number in order[first:last]:
            laid[number] = _cut(points, corners, lengths, parts[number], limits)

    run_bands(lay, len(parts), band=1, threads=threads, advance=count)
    found = [each for each in laid if each is not None]
    batches = _batches(found)
    charts: list[Charts | None] = [None] * len(batches)

    def repair(first: int, last: int) -> None:
        for number in range(first, last):
            charts[number] = _charts_of(points, corners, batches[number])

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
    points: FloatArray, corners: IntArray, lengths: FloatArray, part: Part, limits: ChartLimits
) -> _Laid:
    """Flatten a part, divided if necessary. Kernel: `core/chart_cutting.c`."""
    ids = part.face_ids
    labels = np.empty(len(ids), dtype=np.int32)
    faces = np.empty((len(ids), 3), dtype=np.int32)
    uvs = np.empty((3 * len(ids), 2))
    n_vertices = np.empty(1, dtype=np.int64)
    n_charts = core.cut_charts(
        points, corners[ids], part.opposite, lengths[ids], limits.l2, limits.length,
        limits.area, limits.total_area, OVERLAP_DEPTH,
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


def _charts_of(points: FloatArray, corners: IntArray, batch: Sequence[_Laid]) -> Charts | None:
    return repair_charts(
        points[np.concatenate([corners[each.face_ids] for each in batch])],
        offset_joined([(each.faces, len(each.uvs)) for each in batch]),
        np.concatenate([each.uvs for each in batch]),
        offset_joined([(each.chart_ids, each.n_charts) for each in batch]),
        even=False,
    )
