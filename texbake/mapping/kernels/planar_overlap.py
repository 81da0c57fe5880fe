"""Kernels that decide whether triangles in the plane overlap, or a boundary crosses itself.

Two triangles do not overlap if the line through an edge of one of them separates them. Which pairs
to test comes from a tree of bounding boxes for triangles, and from a grid for boundary edges.

Based on: Gottschalk, Lin, Manocha, "OBBTree", 1996 (the separating axis theorem); Kamel, Faloutsos,
"On Packing R-trees", 1993; Lipman, "Bijective Mappings of Meshes with Boundary and the Degree in
Mesh Processing", 2014 (why the boundary is enough where no triangle is flipped).
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel

FAN_OUT = 8  # children of a box

# Borders count as touching, not overlapping, up to this share of the longer side of the layout.
TOUCH_DEPTH = 2.0**-21

APART, TOUCHING, CROSSING = 0, 1, 2


@kernel
def overlap_kernel(  # type: ignore[no-untyped-def]
    corners, lines, order, boxes, children, depth, layered, most, places, found, unsure, layers
):
    """Find the faces that overlap others, for the faces at some places of the order.

    Without `layered`, one overlap is enough. With it, every overlapping face of a lower number is
    found, and the face takes the lowest layer that those leave free. The test of two triangles is
    written inline, since a call with arrays would cost more than the test.
    """
    stack = np.empty(FAN_OUT * 64, dtype=np.int64)
    # For each layer, the last face that found it taken.
    taken = np.full(len(corners) + 1 if layered else 0, -1, dtype=np.int64)
    for place in places:
        face = order[place]
        left, low = boxes[place, 0] + depth, boxes[place, 1] + depth
        right, high = boxes[place, 3] - depth, boxes[place, 4] - depth
        chart = boxes[place, 2]
        stack[0] = len(boxes) - 1
        n_waiting, n_pairs = 1, 0
        while n_waiting > 0:
            n_waiting -= 1
            row = stack[n_waiting]
            for child in range(children[row, 0], children[row, 1]):
                if (
                    boxes[child, 0] < right
                    and boxes[child, 3] > left
                    and boxes[child, 1] < high
                    and boxes[child, 4] > low
                    and boxes[child, 2] <= chart
                    and boxes[child, 5] >= chart
                ):
                    stack[n_waiting] = child
                    n_waiting += 1
            if row >= len(order) or row == place or (layered and order[row] > face):
                continue
            if n_pairs == most:
                unsure[face] = True
                break
            n_pairs += 1
            parted = False
            one, other = face, order[row]
            for edge in range(6):
                if edge == 3:
                    one, other = other, one
                a, b, c = lines[one, edge % 3, 0], lines[one, edge % 3, 1], lines[one, edge % 3, 2]
                if (
                    a * corners[other, 0, 0] + b * corners[other, 0, 1] + c <= depth
                    and a * corners[other, 1, 0] + b * corners[other, 1, 1] + c <= depth
                    and a * corners[other, 2, 0] + b * corners[other, 2, 1] + c <= depth
                ):
                    parted = True
                    break
            if parted:
                continue
            found[face] = True
            if not layered:
                break
            taken[layers[order[row]]] = face
        while layered and taken[layers[face]] == face:
            layers[face] += 1


@kernel
def boundary_meeting(uvs, boundary, loops):  # type: ignore[no-untyped-def]
    """Return whether the edges of a boundary are APART, TOUCHING or CROSSING.

    Common vertices do not count. A boundary with two counter-clockwise loops counts as crossing.

    Parameters
    ----------
    uvs : (n, 2) float64
    boundary : (b, 2) int32
    loops : (b,) int32
        `boundary_loops` of a `Patch`.
    """
    # Each edge is compared with earlier edges that share a cell of a grid with it.
    n_edges, n_loops = len(boundary), 1
    low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
    for edge in range(n_edges):
        x, y = uvs[boundary[edge, 0], 0], uvs[boundary[edge, 0], 1]
        low_x, low_y = min(low_x, x), min(low_y, y)
        high_x, high_y = max(high_x, x), max(high_y, y)
        n_loops = max(n_loops, loops[edge] + 1)
    extent = max(high_x - low_x, high_y - low_y)
    if not extent > 0.0:
        return TOUCHING
    n_cells = max(1, min(int(2.0 * math.sqrt(n_edges)), 1024))
    if _n_enclosing(uvs, boundary, loops, n_loops) > 1:
        return CROSSING
    scale, depth = n_cells / extent, TOUCH_DEPTH * extent
    heads = np.full(n_cells * n_cells, -1, dtype=np.int64)
    boxes = np.empty((n_edges, 4), dtype=np.int64)  # first column and row, last column and row
    n_links = 0
    for edge in range(n_edges):
        i, j = boundary[edge, 0], boundary[edge, 1]
        for axis, low in ((0, low_x), (1, low_y)):
            first, last = min(uvs[i, axis], uvs[j, axis]), max(uvs[i, axis], uvs[j, axis])
            boxes[edge, axis] = min(int((first - low) * scale), n_cells - 1)
            boxes[edge, 2 + axis] = min(int((last - low) * scale), n_cells - 1)
        n_links += (boxes[edge, 2] - boxes[edge, 0] + 1) * (boxes[edge, 3] - boxes[edge, 1] + 1)
    links = np.empty((n_links, 2), dtype=np.int64)  # (edge, next link)
    n_links = 0
    meeting = APART
    for edge in range(n_edges):
        i, j = boundary[edge, 0], boundary[edge, 1]
        for row in range(boxes[edge, 1], boxes[edge, 3] + 1):
            for cell in range(row * n_cells + boxes[edge, 0], row * n_cells + boxes[edge, 2] + 1):
                link = heads[cell]
                links[n_links, 0], links[n_links, 1] = edge, link
                heads[cell] = n_links
                n_links += 1
                while link >= 0:
                    other, link = links[link, 0], links[link, 1]
                    if other != edge:
                        met = _meeting(uvs, i, j, boundary[other, 0], boundary[other, 1], depth)
                        if met == CROSSING:
                            return CROSSING
                        meeting = max(meeting, met)
    return meeting


@kernel
def _n_enclosing(uvs, boundary, loops, n_loops):  # type: ignore[no-untyped-def]
    """Count the loops that run counter-clockwise."""
    areas = np.zeros(n_loops)
    origin = boundary[0, 0]
    for edge in range(len(boundary)):
        i, j = boundary[edge, 0], boundary[edge, 1]
        ax, ay = uvs[i, 0] - uvs[origin, 0], uvs[i, 1] - uvs[origin, 1]
        bx, by = uvs[j, 0] - uvs[origin, 0], uvs[j, 1] - uvs[origin, 1]
        areas[loops[edge]] += ax * by - ay * bx
    n_enclosing = 0
    for loop in range(n_loops):
        n_enclosing += areas[loop] > 0.0
    return n_enclosing


@kernel
def _meeting(uvs, p, q, r, s, depth):  # type: ignore[no-untyped-def]
    """How the edges pq and rs meet, which share at most one vertex."""
    if max(uvs[p, 0], uvs[q, 0]) < min(uvs[r, 0], uvs[s, 0]) - depth:
        return APART
    if max(uvs[r, 0], uvs[s, 0]) < min(uvs[p, 0], uvs[q, 0]) - depth:
        return APART
    if max(uvs[p, 1], uvs[q, 1]) < min(uvs[r, 1], uvs[s, 1]) - depth:
        return APART
    if max(uvs[r, 1], uvs[s, 1]) < min(uvs[p, 1], uvs[q, 1]) - depth:
        return APART
    if p in (r, s) or q in (r, s):
        # They leave the common vertex in different directions, or one lies on the other.
        common = p if p in (r, s) else q
        one, two = (q if common == p else p), (s if common == r else r)
        ax, ay = uvs[one, 0] - uvs[common, 0], uvs[one, 1] - uvs[common, 1]
        bx, by = uvs[two, 0] - uvs[common, 0], uvs[two, 1] - uvs[common, 1]
        longest = math.sqrt(max(ax * ax + ay * ay, bx * bx + by * by))
        on = ax * bx + ay * by > 0.0 and abs(ax * by - ay * bx) <= depth * longest
        return TOUCHING if on else APART
    first_r, first_s = _distance(uvs, p, q, r), _distance(uvs, p, q, s)
    if min(first_r, first_s) > depth or max(first_r, first_s) < -depth:
        return APART
    second_p, second_q = _distance(uvs, r, s, p), _distance(uvs, r, s, q)
    if min(second_p, second_q) > depth or max(second_p, second_q) < -depth:
        return APART
    least = min(min(abs(first_r), abs(first_s)), min(abs(second_p), abs(second_q)))
    return CROSSING if least > depth else TOUCHING


@kernel
def _distance(uvs, p, q, r):  # type: ignore[no-untyped-def]
    """Signed distance of r from the line through p and q; 0 where p and q coincide."""
    x, y = uvs[q, 0] - uvs[p, 0], uvs[q, 1] - uvs[p, 1]
    length = math.sqrt(x * x + y * y)
    area = x * (uvs[r, 1] - uvs[p, 1]) - y * (uvs[r, 0] - uvs[p, 0])
    return area / length if length > 0.0 else 0.0
