"""Whether a layout covers nothing twice, told from its boundary.

Where no triangle is flipped, a point is covered as often as the boundary winds around it. So a
layout covers nothing twice if its boundary does not meet itself and only one of its loops runs
counter-clockwise. Edges to compare come from a grid. Where the boundary only touches itself, as
the two sides of a slit do that close up in the plane, the triangles decide, with a depth that
rounding may bring about.

Based on: Lipman, "Bijective Mappings of Meshes with Boundary and the Degree in Mesh Processing",
2014.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel
from texbake.mapping.atlas.flattening.patch import Patch
from texbake.mapping.overlap import overlap_layers
from texbake.mesh.mesh import FloatArray

# Overlaps no deeper than this share of the longer side of the layout are two borders that touch.
_DEPTH = 2.0**-21

APART, TOUCHING, CROSSING = 0, 1, 2


def is_injective(uvs: FloatArray, patch: Patch) -> bool:
    """Tell whether no two triangles of a layout overlap; none of them may be flipped.

    Parameters
    ----------
    uvs : (n, 2) float64
    patch : Patch

    Examples
    --------
    >>> from texbake.mapping.atlas.flattening.patch import patch_of
    >>> patch = patch_of(np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]], dtype=np.int32), 5)
    >>> angles = np.array([0.0, 1.9, 3.8, 5.7])
    >>> corners = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    >>> is_injective(np.concatenate([[[0.0, 0.0]], corners]), patch)
    True
    >>> corners[3] = 0.5 * corners[0] + 0.5 * corners[1]
    >>> is_injective(np.concatenate([[[0.0, 0.0]], corners]), patch)
    False
    """
    meeting = boundary_meeting(uvs, patch.boundary, patch.boundary_loops)
    if meeting == CROSSING:
        return False
    if meeting == APART and not patch.has_touching_fans:
        return True
    used = uvs[patch.faces.ravel()]
    depth = _DEPTH * float((used.max(axis=0) - used.min(axis=0)).max())
    no_chart = np.zeros(len(patch.faces), dtype=np.int32)
    return not overlap_layers(uvs[patch.faces], no_chart, depth=depth).any()


@kernel
def boundary_meeting(uvs, boundary, loops):  # type: ignore[no-untyped-def]
    """Tell whether edges of a boundary are APART but for common vertices, TOUCHING or CROSSING.

    A boundary of which two loops run counter-clockwise counts as crossing.

    Parameters
    ----------
    uvs : (n, 2) float64
    boundary : (b, 2) int32
    loops : (b,) int32
        `boundary_loops` of a `Patch`.
    """
    # Each edge is compared with those before it that touch a cell of a grid that it touches too.
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
    scale, depth = n_cells / extent, _DEPTH * extent
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
    """How the edges pq and rs meet; they share no more than one vertex."""
    if max(uvs[p, 0], uvs[q, 0]) < min(uvs[r, 0], uvs[s, 0]) - depth:
        return APART
    if max(uvs[r, 0], uvs[s, 0]) < min(uvs[p, 0], uvs[q, 0]) - depth:
        return APART
    if max(uvs[p, 1], uvs[q, 1]) < min(uvs[r, 1], uvs[s, 1]) - depth:
        return APART
    if max(uvs[r, 1], uvs[s, 1]) < min(uvs[p, 1], uvs[q, 1]) - depth:
        return APART
    if p in (r, s) or q in (r, s):
        # They leave their vertex in two directions, or one lies on the other.
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
    """Signed distance of r from the line through p and q; 0 where these are at one place."""
    x, y = uvs[q, 0] - uvs[p, 0], uvs[q, 1] - uvs[p, 1]
    length = math.sqrt(x * x + y * y)
    area = x * (uvs[r, 1] - uvs[p, 1]) - y * (uvs[r, 0] - uvs[p, 0])
    return area / length if length > 0.0 else 0.0
