"""Vertices of a surface moved onto the mesh that it wraps, without folding a face.

Kernel: `core/folded_faces.c`.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.remeshing.sharp_edges import divided_along, flipped_along, sharp_targets
from texbake.mesh.remeshing.solid import Nets
from texbake.mesh.triangle_tree import TriangleTree
from texbake.mesh.weld import weld_rows
from texbake.parallel import run_bands

# Lengths in voxels: how far a vertex moves at most, and how far from a sheet it stays.
_LONGEST_STEP, _SHEET_GAP = 1.25, 0.15
# Of vertices that close a gap: how often they move to the mean of their neighbors.
_SMOOTHINGS = 20
# How often those that fill smooth holes move towards the least bending.
_FAIRINGS = 400
# How often the steps of a fold's vertices are halved before they are taken back.
_HALVINGS = 4

_FACES = 1 << 16


def project(
    nets: Nets,
    tree: TriangleTree,
    *,
    sharp_edges: bool = False,
    smooth: npt.NDArray[np.bool_] | None = None,
    threads: int | None = None,
) -> tuple[FloatArray, IntArray]:
    """Move vertices to the closest points of triangles, as far as no face folds.

    Vertices with no triangle near them, which close gaps, are smoothed instead.

    `tree`, in the same units, voxels; `smooth` (F,) bool: triangles that fill holes, near which
    vertices move to where the surface bends least. Returns `positions` (V, 3) float64; `faces` (2
    n, 3) int32: the quads, divided.
    """
    before = nets.positions
    distances, face_ids, weights = tree.closest_points(
        before, max_distance=_LONGEST_STEP, threads=threads
    )
    free = face_ids < 0
    fills = np.zeros(len(before), dtype=np.bool_)
    if smooth is not None:
        fills = ~free & smooth[face_ids]
        free |= fills
    corners = tree.positions[tree.faces[np.where(free, 0, face_ids)]]
    targets = pm.vecmat(weights, corners)
    with np.errstate(divide="ignore", invalid="ignore"):
        back = np.where(nets.thin, np.minimum(_SHEET_GAP / distances, 1.0), 0.0)
    targets += np.nan_to_num(back)[:, None] * (before - targets)
    targets[free] = before[free]
    targets = _smoothed(targets, nets.quads, free)
    targets = _faired(targets, nets.quads, fills)
    is_sharp = np.zeros(len(before), dtype=np.bool_)
    if sharp_edges:
        ids = np.where(nets.thin, -1, face_ids)
        is_sharp, targets = sharp_targets(before, targets, ids, nets.quads, tree, threads=threads)
    checked = nets.triangles(before, threads=threads)
    if is_sharp.any():
        checked = divided_along(checked, nets.quads, is_sharp, before, targets)
    moved = without_folds(before, targets, checked, is_sharp, threads)
    faces = nets.triangles(moved, threads=threads)
    if is_sharp.any():
        at_edges = np.repeat(is_sharp[nets.quads].any(axis=1), 2)
        faces[at_edges] = checked[at_edges]
        is_sharp &= (moved == targets).all(axis=1)
        faces = flipped_along(faces, is_sharp, moved)
    return moved, faces


def _smoothed(positions: FloatArray, quads: IntArray, free: npt.NDArray[np.bool_]) -> FloatArray:
    """Move free vertices to the means of their neighbors, again and again."""
    edges = np.concatenate([quads[:, [k, (k + 1) % 4]] for k in range(4)])
    edges = edges[free[edges[:, 0]]]  # each edge comes both ways, from its two quads
    ids = np.flatnonzero(free)
    if len(ids) == 0:
        return positions
    rows = np.searchsorted(ids, edges[:, 0])
    counts = np.bincount(rows, minlength=len(ids))[:, None]
    for _ in range(_SMOOTHINGS):
        neighbors = positions[edges[:, 1]]
        sums = [np.bincount(rows, neighbors[:, axis], len(ids)) for axis in range(3)]
        positions[ids] = np.stack(sums, axis=1) / counts
    return positions


def _faired(positions: FloatArray, quads: IntArray, free: npt.NDArray[np.bool_]) -> FloatArray:
    """Move free vertices to where the surface bends least, with its slopes at their border.

    Solved by conjugate gradients: least squares of the steps from vertices to the means of their
    neighbors, of the free ones and of those beside them.
    """
    edges = np.concatenate([quads[:, [k, (k + 1) % 4]] for k in range(4)])
    near = np.zeros(len(free), dtype=np.bool_)
    near[edges[free[edges[:, 1]], 0]] = True
    near |= free
    edges = edges[near[edges[:, 0]]]
    used, compact = np.unique(edges, return_inverse=True)
    tails, heads = compact.reshape(-1, 2).T
    n, is_free = len(used), free[used][:, None]
    if not is_free.any():
        return positions
    counts = np.bincount(tails, minlength=n)
    shares = 1.0 / counts[tails]

    def bends(values: FloatArray) -> FloatArray:
        sums = [np.bincount(tails, shares * values[heads, axis], n) for axis in range(3)]
        return np.where(near[used][:, None], np.stack(sums, axis=1) - values, 0.0)

    def pulls(values: FloatArray) -> FloatArray:
        sums = [np.bincount(heads, shares * values[tails, axis], n) for axis in range(3)]
        return np.where(is_free, np.stack(sums, axis=1) - values, 0.0)

    places = positions[used]
    residual = -pulls(bends(places))
    step, square = residual, float((residual * residual).sum())
    least = 1e-10 * square
    for _ in range(_FAIRINGS):
        if square <= least:
            break
        bent = bends(step)
        length = square / float((bent * bent).sum())
        places = places + length * step
        residual = residual - length * pulls(bent)
        before, square = square, float((residual * residual).sum())
        step = residual + square / before * step
    faired = positions.copy()
    faired[used] = places
    return faired


def without_folds(
    before: FloatArray,
    targets: FloatArray,
    faces: IntArray,
    is_sharp: npt.NDArray[np.bool_],
    threads: int | None,
) -> FloatArray:
    """Take back the steps of vertices of faces that fold, first by halves, then wholly.

    Those of vertices that go onto sharp edges are taken back last. Of vertices that would come to
    one place, all but the first go half as far.
    """
    copies = weld_rows(targets, threads=threads) != np.arange(len(targets))
    targets = np.where(copies[:, None], 0.5 * (before + targets), targets)
    after, shares = targets.copy(), np.ones(len(before))
    folded = np.empty(len(faces), dtype=np.bool_)
    find_folded = partial(core.find_folded, before, after, faces, folded)
    halvings = 0
    while True:
        run_bands(find_folded, len(faces), band=_FACES, threads=threads)
        ids = np.unique(faces[folded])
        if len(ids) == 0:
            return after
        halvings += 1
        if halvings <= _HALVINGS + 1 and not is_sharp[ids].all():
            ids = ids[~is_sharp[ids]]
        shares[ids] *= 0.5 if halvings <= _HALVINGS else 0.0
        after[ids] = before[ids] + shares[ids, None] * (targets[ids] - before[ids])
