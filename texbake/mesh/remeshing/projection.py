"""Vertices of a surface moved onto the mesh that it wraps, without folding a face.

With sharp edges, a vertex whose neighbors lie on faces of the mesh at an angle moves to the point
that is closest to the planes of all those faces, if that is on the mesh and in the vertex's own
cell. Where opposite corners of a quad lie on a sharp edge, the quad is divided along it.

Based on: Tao Ju, Frank Losasso, Scott Schaefer, Joe Warren, "Dual contouring of Hermite data",
SIGGRAPH 2002; Leif Kobbelt et al., "Feature sensitive surface extraction from volume data",
SIGGRAPH 2001, for the test by angles between normals. Kernel: `core/folded_faces.c`.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.distance import area_vectors, unit_normals
from texbake.mesh.mesh import BoolArray, FloatArray, IndexArray, IntArray
from texbake.mesh.remeshing.solid import Nets
from texbake.mesh.topology import opposite_half_edges
from texbake.mesh.triangle_tree import TriangleTree
from texbake.mesh.weld import row_sums, weld_rows
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

# Faces of the mesh at a greater angle, in degrees, make a sharp edge.
SHARP_ANGLE = 30.0
_SHARP = pm.cos(np.radians(SHARP_ANGLE))
# Planes whose normals span a direction by less than this share, as eigenvalues, leave it open.
_LEAST_SPAN = 0.05
# In voxels: how far outside its cell a vertex may go, and how far off the mesh the planes may meet.
_BEYOND_CELL, _OFF_MESH = 0.6, 0.1
# In voxels: how far vertices on an edge are apart, and others from it.
_APART, _BESIDE = 0.5, 0.35
# Corners come before edges, by more than a vertex moves.
_CORNERS_FIRST = 10.0
# Doubled area of a triangle, in voxels, whose corners count as being on one line.
_SLIVER = 0.1
# A divided quad's triangles turn away from it by no more than this (a cosine).
_UPRIGHT = 0.1


def project(
    nets: Nets,
    tree: TriangleTree,
    *,
    sharp_edges: bool = False,
    smooth: BoolArray | None = None,
    threads: int | None = None,
) -> tuple[FloatArray, IntArray]:
    """Move vertices to the closest points of triangles, as far as no face folds, or smooth them.

    `smooth` (F,) bool: triangles that fill holes. Returns `positions` (V, 3) and `faces` (2 n, 3).
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
    targets = pm.vecmat(weights, tree.positions[tree.faces[np.where(free, 0, face_ids)]])
    with np.errstate(divide="ignore", invalid="ignore"):
        back = np.where(nets.thin, np.minimum(_SHEET_GAP / distances, 1.0), 0.0)
    targets += np.nan_to_num(back)[:, None] * (before - targets)
    targets[free] = before[free]
    edges = np.concatenate([nets.quads[:, [k, (k + 1) % 4]] for k in range(4)])
    targets = _smooth(targets, edges, free)
    targets = _fair(targets, edges, fills)
    is_sharp = np.zeros(len(before), dtype=np.bool_)
    if sharp_edges:
        ids = np.where(nets.thin, -1, face_ids)
        is_sharp, targets = _sharp_targets(before, targets, ids, nets.quads, tree, threads=threads)
    checked = nets.triangles(before, threads=threads)
    if is_sharp.any():
        checked = _divide_along(checked, nets.quads, is_sharp, before, targets)
    moved = without_folds(before, targets, checked, is_sharp, threads)
    faces = nets.triangles(moved, threads=threads)
    if is_sharp.any():
        at_edges = np.repeat(is_sharp[nets.quads].any(axis=1), 2)
        faces[at_edges] = checked[at_edges]
        is_sharp &= (moved == targets).all(axis=1)
        faces = _flip_along(faces, is_sharp, moved)
    return moved, faces


