"""Kernels that project points into a photograph and weight what they find there.

A photograph counts fully where its camera faces the surface. Its weight falls with the angle, and
towards the border of the photograph so that none of its edges shows in the texture.

Based on: Debevec, Taylor, Malik, "Modeling and rendering architecture from photographs", SIGGRAPH
1996 (photographs weighted by direction and feathered at their borders).
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel


@kernel
def border_weight_kernel(u, v, feather):  # type: ignore[no-untyped-def]
    """0 outside the unit square and on its border, 1 from `feather` inwards, smoothly between."""
    if not (0.0 < u < 1.0 and 0.0 < v < 1.0):
        return 0.0
    inside = min(min(u, 1.0 - u), min(v, 1.0 - v))
    if inside >= feather:
        return 1.0
    share = inside / feather
    return share * share * (3.0 - 2.0 * share)


@kernel
def camera_weights_kernel(points, projector, surface, shape, coordinates, derivatives, weights):  # type: ignore[no-untyped-def]
    """Write the weights of points by viewing angle and, where above 0, their UVs in the photo."""
    faces, positions, normals = points
    matrix, seen_from = projector
    face_normals, steps = surface
    least_cosine, falloff, feather = shape
    for i in range(len(faces)):
        weights[i] = 0.0
        x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
        q = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3]
        if not q > 0.0:
            continue
        u = (matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3]) / q
        v = (matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3]) / q
        border = border_weight_kernel(u, v, feather)
        if border == 0.0:
            continue
        square, smooth, flat = 0.0, 0.0, 0.0
        for axis in range(3):
            towards = seen_from[axis] - seen_from[3] * positions[i, axis]
            square += towards * towards
            smooth += towards * normals[i, axis]
            flat += towards * face_normals[faces[i], axis]
        # The face itself decides whether it is seen; the smooth normal makes the weight smooth.
        share = (smooth / np.sqrt(square) - least_cosine) / (1.0 - least_cosine)
        if not (flat > 0.0 and share > 0.0):
            continue
        weights[i] = border * min(share, 1.0) ** falloff
        coordinates[i, 0], coordinates[i, 1] = u, v
        step = steps[faces[i]]
        for axis in range(2):
            derivatives[i, 2 * axis] = (step[0, axis] - u * step[2, axis]) / q
            derivatives[i, 2 * axis + 1] = (step[1, axis] - v * step[2, axis]) / q


@kernel
def uv_weights_kernel(points, photograph, shape, coordinates, weights):  # type: ignore[no-untyped-def]
    """Write the UVs of points in a photograph, and their weights by the area it gives them."""
    faces, barycentrics = points
    corners, facing = photograph
    falloff, feather = shape
    for i in range(len(faces)):
        b, c = barycentrics[i, 0], barycentrics[i, 1]
        a = 1.0 - b - c
        corner = corners[faces[i]]
        u = a * corner[0, 0] + b * corner[1, 0] + c * corner[2, 0]
        v = a * corner[0, 1] + b * corner[1, 1] + c * corner[2, 1]
        turned = facing[faces[i]]
        share = min(a * turned[0] + b * turned[1] + c * turned[2], 1.0)
        coordinates[i, 0], coordinates[i, 1] = u, v
        weights[i] = border_weight_kernel(u, v, feather) * share**falloff if share > 0.0 else 0.0
