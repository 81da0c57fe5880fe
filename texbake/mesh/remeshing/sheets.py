"""An open surface remeshed as one sheet.

All grid points near the surface that lie behind it are solid, so that the solid is a thick shell
whose front is the surface. Of the net around the solid, the quads stay whose grid edges pass
through the surface: the distances of the ends of such an edge add up to its length at most, and
beyond the boundary of the surface they add up to more. Vertices at the boundary move onto the
old one.

Based on: J. Andreas Bærentzen, Henrik Aanæs, "Signed Distance Computation Using the Angle Weighted
Pseudonormal", IEEE Transactions on Visualization and Computer Graphics 11(3), 2005 (the side).
"""

from __future__ import annotations

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import MeshError
from texbake.mesh.compose import used_rows
from texbake.mesh.distance import face_areas, unit_normals
from texbake.mesh.mesh import (
    BoolArray,
    ByteArray,
    FloatArray,
    IndexArray,
    Int64Array,
    IntArray,
    Mesh,
)
from texbake.mesh.normals import smooth_normals
from texbake.mesh.remeshing.band import (
    BAND_WIDTH,
    BLOCK_POINTS,
    BLOCK_SIDE,
    OUTSIDE,
    SHELL_DEPTH,
    Band,
    Grid,
)
from texbake.mesh.remeshing.boundary import Filled, Loops, count_loops, oriented, with_own_fans
from texbake.mesh.remeshing.projection import project, without_folds
from texbake.mesh.remeshing.solid import Nets, nets_of, signed
from texbake.mesh.topology import edge_keys, face_components, find_edges, opposite_half_edges
from texbake.mesh.triangle_tree import TriangleTree

# Rounds in which sheets are remeshed, and how many parts are assigned to one by their boxes.
_ROUNDS, _MOST_PARTS = 12, 2048
# Share of a wrap's vertices around sheets from which on its handles may be holes that pierce it.
PIERCED = 0.05
# How far the distances of the ends of a grid edge may add up to more than its length, in voxels.
_SLACK = 1e-3
# How far vertices at the boundary move along it, in voxels.
_LONGEST_STEP = 2.0
# Those farther from the old one are held back; they are moved again while they come closer.
_HELD_BACK, _CLOSER = 0.5, 0.75
# Parts of less area, in voxels, are left out.
_LEAST_AREA = 12.0
# Parts cut off at thin necks are left out up to this share of the area, together.
_CUT_OFF = 0.01
# Holes whose vertices are, on average, farther from the old boundary are the grid's. Of those along
# one old boundary, such as notches whose mouths close, all but one are, up to a width.
_OFF_RIM, _NOTCH = 1.5, 12.0
# Weights of corners below this are 0 but for rounding.
_ZERO = 1e-9


def build_sheet(band: Band, tree: TriangleTree, *, threads: int | None = None) -> Nets:
    """Build the net of an open surface, with a staircase of quads as its boundary."""
    field = band.distances.copy()
    near = np.flatnonzero(field < BAND_WIDTH)
    field.ravel()[near[_is_behind(band, near, tree, threads)]] *= -1.0
    labels = np.full(band.shape, OUTSIDE, dtype=np.uint8)
    nets = nets_of(band, field, labels, np.zeros(field.shape, dtype=np.bool_), threads=threads)
    cells = np.floor(nets.positions).astype(np.int32)[nets.quads]
    ends = cells.max(axis=1), cells.max(axis=1)
    # The four cells around a grid edge differ along the two other axes.
    ends[1][(np.ptp(cells, axis=1) == 0)] += 1
    distances = [_at(band, end) for end in ends]
    kept = nets.quads[distances[0] + distances[1] <= 1.0 + _SLACK]
    used, quads = used_rows(kept, len(nets.positions))
    return Nets(nets.positions[used], nets.thin[used], quads)


