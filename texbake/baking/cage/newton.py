"""Kernels that find the face under a point, along the interpolated normals of a mesh.

Newton's method solves position(b, c) + height * normal(b, c) = point for the barycentrics (b, c)
and the height above a face. A solution outside the face continues on the neighbor across the edge.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel


@kernel
def faces_under_kernel(points, low, results):  # type: ignore[no-untyped-def]
    """Write the face under each point, and its height along the interpolated normal."""
    targets, distances, closest, weights = points
    positions, faces, normals, opposite = low
    owners, heights, exact = results
    step = np.empty(3)
    for i in range(len(targets)):
        face = closest[i]
        b, c = weights[i, 1], weights[i, 2]
        height, beside, solved = 0.0, False, False
        for _ in range(8):
            height = height_kernel(targets[i], face, b, c, positions, faces, normals)
            solved = False
            for _ in range(12):
                size = newton_step_kernel(
                    targets[i], face, b, c, height, positions, faces, normals, step
                )
                if not size < 1e3:
                    break
                b, c, height = b + step[0], c + step[1], height + step[2]
                if size < 1e-12:
                    solved = True
                    break
            if not solved or (b >= -1e-9 and c >= -1e-9 and b + c <= 1.0 + 1e-9):
                break
            least = min(b, c, 1.0 - b - c)
            corner = 2 if least == b else (0 if least == c else 1)
            across = opposite[3 * face + corner]
            solved = False
            if across < 0:
                beside = True
                break
            face = across // 3
            b = c = 1.0 / 3.0
        if solved:
            owners[i], heights[i], exact[i] = face, height, True
        else:
            face = closest[i]
            outside = height_kernel(
                targets[i], face, weights[i, 1], weights[i, 2], positions, faces, normals
            )
            owners[i] = -1 if beside else face
            heights[i] = distances[i] if outside > 0.0 else 0.0
            exact[i] = False


@kernel
def height_kernel(target, face, b, c, positions, faces, normals):  # type: ignore[no-untyped-def]
    """Height of a point above (b, c) on a face, along the normal there."""
    height, square = 0.0, 0.0
    i, j, k = faces[face]
    for axis in range(3):
        point = (1.0 - b - c) * positions[i, axis] + b * positions[j, axis] + c * positions[k, axis]
        normal = (1.0 - b - c) * normals[i, axis] + b * normals[j, axis] + c * normals[k, axis]
        height += normal * (target[axis] - point)
        square += normal * normal
    return height / square if square > 0.0 else 0.0


@kernel
def newton_step_kernel(target, face, b, c, height, positions, faces, normals, step):  # type: ignore[no-untyped-def]
    """Write one step of (b, c, height) by Cramer's rule; return its size, inf if it is singular."""
    i, j, k = faces[face]
    along = np.empty((3, 3))
    rest = np.empty(3)
    for axis in range(3):
        normal = (1.0 - b - c) * normals[i, axis] + b * normals[j, axis] + c * normals[k, axis]
        point = (1.0 - b - c) * positions[i, axis] + b * positions[j, axis] + c * positions[k, axis]
        along[0, axis] = positions[j, axis] - positions[i, axis]
        along[0, axis] += height * (normals[j, axis] - normals[i, axis])
        along[1, axis] = positions[k, axis] - positions[i, axis]
        along[1, axis] += height * (normals[k, axis] - normals[i, axis])
        along[2, axis] = normal
        rest[axis] = target[axis] - point - height * normal
    volume = triple_product_kernel(along[0], along[1], along[2])
    if volume == 0.0:
        return np.inf
    step[0] = triple_product_kernel(rest, along[1], along[2]) / volume
    step[1] = triple_product_kernel(along[0], rest, along[2]) / volume
    step[2] = triple_product_kernel(along[0], along[1], rest) / volume
    return max(abs(step[0]), abs(step[1]), abs(step[2]))


@kernel
def triple_product_kernel(a, b, c):  # type: ignore[no-untyped-def]
    """Determinant of three vectors."""
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )
