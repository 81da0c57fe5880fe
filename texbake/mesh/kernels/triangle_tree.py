"""The closest point of a triangle, and a bounding volume hierarchy that finds the closest triangle.

Vectors are tuples of three numbers.

Based on:
    Christer Ericson, "Real-Time Collision Detection", 2005, section 5.1.5 (the closest point);
    Tero Karras, "Maximizing parallelism in the construction of BVHs, octrees, and k-d trees",
        High-Performance Graphics 2012: triangles in Morton order are split where their highest
        differing bit changes. Triangles with the same code are split in the middle, which bounds
        the depth.

Departs from Ericson, whose products of products lose all their digits on slivers: weights come from
the height over the first edge, and a triangle with next to no area is treated as its three edges.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel

# The square of the sine of the angle at its first corner under which a triangle is taken as its
# three edges: its height is then a hundred roundings of its length, or less.
_SLIVER_SINE_SQUARED = 1e-28


@kernel
def point_at(values, row):  # type: ignore[no-untyped-def]
    """A row of an (n, 3) array."""
    return values[row, 0], values[row, 1], values[row, 2]


@kernel
def minus(a, b):  # type: ignore[no-untyped-def]
    """Difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def dot(a, b):  # type: ignore[no-untyped-def]
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def weighted(a, b, v, w):  # type: ignore[no-untyped-def]
    """Sum of v times a and w times b."""
    return v * a[0] + w * b[0], v * a[1] + w * b[1], v * a[2] + w * b[2]


@kernel
def _along(numerator, denominator):  # type: ignore[no-untyped-def]
    """Where on an edge, from 0 to 1; 0 on an edge without length."""
    return min(max(numerator / denominator, 0.0), 1.0) if denominator > 0.0 else 0.0


@kernel
def closest_on_triangle(ab, ac, ap):  # type: ignore[no-untyped-def]
    """Weights of b and c at the point closest to p, and its squared distance.

    Takes the edges from a to b and to c, and the vector from a to p. The weights are in [0, 1] and
    so is their sum, to rounding; that of a is what they leave of 1.
    """
    ab_ab, ab_ac, ac_ac = dot(ab, ab), dot(ab, ac), dot(ac, ac)
    ab_ap, ac_ap = dot(ab, ap), dot(ac, ap)
    v, w, sliver = 0.0, 0.0, True
    if ab_ab > 0.0:
        height = minus(ac, weighted(ab, ab, ab_ac / ab_ab, 0.0))
        # Twice, because on a needle the first leaves rounding that is not small beside the height.
        height = minus(height, weighted(ab, ab, dot(ab, height) / ab_ab, 0.0))
        height_squared = dot(height, height)
        if height_squared > _SLIVER_SINE_SQUARED * ac_ac:
            sliver = False
            w = dot(height, ap) / height_squared
            v = (ab_ap - w * ab_ac) / ab_ab
            if v > 0.0 and w > 0.0 and v + w < 1.0:
                offset = minus(ap, weighted(ab, ac, v, w))
                return v, w, dot(offset, offset)
    # The closest point lies on an edge that p is beyond.
    best, best_v, best_w = np.inf, 0.0, 0.0
    for edge in range(3):
        if edge == 0 and (sliver or w <= 0.0):
            edge_v, edge_w = _along(ab_ap, ab_ab), 0.0
        elif edge == 1 and (sliver or v <= 0.0):
            edge_v, edge_w = 0.0, _along(ac_ap, ac_ac)
        elif edge == 2 and (sliver or v + w >= 1.0):
            bc = minus(ac, ab)
            edge_w = _along(dot(bc, minus(ap, ab)), dot(bc, bc))
            edge_v = 1.0 - edge_w
        else:
            continue
        offset = minus(ap, weighted(ab, ac, edge_v, edge_w))
        squared = dot(offset, offset)
        if squared < best:
            best, best_v, best_w = squared, edge_v, edge_w
    return best_v, best_w, best


_LEAF_SIZE = 4

# Levels: one for each of the 63 bits that triangles are split by at most, one for each halving of
# the 2^31 triangles at most of one code. The stack holds one node a level, and two at the last.
STACK_SIZE = 63 + 31 + 2


