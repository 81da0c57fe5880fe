"""A first layout of a patch: its boundary on a circle, each other vertex among its neighbors.

Based on: Tutte, "How to Draw a Graph", 1963; Floater, "One-to-one Piecewise Linear Mappings over
Triangulations", 2003 (no triangle flips whatever the weights are, so long as they are positive).
Holes are filled, each with a fan about a vertex of its own, which is then forgotten.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel
from texbake.mapping.atlas.flattening.conjugate_gradient import solve_blocks
from texbake.mapping.atlas.flattening.patch import Patch, patch_of
from texbake.mesh.mesh import FloatArray, IntArray

# Weights of edges are those of harmonic maps (cotangents), kept within these bounds: positive, or
# triangles may flip, and alike enough for the solver.
_LEAST_WEIGHT = 0.02
_MOST_WEIGHT = 20.0


def tutte_layout(points: FloatArray, patch: Patch, tolerance: float = 1e-12) -> FloatArray | None:
    """Lay a disk out in the unit circle, without flips as far as float64 can tell corners apart.

    Parameters
    ----------
    points : (n, 3) float64
    patch : Patch
        A disk once its holes are filled: `is_disk`.
    tolerance : float
        Of the linear system that is solved. A patch that is nowhere far from its boundary has no
        flips with less than the best.

    Returns
    -------
    (n, 2) float64 or None
        None where an edge across a hole is there already, so that it cannot be filled by a fan.
    """
    lengths = [_loop_lengths(points, loop) for loop in patch.loops]
    outer = int(np.argmax([length.sum() for length in lengths]))
    fans, centers = [patch.faces], [points]
    for index, loop in enumerate(patch.loops):
        if index != outer:
            center = np.full(len(loop), patch.n_vertices + len(fans) - 1, dtype=np.int32)
            fans.append(np.stack([np.roll(loop, -1), loop, center], axis=1).astype(np.int32))
            centers.append(points[loop].mean(axis=0, keepdims=True))
    filled = patch
    if len(fans) > 1:
        points = np.concatenate(centers)
        closed = patch_of(np.concatenate(fans), len(points))
        if closed is None:
            return None
        filled = closed
    angles = _circle_angles(lengths[outer])
    uvs = np.zeros((len(points), 2))
    circle = np.zeros(len(points), dtype=np.bool_)
    circle[patch.loops[outer]] = True
    uvs[patch.loops[outer]] = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    _embed_kernel(
        points,
        filled.faces,
        filled.row_starts,
        filled.columns,
        filled.entries,
        circle,
        uvs,
        tolerance,
    )
    return np.ascontiguousarray(uvs[: patch.n_vertices])


def _loop_lengths(points: FloatArray, loop: IntArray) -> FloatArray:
    return np.asarray(np.linalg.norm(points[np.roll(loop, -1)] - points[loop], axis=1))


def _circle_angles(lengths: FloatArray) -> FloatArray:
    """Angle of each vertex of the loop: as its edges are long, a tenth of them all alike."""
    total = float(lengths.sum())
    shares = lengths / total if total > 0.0 else np.zeros(len(lengths))
    shares = 0.9 * shares + 0.1 / len(lengths)
    shares /= shares.sum()
    return np.asarray(2.0 * math.pi * np.concatenate([[0.0], np.cumsum(shares[:-1])]))


@kernel
def _embed_kernel(points, faces, row_starts, columns, entries, circle, uvs, tolerance):  # type: ignore[no-untyped-def]
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