def _smooth(positions: FloatArray, edges: IntArray, free: BoolArray) -> FloatArray:
    """Move free vertices to the means of their neighbors, again and again."""
    edges = edges[free[edges[:, 0]]]  # each edge comes both ways, from its two quads
    ids = np.flatnonzero(free)
    if len(ids) == 0:
        return positions
    rows = np.searchsorted(ids, edges[:, 0])
    counts = np.bincount(rows, minlength=len(ids))[:, None]
    for _ in range(_SMOOTHINGS):
        positions[ids] = row_sums(rows, positions[edges[:, 1]], len(ids)) / counts
    return positions


def _fair(positions: FloatArray, edges: IntArray, free: BoolArray) -> FloatArray:
    """Move free vertices to where the surface bends least, with its slopes at their border."""
    near = np.zeros(len(free), dtype=np.bool_)
    near[edges[free[edges[:, 1]], 0]] = True
    near |= free
    edges = edges[near[edges[:, 0]]]
    used, compact = np.unique(edges, return_inverse=True)
    tails, heads = compact.reshape(-1, 2).T
    n, is_free = len(used), free[used][:, None]
    if not is_free.any():
        return positions
    shares = 1.0 / np.bincount(tails, minlength=n)[tails]

    def bends(values: FloatArray) -> FloatArray:
        sums = row_sums(tails, shares[:, None] * values[heads], n)
        return np.where(near[used][:, None], sums - values, 0.0)

    def pulls(values: FloatArray) -> FloatArray:
        sums = row_sums(heads, shares[:, None] * values[tails], n)
        return np.where(is_free, sums - values, 0.0)

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
    positions[used] = places
    return positions


def without_folds(
    before: FloatArray,
    targets: FloatArray,
    faces: IntArray,
    is_sharp: BoolArray,
    threads: int | None,
) -> FloatArray:
    """Take back steps of vertices of faces that fold, by halves, then wholly, sharp ones last."""
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


def _sharp_targets(
    before: FloatArray,
    on_mesh: FloatArray,
    face_ids: IntArray,
    quads: IntArray,
    tree: TriangleTree,
    *,
    threads: int | None = None,
) -> tuple[BoolArray, FloatArray]:
    """Vertices (V,) that belong onto a sharp edge, and the places of all, (V, 3), on the mesh."""
    normals = unit_normals(tree.positions, tree.faces[np.maximum(face_ids, 0)])
    normals[face_ids < 0] = 0.0
    is_candidate = _candidates(quads, normals, face_ids)
    around = quads[is_candidate[quads].any(axis=1)]
    vertices = np.repeat(around, 4, axis=0).reshape(-1, 4, 4).transpose(0, 2, 1).reshape(-1)
    planes = np.repeat(around, 4, axis=0).reshape(-1)
    used = is_candidate[vertices] & (face_ids[planes] >= 0)
    vertices, planes = vertices[used], planes[used]
    ids, rows = np.unique(vertices, return_inverse=True)
    offsets = on_mesh[planes] - before[vertices]
    steps, n_directions = _meet_planes(normals[planes], offsets, rows, len(ids))
    found = before[ids] + steps
    in_cell = (n_directions > 1) & (
        np.abs(found - (np.floor(before[ids]) + 0.5)) <= 0.5 + _BEYOND_CELL
    ).all(axis=1)
    ids, found, is_corner = ids[in_cell], found[in_cell], n_directions[in_cell] == 3
    met, places = _on_mesh(found, tree, threads)
    ids = ids[met]
    costs = pm.norm(places - before[ids], axis=1) - _CORNERS_FIRST * is_corner[met]
    chosen = _apart(ids, places, costs, around, len(before))
    is_sharp = np.zeros(len(before), dtype=np.bool_)
    is_sharp[ids[chosen]] = True
    targets = on_mesh.copy()
    targets[ids[chosen]] = places[chosen]
    beside, from_edge = ids[~chosen], places[~chosen]
    away = before[beside] - from_edge
    away -= normals[beside] * pm.vecdot(normals[beside], away)[:, None]
    lengths = pm.norm(away, axis=1, keepdims=True)
    away *= np.maximum(_BESIDE / np.maximum(lengths, 1e-9), 1.0)
    met, places = _on_mesh(from_edge + away, tree, threads)
    targets[beside[met]] = places
    return is_sharp, targets


