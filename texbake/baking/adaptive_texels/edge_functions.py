"""Which face of the low-poly mesh owns a point of the texture, and how much of a texel is covered.

Coverage is decided with integers on a fixed-point grid, by the edge functions of each face and the
top-left rule, so that neighboring faces own every point exactly once.

Based on: Pineda, "A Parallel Algorithm for Polygon Rasterization", SIGGRAPH 1988.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.pineda import NO_FACE, UNIT
from texbake.kernels import kernel

FINE = 8  # sub-squares along one side of a texel
FULL = FINE * FINE
TEXEL = FINE * UNIT  # units of the fixed-point grid in a texel
BIN = 8  # texels along one side of the squares that share a list of faces
SLACK = 2  # units by which a line is widened, against rounding


@kernel
def owner_at(bins, x, y):  # type: ignore[no-untyped-def]
    """Return the first face that covers a point of the map, `NO_FACE` for none; x, y in units."""
    corners, firsts, faces, n_columns = bins
    place = (y // (BIN * TEXEL)) * n_columns + x // (BIN * TEXEL)
    for i in range(firsts[place], firsts[place + 1]):
        if covers(corners, faces[i], x, y):
            return faces[i]
    return NO_FACE


@kernel
def covers(corners, face, x, y):  # type: ignore[no-untyped-def]
    """Whether a face with an area covers a point, by the top-left rule."""
    ax, ay = corners[face, 0, 0], corners[face, 0, 1]
    bx, by = corners[face, 1, 0], corners[face, 1, 1]
    cx, cy = corners[face, 2, 0], corners[face, 2, 1]
    if (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) < 0:
        bx, by, cx, cy = cx, cy, bx, by
    return (
        _side(ax, ay, bx, by, x, y) > 0
        and _side(bx, by, cx, cy, x, y) > 0
        and _side(cx, cy, ax, ay, x, y) > 0
    )


@kernel
def _side(px, py, qx, qy, x, y):  # type: ignore[no-untyped-def]
    """Return a positive number for a point on the inner side of an edge, by the top-left rule."""
    dx, dy = qx - px, qy - py
    is_owned = dy < 0 or (dy == 0 and dx > 0)
    return dx * (y - py) - dy * (x - px) + (1 if is_owned else 0)


@kernel
def bin_faces(corners, size, firsts, faces):  # type: ignore[no-untyped-def]
    """Count the faces of each bin in `firsts`, or list them in `faces` from these places on."""
    n_rows, n_columns, is_list = size
    side = BIN * TEXEL
    for face in range(len(corners)):
        ax, ay = corners[face, 0, 0], corners[face, 0, 1]
        bx, by = corners[face, 1, 0], corners[face, 1, 1]
        cx, cy = corners[face, 2, 0], corners[face, 2, 1]
        doubled = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if doubled == 0:
            continue
        if doubled < 0:
            bx, by, cx, cy = cx, cy, bx, by
        top, bottom = max(min(ay, by, cy) // side, 0), min(max(ay, by, cy) // side, n_rows - 1)
        left, right = max(min(ax, bx, cx) // side, 0), min(max(ax, bx, cx) // side, n_columns - 1)
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                x, y = column * side, row * side
                if (
                    _beyond(ax, ay, bx, by, x, y, side)
                    or _beyond(bx, by, cx, cy, x, y, side)
                    or _beyond(cx, cy, ax, ay, x, y, side)
                ):
                    continue
                place = row * n_columns + column
                if is_list:
                    faces[firsts[place]] = face
                firsts[place] += 1


@kernel
def _beyond(px, py, qx, qy, x, y, side):  # type: ignore[no-untyped-def]
    """Whether a square lies wholly on the outer side of an edge."""
    dx, dy = qx - px, qy - py
    innermost_x = x if dy > 0 else x + side
    innermost_y = y + side if dx > 0 else y
    return dx * (innermost_y - py) - dy * (innermost_x - px) < 0


@kernel
def write_masks(bins, size, texels, owners, counts, masks):  # type: ignore[no-untyped-def]
    """Write which sub-squares of some texels are covered, and how many."""
    corners, firsts, faces, n_columns = bins
    first_row, width = size
    for texel in texels:
        column, row = texel % width, first_row + texel // width
        place = (row // BIN) * n_columns + column // BIN
        mask = 0
        for i in range(firsts[place], firsts[place + 1]):
            mask |= _covered_mask(corners, faces[i], column * TEXEL, row * TEXEL)
        n = 0
        for bit in range(FULL):
            n += (mask >> bit) & 1
        counts[texel] = n if n > 0 or owners[texel] == NO_FACE else 1
        masks[texel] = mask


@kernel
def _covered_mask(corners, face, left, top):  # type: ignore[no-untyped-def]
    """Return the sub-squares of a texel whose centers a face covers, one bit each."""
    ax, ay = corners[face, 0, 0], corners[face, 0, 1]
    bx, by = corners[face, 1, 0], corners[face, 1, 1]
    cx, cy = corners[face, 2, 0], corners[face, 2, 1]
    if max(ax, bx, cx) < left or min(ax, bx, cx) > left + TEXEL:
        return 0
    if max(ay, by, cy) < top or min(ay, by, cy) > top + TEXEL:
        return 0
    if (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) < 0:
        bx, by, cx, cy = cx, cy, bx, by
    x, y = left + UNIT // 2, top + UNIT // 2
    a, b, c = _side(ax, ay, bx, by, x, y), _side(bx, by, cx, cy, x, y), _side(cx, cy, ax, ay, x, y)
    mask = 0
    for row in range(FINE):
        for column in range(FINE):
            # Each is positive on the inner side.
            across, down = column * UNIT, row * UNIT
            if (
                a + (bx - ax) * down - (by - ay) * across > 0
                and b + (cx - bx) * down - (cy - by) * across > 0
                and c + (ax - cx) * down - (ay - cy) * across > 0
            ):
                mask |= 1 << (FINE * row + column)
    return mask


@kernel
def mark_lines(edges, marked):  # type: ignore[no-untyped-def]
    """Mark the texels that lines pass through."""
    height, width = marked.shape
    for i in range(len(edges)):
        ax, ay, bx, by = edges[i, 0, 0], edges[i, 0, 1], edges[i, 1, 0], edges[i, 1, 1]
        if ay > by:
            ax, ay, bx, by = bx, by, ax, ay
        first = max((ay - SLACK) // TEXEL, 0)
        last = min((by + SLACK) // TEXEL, height - 1)
        for row in range(first, last + 1):
            # Where the line enters and leaves the row.
            left, right = min(ax, bx), max(ax, bx)
            if by > ay:
                slope = (bx - ax) / (by - ay)
                enters = ax + slope * (max(row * TEXEL, ay) - ay)
                leaves = ax + slope * (min((row + 1) * TEXEL, by) - ay)
                left = max(left, int(np.floor(min(enters, leaves))))
                right = min(right, int(np.ceil(max(enters, leaves))))
            begin = max((left - SLACK) // TEXEL, 0)
            end = min((right + SLACK) // TEXEL, width - 1)
            for column in range(begin, end + 1):
                marked[row, column] = True