def _at(band: Band, points: IntArray) -> FloatArray:
    """Distances at grid points (n, 3) of the band."""
    blocks = band.slots[tuple((points // BLOCK_SIDE).T)]
    x, y, z = (points % BLOCK_SIDE).T
    distances = band.distances[blocks, x << 6 | y << 3 | z]
    return np.asarray(distances, dtype=np.float64)


def build_body(
    band: Band,
    labels: ByteArray,
    points: FloatArray,
    filled: Filled,
    whole: IntArray | None,
    *,
    threads: int | None = None,
) -> Nets:
    """Build the net of a body that is pierced nowhere, solid along the surface if handles are left.

    `points` (V, 3) float64; `whole` (F, 3) int32: a body of one part, with what fills its holes.
    """
    field, thin = signed(band, labels, threads)
    nets = nets_of(band, field, labels, thin, threads=threads)
    is_thin = filled.n_holes > 0 or float(nets.thin.mean()) > PIERCED
    if not is_thin or whole is None or nets.n_handles <= count_loops(whole) // 2:
        return nets
    field, thin = signed(band, labels, threads)  # again: making the net manifold changes it
    near = np.flatnonzero((band.distances < SHELL_DEPTH) & (field > 0.0))
    if filled.n_holes > 0:
        fills = TriangleTree.build(points, filled.faces[filled.n_given :], threads=threads)
        places = _grid_points(band, near)
        near = near[fills.closest_points(places, max_distance=BAND_WIDTH, threads=threads)[1] >= 0]
    field.ravel()[near] = band.distances.ravel()[near] - SHELL_DEPTH
    thick = nets_of(band, field, labels, thin, threads=threads)
    return thick if thick.n_handles < nets.n_handles else nets


def _grid_points(band: Band, near: IndexArray) -> FloatArray:
    """Points of the band by their places in its flat arrays."""
    slots, places = near // BLOCK_POINTS, near % BLOCK_POINTS
    steps = np.stack([places >> 6, places >> 3 & 7, places & 7], axis=1)
    return (band.corners[slots] + steps).astype(np.float64)


def _is_behind(band: Band, near: IndexArray, tree: TriangleTree, threads: int | None) -> BoolArray:
    """(n,) bool: grid points behind the closest points of the surface, by the normals there."""
    points = _grid_points(band, near)
    limit = 2.0 * BAND_WIDTH
    _, face_ids, weights = tree.closest_points(points, max_distance=limit, threads=threads)
    corners = tree.positions[tree.faces]
    normals = unit_normals(tree.positions, tree.faces)
    opposite = opposite_half_edges(tree.faces)
    across = np.where(opposite[:, None] < 0, 0.0, normals[opposite // 3]).reshape(-1, 3, 3)
    at_vertices = smooth_normals(Mesh(positions=tree.positions, faces=tree.faces), threads=threads)
    n_zero = (weights < _ZERO).sum(axis=1)
    chosen = normals[face_ids]
    rows = np.flatnonzero(n_zero == 1)
    # The edge from corner k to the next lies across from the corner before k.
    edges = (weights[rows].argmin(axis=1) + 1) % 3
    chosen[rows] += across[face_ids[rows], edges]
    rows = np.flatnonzero(n_zero == 2)
    chosen[rows] = at_vertices[tree.faces[face_ids[rows], weights[rows].argmax(axis=1)]]
    offsets = points - pm.vecmat(weights, corners[face_ids])
    return np.asarray((offsets * chosen).sum(axis=1) < 0.0)


def remesh_sheets(
    points: FloatArray,
    filled: Filled,
    grid: Grid,
    *,
    sharp_edges: bool = False,
    threads: int | None = None,
) -> tuple[FloatArray, IntArray, int]:
    """Remesh an open surface, in voxels; sheets whose boxes meet one after the other."""
    parts, n_parts = face_components(filled.faces, len(points))
    rounds = _rounds(points, filled.faces, parts, n_parts)[parts]
    of_vertex = np.zeros(len(points), dtype=np.int64)
    of_vertex[filled.faces] = rounds[:, None]
    all_points, all_faces, n_points = [], [], 0
    for number in range(int(rounds.max()) + 1):
        chosen = rounds == number
        sheet_faces = np.ascontiguousarray(filled.faces[chosen])
        band = Band.around(points, sheet_faces, grid, threads=threads)
        tree = TriangleTree.build(points, sheet_faces, threads=threads)
        nets = build_sheet(band, tree, threads=threads)
        if len(nets.quads) == 0:
            continue
        moved, faces = project(
            nets,
            tree,
            sharp_edges=sharp_edges,
            smooth=None if filled.smooth is None else filled.smooth[chosen],
            threads=threads,
        )
        edges = filled.rim[of_vertex[filled.rim[:, 0]] == number]
        rim = None
        if len(edges):  # as triangles without area
            rim = TriangleTree.build(points, edges[:, [0, 1, 1]], threads=threads)
        n_given = face_components(sheet_faces, len(points))[1]
        moved, faces = _cleaned(moved, faces, n_given, rim, threads)
        if rim is not None:
            moved = _onto_rim(moved, faces, rim, threads)
            faces = _without_notches(moved, faces, rim, threads)
        all_points.append(moved)
        all_faces.append(faces + n_points)
        n_points += len(moved)
    if not all_faces or not face_areas(points, filled.faces, threads=threads).any():
        raise MeshError(
            f"{grid.name}: its sheets are smaller than the voxels; use a greater `resolution`"
        )
    joined = np.concatenate(all_faces).astype(np.int32)
    n_lost = max(n_parts - face_components(joined, n_points)[1], 0)
    return np.concatenate(all_points), joined, n_lost


def _rounds(points: FloatArray, faces: IntArray, parts: IntArray, n_parts: int) -> Int64Array:
    """(n,) round for each part: boxes of one round are apart, but for the last one."""
    low, high = np.full((n_parts, 3), np.inf), np.full((n_parts, 3), -np.inf)
    np.minimum.at(low, parts, points[faces].min(axis=1) - BAND_WIDTH)
    np.maximum.at(high, parts, points[faces].max(axis=1) + BAND_WIDTH)
    rounds = np.full(n_parts, _ROUNDS - 1)
    for part in np.argsort(-np.prod(high - low, axis=1), kind="stable")[:_MOST_PARTS]:
        near = ((low[part] < high) & (low < high[part])).all(axis=1) & (rounds < _ROUNDS - 1)
        free = np.flatnonzero(np.bincount(rounds[near], minlength=_ROUNDS) == 0)
        rounds[part] = free[0]
    return np.unique(rounds, return_inverse=True)[1]


def largest_sheets(
    points: FloatArray, faces: IntArray, n_kept: int | None
) -> tuple[FloatArray, IntArray, int]:
    """Keep the separate parts of most area, None for all; also count the others."""
    parts, n_parts = face_components(faces, len(points))
    if n_kept is None or n_parts <= n_kept:
        return points, faces, 0
    areas = np.bincount(parts, face_areas(points, faces), n_parts)
    kept = np.isin(parts, np.argsort(-areas, kind="stable")[:n_kept])
    return *with_own_fans(points, faces[kept]), n_parts - n_kept


def _cleaned(
    points: FloatArray, faces: IntArray, n_given: int, rim: TriangleTree | None, threads: int | None
) -> tuple[FloatArray, IntArray]:
    """Leave out parts that the grid cut off beyond `n_given`, and fill holes that it made."""
    faces = _without_pinches(points, faces)
    parts, n_parts = face_components(faces, len(points))
    areas = np.bincount(parts, face_areas(points, faces), n_parts)
    is_crumb = areas < min(_LEAST_AREA, areas.max())
    more_than_given = np.argsort(-areas, kind="stable")[n_given:]
    if areas[more_than_given].sum() < _CUT_OFF * areas.sum():
        is_crumb[more_than_given] = True
    faces = faces[~is_crumb[parts]]
    loops = Loops.of(points, faces)
    points, more = loops.fanned(points, _made_by_grid(loops, points, rim, threads))
    faces = oriented(points, np.concatenate([faces, more]))
    return with_own_fans(points, faces)


def _without_pinches(points: FloatArray, faces: IntArray) -> IntArray:
    """Leave out faces where a vertex has more than one fan of them, until it has one."""
    while True:
        fans = with_own_fans(points, faces)[1].ravel()
        n_faces = np.bincount(fans)
        order = np.lexsort((fans, -n_faces[fans], faces.ravel()))
        first = np.flatnonzero(np.diff(faces.ravel()[order], prepend=-1))
        largest = np.zeros(len(n_faces), dtype=np.bool_)
        largest[fans[order[first]]] = True
        whole = largest[fans].reshape(-1, 3).all(axis=1)
        if whole.all():
            return faces
        faces = faces[whole]


def _made_by_grid(
    loops: Loops, points: FloatArray, rim: TriangleTree | None, threads: int | None
) -> BoolArray:
    """(m,) bool: loops that lie away from the rim, or that divide what is one hole of the mesh."""
    if rim is None or len(loops.sizes) == 0:
        return np.ones(len(loops.sizes), dtype=np.bool_)
    distances, lines, _ = rim.closest_points(points[loops.vertices], threads=threads)
    starts = np.cumsum(loops.sizes) - loops.sizes
    is_off = np.add.reduceat(distances, starts) / loops.sizes > _OFF_RIM
    holes = face_components(rim.faces, len(rim.positions))[0][lines[starts]]
    order = np.lexsort((-loops.lengths, is_off, holes))
    is_more = np.ones(len(order), dtype=np.bool_)
    is_more[order[np.flatnonzero(np.diff(holes[order], prepend=-1))]] = False
    return np.asarray(is_off | is_more & ~loops.outer & (loops.widths < _NOTCH))


def _onto_rim(
    points: FloatArray, faces: IntArray, rim: TriangleTree, threads: int | None
) -> FloatArray:
    """Move the boundary of a sheet onto that of the mesh, as far as no face folds."""
    edges = find_edges(faces)
    ids = np.unique(edges.vertices[edges.boundary])
    is_sharp = np.zeros(len(points), dtype=np.bool_)
    while len(ids) > 0:
        distances, lines, weights = rim.closest_points(
            points[ids], max_distance=_LONGEST_STEP, threads=threads
        )
        near = lines >= 0
        targets = points.copy()
        targets[ids[near]] = pm.vecmat(weights[near], rim.positions[rim.faces[lines[near]]])
        points = without_folds(points, targets, faces, is_sharp, threads)
        left = rim.closest_points(points[ids], threads=threads)[0]
        ids = ids[near & (left > _HELD_BACK) & (left < _CLOSER * distances)]
    return points


def _without_notches(
    points: FloatArray, faces: IntArray, rim: TriangleTree, threads: int | None
) -> IntArray:
    """Fill notches of the boundary, whose vertices folds hold back from that of the mesh."""
    n = len(points)
    while True:
        tails, heads = faces.ravel(), faces[:, [1, 2, 0]].ravel()
        edges = edge_keys(tails, heads)
        is_open = opposite_half_edges(faces) < 0
        tails, heads = tails[is_open], heads[is_open]
        before = np.zeros(n, dtype=np.int32)
        before[heads] = tails
        off = np.zeros(n)
        off[tails] = rim.closest_points(points[tails], threads=threads)[0]
        more = np.stack([heads, tails, before[tails]], axis=1)
        a, held, b = more.T
        is_notch = (off[held] > _HELD_BACK) & (off[held] > np.maximum(off[a], off[b]))
        is_notch &= ~np.isin(edge_keys(a, b), edges)
        if not is_notch.any():
            return faces
        faces = np.concatenate([faces, more[is_notch]])