@kernel
def morton_kernel(positions, faces, low, cells_a_unit, axis_bits, id_bits, start, stop, keys):  # type: ignore[no-untyped-def]
    """Write keys of faces start to stop - 1: the Morton code of their center, then their id."""
    for face in range(start, stop):
        code = np.uint64(0)
        for axis in range(3):
            first = positions[faces[face, 0], axis]
            least, most = first, first
            for corner in range(1, 3):
                value = positions[faces[face, corner], axis]
                least, most = min(least, value), max(most, value)
            cell = np.uint64((0.5 * least + 0.5 * most - low[axis]) * cells_a_unit)
            for bit in range(axis_bits):
                code |= ((cell >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
        keys[face] = (code << np.uint64(id_bits)) | np.uint64(face)


@kernel
def build_kernel(positions, faces, ids, codes, boxes, nodes):  # type: ignore[no-untyped-def]
    """Split ranges of the order from the top, then join boxes from the bottom; number of nodes."""
    nodes[0, 0], nodes[0, 1] = 0, len(ids)
    n_nodes, node = 1, 0
    while node < n_nodes:
        first, count = nodes[node, 0], nodes[node, 1]
        if count > _LEAF_SIZE:
            last = first + count - 1
            split = first + count // 2
            differing = codes[first] ^ codes[last]
            if differing != 0:
                bit = np.uint64(1)
                while differing > np.uint64(1):
                    differing >>= np.uint64(1)
                    bit <<= np.uint64(1)
                below, split = first, last  # the first code with the bit lies in (below, split]
                while split - below > 1:
                    middle = (below + split) // 2
                    if codes[middle] & bit:
                        split = middle
                    else:
                        below = middle
            nodes[n_nodes, 0], nodes[n_nodes, 1] = first, split - first
            nodes[n_nodes + 1, 0], nodes[n_nodes + 1, 1] = split, first + count - split
            nodes[node, 0], nodes[node, 1] = n_nodes, 0
            n_nodes += 2
        node += 1
    for node in range(n_nodes - 1, -1, -1):  # children come after their parent
        first, count = nodes[node, 0], nodes[node, 1]
        for axis in range(3):
            if count == 0:
                boxes[node, axis] = min(boxes[first, axis], boxes[first + 1, axis])
                boxes[node, axis + 3] = max(boxes[first, axis + 3], boxes[first + 1, axis + 3])
                continue
            least, most = np.inf, -np.inf
            for slot in range(first, first + count):
                for corner in range(3):
                    value = positions[faces[ids[slot], corner], axis]
                    least, most = min(least, value), max(most, value)
            boxes[node, axis] = np.nextafter(np.float32(least), np.float32(-np.inf))
            boxes[node, axis + 3] = np.nextafter(np.float32(most), np.float32(np.inf))
    return n_nodes


@kernel
def _box_distance_squared(boxes, node, p):  # type: ignore[no-untyped-def]
    dx = max(boxes[node, 0] - p[0], 0.0, p[0] - boxes[node, 3])
    dy = max(boxes[node, 1] - p[1], 0.0, p[1] - boxes[node, 4])
    dz = max(boxes[node, 2] - p[2], 0.0, p[2] - boxes[node, 5])
    return dx * dx + dy * dy + dz * dz


@kernel
def closest_points_kernel(  # type: ignore[no-untyped-def]
    tree, points, max_distance, start, stop, distances, face_ids, barycentrics
):
    """Find the closest face to points start to stop - 1; see `TriangleTree.closest_points`."""
    positions, faces, order, boxes, nodes = tree
    stack = np.empty(STACK_SIZE, dtype=np.int32)
    bounds = np.empty(STACK_SIZE)
    limit = max_distance * max_distance
    nearby = point_at(
        positions, faces[order[0], 0]
    )  # a point of the surface, close to the last answer
    for k in range(start, stop):
        p = point_at(points, k)
        offset = minus(p, nearby)
        best, best_face, best_v, best_w = min(limit, dot(offset, offset)), -1, 0.0, 0.0
        while True:
            stack[0], bounds[0], size = 0, 0.0, 1
            while size > 0:
                size -= 1
                node = stack[size]
                if bounds[size] > best:
                    continue
                first, count = nodes[node, 0], nodes[node, 1]
                for slot in range(first, first + count):
                    face = order[slot]
                    a = point_at(positions, faces[face, 0])
                    ab = minus(point_at(positions, faces[face, 1]), a)
                    ac = minus(point_at(positions, faces[face, 2]), a)
                    v, w, squared = closest_on_triangle(ab, ac, minus(p, a))
                    if squared < best or (squared == best and best_face < 0):
                        best, best_face, best_v, best_w = squared, face, v, w
                if count == 0:
                    near = _box_distance_squared(boxes, first, p)
                    far = _box_distance_squared(boxes, first + 1, p)
                    swapped = np.int32(near > far)
                    stack[size], bounds[size] = first + 1 - swapped, max(near, far)
                    stack[size + 1], bounds[size + 1] = first + swapped, min(near, far)
                    size += 2
            if best_face >= 0 or best >= limit:
                break
            best = limit  # rounding put the point nearby out of its own reach
        face_ids[k] = best_face
        if best_face < 0:
            distances[k] = np.inf
            barycentrics[k, :] = 0.0
            continue
        distances[k] = math.sqrt(best)
        barycentrics[k, 0] = max(1.0 - best_v - best_w, 0.0)
        barycentrics[k, 1], barycentrics[k, 2] = best_v, best_w
        a = point_at(positions, faces[best_face, 0])
        ab = minus(point_at(positions, faces[best_face, 1]), a)
        ac = minus(point_at(positions, faces[best_face, 2]), a)
        on_face = weighted(ab, ac, best_v, best_w)
        nearby = (a[0] + on_face[0], a[1] + on_face[1], a[2] + on_face[2])
