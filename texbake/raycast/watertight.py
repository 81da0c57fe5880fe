"""Watertight intersection of rays and triangles: kernels that test triangles against a ray tree.

A ray passes each edge of a triangle on the side that the exact sign of a float64 determinant gives.
Triangles that share an edge agree on that sign, so one of them is hit.

Based on: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", Journal of Computer Graphics
Techniques 2(1), 2013. Departs from it by working in float64, with exact products where rounding
could change a sign.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel

# Cells along each axis of the local frame. Cells that contain a piece of a ray are marked; most
# triangles touch no marked cell and need no further test.
CELLS = 64


@kernel
def curve_kernel(lines, n_pieces, keys):  # type: ignore[no-untyped-def]
    """Position of each piece's middle on a Morton curve, so that neighbors share a branch."""
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
def boxes_kernel(lines, n_pieces, order, boxes):  # type: ignore[no-untyped-def]
    """Bounding boxes of the leaves, in the order of the pieces, then of the nodes above them."""
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
    """Cell of a coordinate of the local frame; the outermost cells extend to infinity."""
    return int(min(max((coordinate + 0.5) * CELLS, 0.0), CELLS - 1.0))


@kernel
def mark_kernel(boxes, marked):  # type: ignore[no-untyped-def]
    """Mark the cells that overlap any of the boxes."""
    for i in range(len(boxes)):
        box = boxes[i]
        for x in range(_cell_kernel(box[0]), _cell_kernel(box[3]) + 1):
            for y in range(_cell_kernel(box[1]), _cell_kernel(box[4]) + 1):
                for z in range(_cell_kernel(box[2]), _cell_kernel(box[5]) + 1):
                    marked[x, y, z] = True


@kernel
def _is_marked_kernel(box, marked):  # type: ignore[no-untyped-def]
    """Whether a box overlaps a marked cell."""
    for x in range(_cell_kernel(box[0]), _cell_kernel(box[3]) + 1):
        for y in range(_cell_kernel(box[1]), _cell_kernel(box[4]) + 1):
            for z in range(_cell_kernel(box[2]), _cell_kernel(box[5]) + 1):
                if marked[x, y, z]:
                    return True
    return False


@kernel
def retry_kernel(triangles, band, lines, axes, tree, marked, cull, results):  # type: ignore[no-untyped-def]
    """Test triangles band[0] to band[1] against the rays near them; keep each ray's nearest hit."""
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
    """Return distance, weights of the second and third corner, and facing (> 0: the front).

    `z` is the axis along which the direction is greatest. A miss has distance -1.
    """
    origins, directions, _ = lines
    x, y = (z + 1) % 3, (z + 2) % 3
    if directions[i, z] < 0.0:
        x, y = y, x  # preserves the winding
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
    """Return px qy - py qx with the exact sign."""
    one, two = px * qy, py * qx
    difference = one - two
    # Each product is rounded by 2^-53 of itself: beyond 4 times that the sign is certain.
    if abs(difference) > 4.5e-16 * (abs(one) + abs(two)):
        return difference
    return difference + (_product_error(px, qy, one) - _product_error(py, qx, two))


@kernel
def _product_error(a, b, product):  # type: ignore[no-untyped-def]
    """Return a b - product, exactly (Dekker 1971)."""
    split_a, split_b = 134217729.0 * a, 134217729.0 * b
    a_high, b_high = split_a - (split_a - a), split_b - (split_b - b)
    a_low, b_low = a - a_high, b - b_high
    return ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low
