"""Kernels of the checks: triangles that intersect, and orientations joined by union-find.

Based on: Tomas Möller, "A fast triangle-triangle intersection test", Journal of Graphics Tools
2(2), 1997; R. Tarjan, "Efficiency of a good but not linear set union algorithm", 1975.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel
from texbake.mesh.kernels.triangle_tree import STACK_SIZE, dot, minus, point_at


@kernel
def _heights_over_plane(n, corner, a, b, c):  # type: ignore[no-untyped-def]
    """Heights of three points over the plane through a corner."""
    return dot(n, minus(a, corner)), dot(n, minus(b, corner)), dot(n, minus(c, corner))


@kernel
def _cut_by_plane(along, a, b, c, heights):  # type: ignore[no-untyped-def]
    """Ends, along a direction, of what a plane cuts out of a triangle that it passes through."""
    places = dot(along, a), dot(along, b), dot(along, c)
    low, high = np.inf, -np.inf
    for i in range(3):
        j = (i + 1) % 3
        if (heights[i] < 0.0) != (heights[j] < 0.0):
            place = places[i] + (places[j] - places[i]) * (heights[i] / (heights[i] - heights[j]))
            low, high = min(low, place), max(high, place)
    return low, high


@kernel
def crossings_kernel(tree, normals, depth, most, start, stop, others, unsure):  # type: ignore[no-untyped-def]
    """For the faces at places `start` to `stop` in the order of the tree, one that crosses each."""
    positions, faces, order, boxes, nodes = tree
    stack = np.empty(STACK_SIZE, dtype=np.int32)
    for slot in range(start, stop):
        face = order[slot]
        n = point_at(normals, face)
        if dot(n, n) == 0.0:
            continue
        a, b, c = (
            point_at(positions, faces[face, 0]),
            point_at(positions, faces[face, 1]),
            point_at(positions, faces[face, 2]),
        )
        x0, x1 = min(a[0], b[0], c[0]), max(a[0], b[0], c[0])
        y0, y1 = min(a[1], b[1], c[1]), max(a[1], b[1], c[1])
        z0, z1 = min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
        stack[0], size, n_pairs = 0, 1, 0
        while size > 0 and others[face] < 0:
            size -= 1
            node = stack[size]
            if (
                boxes[node, 0] > x1 or boxes[node, 3] < x0
                or boxes[node, 1] > y1 or boxes[node, 4] < y0
                or boxes[node, 2] > z1 or boxes[node, 5] < z0
            ):  # fmt: skip
                continue
            first, count = nodes[node, 0], nodes[node, 1]
            if count == 0:
                stack[size], stack[size + 1] = first, first + 1
                size += 2
                continue
            if n_pairs >= most:
                unsure[face] = True
                break
            n_pairs += count
            for other in order[first : first + count]:
                m = point_at(normals, other)
                if other == face or dot(m, m) == 0.0:
                    continue
                p, q, r = (
                    point_at(positions, faces[other, 0]),
                    point_at(positions, faces[other, 1]),
                    point_at(positions, faces[other, 2]),
                )
                theirs = _heights_over_plane(n, a, p, q, r)
                if min(theirs) >= -depth or max(theirs) <= depth:
                    continue
                ours = _heights_over_plane(m, p, a, b, c)
                if min(ours) >= -depth or max(ours) <= depth:
                    continue
                along = (
                    n[1] * m[2] - n[2] * m[1],
                    n[2] * m[0] - n[0] * m[2],
                    n[0] * m[1] - n[1] * m[0],
                )
                low, high = _cut_by_plane(along, a, b, c, ours)
                their_low, their_high = _cut_by_plane(along, p, q, r, theirs)
                common = min(high, their_high) - max(low, their_low)
                if common > depth * np.sqrt(dot(along, along)):
                    others[face] = other
                    break


@kernel
def orient_kernel(parents, flips, one, other, along):  # type: ignore[no-untyped-def]
    """Join neighbors, each with whether it is wound against its parent; the least is the root."""
    for i in range(len(one)):
        a, b = one[i], other[i]
        differ = along[i]
        while parents[a] != a:
            differ ^= flips[a]
            a = parents[a]
        while parents[b] != b:
            differ ^= flips[b]
            b = parents[b]
        if a < b:
            parents[b], flips[b] = a, differ
        elif b < a:
            parents[a], flips[a] = b, differ
        # Let both lead to the root at once, so that no chain grows long.
        root = min(a, b)
        for start in (one[i], other[i]):
            face, against = start, False
            while parents[face] != face:
                against ^= flips[face]
                face = parents[face]
            face = start
            while parents[face] != root and parents[face] != face:
                up, step = parents[face], flips[face]
                parents[face], flips[face] = root, against
                against ^= step
                face = up
    for face in range(len(parents)):
        # Parents are lower than their children, and so already lead to the root.
        up = parents[face]
        if parents[up] != up:
            flips[face] ^= flips[up]
            parents[face] = parents[up]