def _on_mesh(
    points: FloatArray, tree: TriangleTree, threads: int | None
) -> tuple[BoolArray, FloatArray]:
    """Which points are almost on the mesh, (n,) bool, and the closest points of those."""
    _, face_ids, weights = tree.closest_points(points, max_distance=_OFF_MESH, threads=threads)
    met = face_ids >= 0
    corners = tree.positions[tree.faces[face_ids[met]]]
    return np.asarray(met), pm.vecmat(weights[met], corners)


def _apart(
    ids: IntArray, places: FloatArray, costs: FloatArray, quads: IntArray, n_vertices: int
) -> BoolArray:
    """(m,) bool: which vertices go onto an edge: those that move least, none close to another."""
    rows = np.full(n_vertices, -1)
    rows[ids] = np.arange(len(ids))
    corners = rows[quads]
    pairs = np.concatenate([corners[:, [i, j]] for i in range(4) for j in range(i)])
    pairs = np.unique(np.sort(pairs[(pairs >= 0).all(axis=1)], axis=1), axis=0)
    close = pm.norm(places[pairs[:, 0]] - places[pairs[:, 1]], axis=1) < _APART
    pairs = pairs[close]
    ranks = np.empty(len(ids), dtype=np.int64)
    ranks[np.argsort(costs, kind="stable")] = np.arange(len(ids))
    chosen, open_ = np.zeros(len(ids), dtype=np.bool_), np.ones(len(ids), dtype=np.bool_)
    while open_.any():
        least = np.full(len(ids), len(ids))
        live = pairs[open_[pairs].all(axis=1)]
        np.minimum.at(least, live[:, 0], ranks[live[:, 1]])
        np.minimum.at(least, live[:, 1], ranks[live[:, 0]])
        now = open_ & (ranks < least)
        chosen |= now
        open_ &= ~now
        open_[live[now[live[:, 0]], 1]] = False
        open_[live[now[live[:, 1]], 0]] = False
    return _without_slivers(chosen, places, costs, corners)


def _without_slivers(
    chosen: BoolArray, places: FloatArray, costs: FloatArray, corners: IntArray
) -> BoolArray:
    """Leave out the costliest of three vertices on one line, in quads with all corners on edges."""
    full = corners[(corners >= 0).all(axis=1)]
    full = full[chosen[full].all(axis=1)]
    triples = np.concatenate([np.delete(full, k, axis=1) for k in range(4)])
    sides = places[triples[:, 1:]] - places[triples[:, :1]]
    areas = pm.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    triples = triples[areas < _SLIVER]
    chosen = chosen.copy()
    while True:
        left = triples[chosen[triples].all(axis=1)]
        if len(left) == 0:
            return chosen
        chosen[left[np.arange(len(left)), costs[left].argmax(axis=1)]] = False


def _divide_along(
    faces: IntArray, quads: IntArray, is_sharp: BoolArray, before: FloatArray, after: FloatArray
) -> IntArray:
    """Divide quads along the sharp edge of opposite corners, or through the middle of three."""
    sharp = is_sharp[quads]
    n_sharp = sharp.sum(axis=1)
    opposite = (n_sharp == 2) & (sharp[:, 0] == sharp[:, 2])
    # Of three vertices on an edge the one in the middle lies opposite to the fourth.
    rows = np.flatnonzero(opposite | (n_sharp == 3))
    first = np.where(n_sharp == 3, (~sharp).argmax(axis=1), sharp.argmax(axis=1))[rows]
    turned = np.take_along_axis(quads[rows], (first[:, None] + np.arange(4)) % 4, axis=1)
    halves = np.stack([turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]], axis=1)
    diagonals = (
        before[turned[:, 2]] - before[turned[:, 0]],
        before[turned[:, 3]] - before[turned[:, 1]],
    )
    fits = _face_along(np.cross(*diagonals), area_vectors(after, halves))
    divided = faces.reshape(-1, 2, 3).copy()
    divided[rows[fits]] = halves[fits]
    return divided.reshape(-1, 3)


