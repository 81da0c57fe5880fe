"""How often a surface winds around points: 1 in a closed surface that faces outwards, 0 outside.

Kernel: `core/winding_numbers.c`.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands

# Side of the cells whose faces are one cluster, in voxels.
_CELL = 8.0
_CLUSTERS, _POINTS = 1024, 1

_SAMPLED = 32  # points by which the work is estimated
_FAR = 4.0  # as in `core/winding_numbers.c`
_COST_OF_CLUSTER = 0.2  # as a far cluster, in faces


def winding_numbers(
    positions: FloatArray,
    faces: IntArray,
    points: FloatArray,
    *,
    most_work: float = math.inf,
    threads: int | None = None,
) -> FloatArray:
    """Measure winding numbers, of torn surfaces as well.

    `positions` (V, 3) float64, in units of a voxel; `faces` (F, 3) int32; `points` (n, 3) float64.
    Returns (n,) float64: NaN for the last points, where all would need more faces than `most_work`.
    """
    windings = np.zeros(len(points))
    if len(points) == 0 or len(faces) == 0:
        return windings
    key = np.zeros(len(faces), dtype=np.int64)
    for axis in range(3):
        cells = np.floor(positions[:, axis] / _CELL).astype(np.int64)
        cells -= cells.min()
        key = key * (cells.max() + 1) + cells[faces[:, 0]]
    order = np.argsort(key, kind="stable")
    starts = np.concatenate([[0], 1 + np.flatnonzero(np.diff(key[order])), [len(faces)]])
    clusters = np.empty((len(starts) - 1, 7))
    surface = (positions, faces[order], starts)

    def gather(start: int, stop: int) -> None:
        core.gather_clusters(*surface, clusters, start, stop)

    def measure(start: int, stop: int) -> None:
        core.measure_winding(*surface, clusters, points, windings, start, stop)

    run_bands(gather, len(clusters), band=_CLUSTERS, threads=threads)
    n_measured = int(min(len(points), most_work / _work_of_a_point(clusters, starts, points)))
    run_bands(measure, n_measured, band=_POINTS, threads=threads)
    windings[n_measured:] = np.nan
    return windings


def _work_of_a_point(
    clusters: FloatArray, starts: npt.NDArray[np.int64], points: FloatArray
) -> float:
    """Mean number of faces that are added up for a point, from some of them; clusters cost less."""
    some = points[:: -(-len(points) // _SAMPLED)]
    squares = ((clusters[None, :, :3] - some[:, None]) ** 2).sum(axis=2)
    near = squares <= (_FAR * clusters[:, 6]) ** 2
    n_faces = np.where(near, np.diff(starts), _COST_OF_CLUSTER)
    return float(n_faces.sum()) / len(some)
