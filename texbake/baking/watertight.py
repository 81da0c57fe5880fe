"""A second, exact look for rays that hit nothing: no ray slips between two triangles that touch.

Embree's robust mode still lets rays through that are aimed at a vertex. The few rays that missed
are put into a small tree of boxes, and every triangle of the dense mesh is held against it, so that
no second ray tree over the dense mesh is needed. The test of one ray against one triangle decides
on which side of each edge the ray passes with the exact sign of a float64 determinant: triangles
that share an edge agree on it, so one of them is hit.

Based on: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", Journal of Computer Graphics
Techniques 2(1), 2013. Departs from it by working in float64, with exact products where rounding
could turn a sign.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.baking.found import Found, refine_kernel
from texbake.baking.hits import NO_HIT
from texbake.baking.rays import Rays
from texbake.kernels import kernel
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.parallel import run_bands

_RAYS_A_TREE = 1 << 15
_MOST_PIECES = 64  # of a ray
_TRIANGLE_BANDS = 16
# Cells along each axis of the local frame, of which those are marked that pieces of rays are in:
# most triangles lie in none, and are done with at once.
_CELLS = 64


def retry_watertight(
    rays: Rays,
    high: Mesh,
    frame: LocalFrame,
    *,
    cull_back_faces: bool,
    threads: int | None = None,
) -> Found:
    """Find the nearest hit of each ray by holding every triangle against every ray near it.

    Takes time in proportion to the triangles, and little for the rays while they are few or meet
    little. The result is that of `Caster.cast`, without its misses at vertices and edges.
    """
    found = Found.nothing(len(rays))
    triangles = (high.positions, high.faces, frame.center, frame.scale)
    for first in range(0, len(rays), _RAYS_A_TREE):
        part = slice(first, first + _RAYS_A_TREE)
        lines = (rays.origins[part], rays.directions[part], rays.lengths[part])
        found.faces[part], found.barycentrics[part], found.distances[part], back = _nearest(
            triangles, lines, cull_back_faces, threads
        )
        # Told by the distances that both come from; refining them moves one by its last bits.
        reach = np.where(found.faces[part] == NO_HIT, lines[2], found.distances[part])
        found.passed_back[part] = back <= reach
        refine_kernel(
            triangles,
            lines,
            (found.faces[part], found.barycentrics[part], found.distances[part]),
        )
    return found


def _nearest(
    triangles: tuple[FloatArray, IntArray, FloatArray, float],
    lines: tuple[FloatArray, FloatArray, FloatArray],
    cull: bool,
    threads: int | None,
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Nearest face, barycentrics and distance of each ray, and its nearest back face's distance."""
    n_rays, n_faces = len(lines[0]), len(triangles[1])
    tree = _tree_over_pieces(lines, typical_edge=1.0 / np.sqrt(n_faces))
    marked = np.zeros((_CELLS, _CELLS, _CELLS), dtype=np.bool_)
    _mark_kernel(tree[0][len(tree[0]) // 2 :][: len(tree[1])], marked)
    axes = np.abs(lines[1]).argmax(axis=1)
    # Each band of triangles has results of its own; the bands do not depend on the threads.
    faces = np.full((_TRIANGLE_BANDS, n_rays), NO_HIT, dtype=np.int32)
    barycentrics = np.zeros((_TRIANGLE_BANDS, n_rays, 2))
    distances = np.full((_TRIANGLE_BANDS, n_rays), np.inf)
    backs = np.full((_TRIANGLE_BANDS, n_rays), np.inf)
    edges = np.linspace(0, n_faces, _TRIANGLE_BANDS + 1).astype(np.int64)

    def hold(start: int, stop: int) -> None:
        for band in range(start, stop):
            results = (faces[band], barycentrics[band], distances[band], backs[band])
            _retry_kernel(
                triangles, edges[band : band + 2], lines, axes, tree, marked, cull, results
            )

    run_bands(hold, _TRIANGLE_BANDS, band=1, threads=threads)
    best = distances.argmin(axis=0)  # the first band, so the lowest face, where several are equal
    chosen = (best, np.arange(n_rays))
    hit = faces[chosen] != NO_HIT
    return (
        faces[chosen],
        barycentrics[chosen],
        np.where(hit, distances[chosen], 0.0),
        backs.min(axis=0),
    )


def _tree_over_pieces(
    lines: tuple[FloatArray, FloatArray, FloatArray], typical_edge: float
) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Boxes of a complete binary tree over pieces of rays, and the ray of each leaf.

    A long ray's box is mostly empty, so rays are cut into pieces of some triangles' size. Node i
    has the children 2 i + 1 and 2 i + 2; leaves beyond the last piece have empty boxes. Boxes are
    (2 * n_leaves - 1, 6): least x, y, z and greatest, grown by rounding's 1e-9 of the local frame.
    """
    lengths = lines[2]
    longest = float(lengths.max(initial=0.0))
    n_pieces = int(np.clip(longest / (8.0 * typical_edge), 1, _MOST_PIECES))
    keys = np.empty(n_pieces * len(lengths), dtype=np.uint64)
    _curve_kernel(lines, n_pieces, keys)
    order = np.argsort(keys, kind="stable")
    n_leaves = 1 << (len(order) - 1).bit_length()
    boxes = np.empty((2 * n_leaves - 1, 6))
    _boxes_kernel(lines, n_pieces, order, boxes)
    return boxes, order // n_pieces


@kernel
def _curve_kernel(lines, n_pieces, keys):  # type: ignore[no-untyped-def]
    """Place of each piece's middle on a Morton curve, so that neighbors share a branch."""
    origins, directions, lengths = lines
    for i in range(len(keys)):
        ray = i // n_pieces
        along = lengths[ray] * (i % n_pieces + 0.5) / n_pieces
        key = np.uint64(0)
        for axis in range(3):
            point = origins[ray, axis] + directions[ray, axis] * along
            cell = np.uint64(min(max((point + 1.0) * 512.0, 0.0), 1023.0))
            for bit in range(10):
                shifted = (cell >> np.uint64(bit)) & np.uint64(1)
                key |= shifted << np.uint64(3 * bit + axis)
        keys[i] = key


@kernel
def _boxes_kernel(lines, n_pieces, order, boxes):  # type: ignore[no-untyped-def]
    """Boxes of the leaves, in the order of the pieces, and then of the nodes over them."""
    origins, directions, lengths = lines
    first_leaf = len(boxes) // 2
    for leaf in range(len(boxes) - first_leaf):
        box = boxes[first_leaf + leaf]
        box[:3], box[3:] = np.inf, -np.inf
        if leaf < len(order):
            ray, piece = order[leaf] // n_pieces, order[leaf] % n_pieces
            for axis in range(3):
                start, step = origins[ray, axis], directions[ray, axis] * lengths[ray] / n_pieces
                one, other = start + step * piece, start + step * (piece + 1)
                box[axis] = min(one, other) - 1e-9
                box[axis + 3] = max(one, other) + 1e-9
    for node in range(first_leaf - 1, -1, -1):
        for axis in range(3):
            boxes[node, axis] = min(boxes[2 * node + 1, axis], boxes[2 * node + 2, axis])
            boxes[node, axis + 3] = max(
                boxes[2 * node + 1, axis + 3], boxes[2 * node + 2, axis + 3]
            )


@kernel
def _cell_kernel(coordinate):  # type: ignore[no-untyped-def]
    """Cell of a coordinate of the local frame; the outermost hold all that lies beyond."""
    return int(min(max((coordinate + 0.5) * _CELLS, 0.0), _CELLS - 1.0))


@kernel
def _mark_kernel(boxes, marked):  # type: ignore[no-untyped-def]
    """Mark the cells that boxes reach into."""
    for i in range(len(boxes)):
        box = boxes[i]
        for x in range(_cell_kernel(box[0]), _cell_kernel(box[3]) + 1):
            for y in range(_cell_kernel(box[1]), _cell_kernel(box[4]) + 1):
                for z in range(_cell_kernel(box[2]), _cell_kernel(box[5]) + 1):
                    marked[x, y, z] = True


@kernel
def _is_marked_kernel(box, marked):  # type: ignore[no-untyped-def]
    """Whether a box reaches into a marked cell."""
    for x in range(_cell_kernel(box[0]), _cell_kernel(box[3]) + 1):
        for y in range(_cell_kernel(box[1]), _cell_kernel(box[4]) + 1):
            for z in range(_cell_kernel(box[2]), _cell_kernel(box[5]) + 1):
                if marked[x, y, z]:
                    return True
    return False


@kernel
def _retry_kernel(triangles, band, lines, axes, tree, marked, cull, results):  # type: ignore[no-untyped-def]
    """Hold triangles band[0] to band[1] against the rays near them; keep each ray's nearest."""
    positions, face_corners, center, scale = triangles
    boxes, piece_rays = tree
    faces, barycentrics, distances, backs = results
    first_leaf = len(boxes) // 2
    corners = np.empty((3, 3))
    box = np.empty(6)
    stack = np.empty(64, dtype=np.int64)
    for face in range(band[0], band[1]):
        for axis in range(3):
            for corner in range(3):
                vertex = face_corners[face, corner]
                corners[corner, axis] = (positions[vertex, axis] - center[axis]) * scale
            box[axis] = min(corners[0, axis], corners[1, axis], corners[2, axis])
            box[axis + 3] = max(corners[0, axis], corners[1, axis], corners[2, axis])
        if not _is_marked_kernel(box, marked):
            continue
        stack[0] = 0
        depth = 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if (
                box[0] > boxes[node, 3]
                or box[3] < boxes[node, 0]
                or box[1] > boxes[node, 4]
                or box[4] < boxes[node, 1]
                or box[2] > boxes[node, 5]
                or box[5] < boxes[node, 2]
            ):
                continue
            if node < first_leaf:
                stack[depth] = 2 * node + 1
                stack[depth + 1] = 2 * node + 2
                depth += 2
                continue
            i = piece_rays[node - first_leaf]
            if lines[2][i] <= 0.0:
                continue
            distance, u, v, facing = _intersect(corners, lines, axes[i], i)
            if not 0.0 <= distance <= lines[2][i]:
                continue
            if facing <= 0.0:
                backs[i] = min(backs[i], distance)
                if cull:
                    continue
            if distance < distances[i]:
                faces[i] = face
                barycentrics[i, 0] = u
                barycentrics[i, 1] = v
                distances[i] = distance


@kernel
def _intersect(corners, lines, z, i):  # type: ignore[no-untyped-def]
    """Distance, barycentrics of the second and third corner, and facing (> 0: the front).

    `z` is the axis in which the ray moves most. A miss has the distance -1.
    """
    origins, directions, _ = lines
    x, y = (z + 1) % 3, (z + 2) % 3
    if directions[i, z] < 0.0:
        x, y = y, x  # keeps the winding
    shear_x = directions[i, x] / directions[i, z]
    shear_y = directions[i, y] / directions[i, z]
    az, bz, cz = (
        corners[0, z] - origins[i, z],
        corners[1, z] - origins[i, z],
        corners[2, z] - origins[i, z],
    )
    ax = corners[0, x] - origins[i, x] - shear_x * az
    ay = corners[0, y] - origins[i, y] - shear_y * az
    bx = corners[1, x] - origins[i, x] - shear_x * bz
    by = corners[1, y] - origins[i, y] - shear_y * bz
    cx = corners[2, x] - origins[i, x] - shear_x * cz
    cy = corners[2, y] - origins[i, y] - shear_y * cz
    u = _cross_sign_exact(cx, cy, bx, by)
    v = _cross_sign_exact(ax, ay, cx, cy)
    w = _cross_sign_exact(bx, by, ax, ay)
    if (u < 0.0 or v < 0.0 or w < 0.0) and (u > 0.0 or v > 0.0 or w > 0.0):
        return -1.0, 0.0, 0.0, 0.0
    total = u + v + w
    if total == 0.0:
        return -1.0, 0.0, 0.0, 0.0
    distance = (u * az + v * bz + w * cz) / (total * directions[i, z])
    return distance, v / total, w / total, total


@kernel
def _cross_sign_exact(px, py, qx, qy):  # type: ignore[no-untyped-def]
    """Return px qy - py qx, with the exact sign."""
    one, two = px * qy, py * qx
    difference = one - two
    # Each product is off by 2^-53 of itself: beyond 4 times that the sign is right already.
    if abs(difference) > 4.5e-16 * (abs(one) + abs(two)):
        return difference
    return difference + (_product_error(px, qy, one) - _product_error(py, qx, two))


@kernel
def _product_error(a, b, product):  # type: ignore[no-untyped-def]
    """Return a b - product without error (Dekker 1971)."""
    split_a, split_b = 134217729.0 * a, 134217729.0 * b
    a_high, b_high = split_a - (split_a - a), split_b - (split_b - b)
    a_low, b_low = a - a_high, b - b_high
    return ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low