def _candidates(quads: IntArray, normals: FloatArray, face_ids: IntArray) -> BoolArray:
    """(V,) bool: vertices of quads whose corners lie on faces at an angle."""
    bends = np.zeros(len(quads), dtype=np.bool_)
    for i in range(4):
        for j in range(i):
            one, other = quads[:, i], quads[:, j]
            # Either side of a face may be the outer one: the mesh may be wound in any way.
            cosines = np.abs(pm.vecdot(normals[one], normals[other]))
            bends |= (cosines < _SHARP) & (face_ids[one] >= 0) & (face_ids[other] >= 0)
    found = np.zeros(len(normals), dtype=np.bool_)
    found[quads[bends]] = True
    return found & (face_ids >= 0)


def _meet_planes(
    normals: FloatArray, offsets: FloatArray, rows: IndexArray, n: int
) -> tuple[FloatArray, IndexArray]:
    """(n, 3) places, closest to 0, where planes of rows meet, and (n,) directions they span."""
    moments, pulls = np.empty((n, 3, 3)), np.empty((n, 3))
    distances = pm.vecdot(normals, offsets)
    for i in range(3):
        pulls[:, i] = np.bincount(rows, normals[:, i] * distances, n)
        for j in range(3):
            moments[:, i, j] = np.bincount(rows, normals[:, i] * normals[:, j], n)
    values, axes = pm.eigh(moments)
    kept = values > _LEAST_SPAN * values[:, 2:]
    inverse = np.divide(1.0, values, out=np.zeros_like(values), where=kept)
    along = pm.vecmat(pulls, axes) * inverse
    return np.asarray(pm.matvec(axes, along)), kept.sum(axis=1)


def _flip_along(faces: IntArray, is_sharp: BoolArray, positions: FloatArray) -> IntArray:
    """Flip edges between two faces whose opposite corners lie on a sharp edge, once per face."""
    tails, heads = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    opposite = opposite_half_edges(faces)
    one = np.flatnonzero(np.arange(len(opposite)) < opposite)
    other = opposite[one]
    across = [faces[e // 3, (e % 3 + 2) % 3] for e in (one, other)]
    wanted = is_sharp[across[0]] & is_sharp[across[1]]
    wanted &= ~(is_sharp[tails[one]] & is_sharp[heads[one]])
    a, b = (ids[wanted] for ids in across)
    c, d = tails[one[wanted]], heads[one[wanted]]
    known = np.sort(tails.astype(np.int64) * len(positions) + heads)
    joined = a.astype(np.int64) * len(positions) + b
    at = np.minimum(np.searchsorted(known, joined), len(known) - 1)
    halves = np.stack([np.stack([a, b, d], 1), np.stack([b, a, c], 1)], axis=1)
    sides = one[wanted] // 3, other[wanted] // 3
    upright = area_vectors(positions, faces[sides[0]]) + area_vectors(positions, faces[sides[1]])
    crosses = area_vectors(positions, halves)
    fits = _face_along(upright, crosses)
    fits &= (pm.norm(crosses, axis=2) > _SLIVER).all(axis=1)
    fits &= known[at] != joined
    flipped = faces.copy()
    taken: set[int | tuple[int, int]] = set()
    for k in np.flatnonzero(fits):
        pair = int(sides[0][k]), int(sides[1][k])
        link = int(min(a[k], b[k])), int(max(a[k], b[k]))
        if taken.isdisjoint((*pair, link)):
            taken.update((*pair, link))
            flipped[list(pair)] = halves[k]
    return flipped


def _face_along(upright: FloatArray, crosses: FloatArray) -> BoolArray:
    """(n,) bool: whether both of two faces, by their normals (n, 2, 3), face along a vector."""
    lengths = pm.norm(crosses, axis=2) * pm.norm(upright, axis=1)[:, None]
    cosines = pm.matvec(crosses, upright)
    return np.asarray((cosines > _UPRIGHT * lengths).all(axis=1))
