"""Tutte's embedding: the boundary on a circle, every other vertex at the mean of its neighbors.

Based on: Tutte, "How to Draw a Graph", 1963; Floater, "One-to-one Piecewise Linear Mappings over
Triangulations", 2003 (no triangle flips for any positive weights).
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel
from texbake.mapping.kernels.conjugate_gradient import solve_blocks

# Edge weights are those of harmonic maps (cotangents), clamped to these bounds: positive, or
# triangles may flip, and similar enough for the solver.
_LEAST_WEIGHT = 0.02
_MOST_WEIGHT = 20.0


@kernel
def embed_kernel(points, faces, row_starts, columns, entries, circle, uvs, tolerance):  # type: ignore[no-untyped-def]
    """Move the vertices that are not on the circle to the weighted mean of their neighbors."""
    weights = np.zeros(len(columns))
    for face in range(len(faces)):
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            dot, first, second = 0.0, 0.0, 0.0
            for axis in range(3):
                to_j = points[faces[face, j], axis] - points[faces[face, i], axis]
                to_k = points[faces[face, k], axis] - points[faces[face, i], axis]
                dot += to_j * to_k
                first += to_j * to_j
                second += to_k * to_k
            doubled = math.sqrt(max(first * second - dot * dot, 0.0))  # twice the area
            limit = _MOST_WEIGHT * doubled
            cotangent = dot / doubled if abs(dot) < limit else math.copysign(_MOST_WEIGHT, dot)
            weights[entries[face, j, k]] += 0.5 * cotangent
            weights[entries[face, k, j]] += 0.5 * cotangent
    blocks = np.zeros((len(columns), 4))
    target = np.zeros((len(row_starts) - 1, 2))
    for i in range(len(row_starts) - 1):
        if circle[i]:
            continue
        total = 0.0
        for at in range(row_starts[i] + 1, row_starts[i + 1]):
            weight = min(max(weights[at], _LEAST_WEIGHT), _MOST_WEIGHT)
            total += weight
            j = columns[at]
            if circle[j]:
                target[i, 0] += weight * uvs[j, 0]
                target[i, 1] += weight * uvs[j, 1]
            else:
                blocks[at, 0] = blocks[at, 3] = -weight
        blocks[row_starts[i], 0] = blocks[row_starts[i], 3] = total
    inner = np.empty((len(target), 2))
    alone = np.zeros(len(target), dtype=np.int32)
    solve_blocks(
        row_starts, columns, blocks, target, uvs, alone, inner, tolerance, 20 * len(target)
    )
    for i in range(len(target)):
        if not circle[i]:
            uvs[i, 0], uvs[i, 1] = inner[i, 0], inner[i, 1]
