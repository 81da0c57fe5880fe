"""Where rays start and how they go: from samples to rays, and from hits to offsets and fans."""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel
from texbake.raycast.rays import NO_HIT


@kernel
def rays_kernel(  # type: ignore[no-untyped-def]
    faces, barycentrics, surface, field, reach, origins, directions, lengths, fronts, scratch
):
    """Write the rays of samples: from outside the low-poly surface through it and on behind it."""
    positions, starts, corners = surface
    normals, normal_corners = field
    front, back, has_cage = reach
    point, outward = scratch
    for i in range(len(faces)):
        face = faces[i]
        b, c = barycentrics[i, 0], barycentrics[i, 1]
        a = 1.0 - b - c
        square = 0.0
        for axis in range(3):
            point[axis] = (
                a * positions[corners[face, 0], axis]
                + b * positions[corners[face, 1], axis]
                + c * positions[corners[face, 2], axis]
            )
            if has_cage:
                outward[axis] = (
                    a * starts[corners[face, 0], axis]
                    + b * starts[corners[face, 1], axis]
                    + c * starts[corners[face, 2], axis]
                    - point[axis]
                )
            else:
                outward[axis] = (
                    a * normals[normal_corners[face, 0], axis]
                    + b * normals[normal_corners[face, 1], axis]
                    + c * normals[normal_corners[face, 2], axis]
                )
            square += outward[axis] * outward[axis]
        length = np.sqrt(square)
        # A cage that touches the surface, or unit normals that cancel: there is no direction.
        if length < 1e-12:
            length = _face_normal(positions, corners[face], outward)
            fronts[i] = 0.0 if has_cage else front
        else:
            fronts[i] = length if has_cage else front
        lengths[i] = fronts[i] + back if length > 0.0 else 0.0
        for axis in range(3):
            unit = outward[axis] / length if length > 0.0 else 0.0
            origins[i, axis] = point[axis] + fronts[i] * unit
            directions[i, axis] = -unit


@kernel
def _face_normal(positions, corners, normal):  # type: ignore[no-untyped-def]
    """Write the normal of a face, as long as twice its area, and return that length."""
    a, b, c = corners[0], corners[1], corners[2]
    for axis in range(3):
        y, z = (axis + 1) % 3, (axis + 2) % 3
        normal[axis] = (positions[b, y] - positions[a, y]) * (positions[c, z] - positions[a, z]) - (
            positions[b, z] - positions[a, z]
        ) * (positions[c, y] - positions[a, y])
    return np.sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2])


@kernel
def reshape_kernel(faces, barycentrics, surface, changes, straight, back, rays):  # type: ignore[no-untyped-def]
    """Blend the directions of rays with the face normals and move their origins, in place.

    A ray that is neither turned nor moved keeps its numbers bit for bit, because its origin is
    computed in the same way as before.
    """
    positions, corners = surface
    skew, offset = changes
    origins, directions, lengths, fronts = rays
    blend = np.empty(3)
    for i in range(len(faces)):
        weight = float(skew[i])
        if weight > 0.0:
            square = 0.0
            for axis in range(3):
                blend[axis] = (1.0 - weight) * directions[i, axis] + weight * straight[i, axis]
                square += blend[axis] * blend[axis]
            # Where the blend cancels, and at full weight, the direction is that of the face.
            length = np.sqrt(square) if weight < 1.0 else 0.0
            for axis in range(3):
                directions[i, axis] = blend[axis] / length if length > 0.0 else straight[i, axis]
        fronts[i] *= float(offset[i])
        if lengths[i] > 0.0:
            lengths[i] = fronts[i] + back
        p, q, r = corners[faces[i]]
        b, c = barycentrics[i, 0], barycentrics[i, 1]
        a = 1.0 - b - c
        for axis in range(3):
            point = a * positions[p, axis] + b * positions[q, axis] + c * positions[r, axis]
            origins[i, axis] = point - fronts[i] * directions[i, axis]


@kernel
def hits_kernel(lines, found, scale, hits):  # type: ignore[no-untyped-def]
    """Write weights in float32, and the offset from each sample to its hit in model units."""
    sample_barycentrics, directions, fronts = lines
    faces, barycentrics, distances = found
    low_barycentrics, high_barycentrics, offsets = hits
    for i in range(len(faces)):
        for k in range(2):
            low_barycentrics[i, k] = sample_barycentrics[i, k]
            high_barycentrics[i, k] = barycentrics[i, k]
        depth = (distances[i] - fronts[i]) / scale if faces[i] != NO_HIT else 0.0
        for axis in range(3):
            offsets[i, axis] = directions[i, axis] * depth


@kernel
def place_fans_kernel(hits, triangles, normals, fans):  # type: ignore[no-untyped-def]
    """Write the point, the shading normal and the face normal of each hit, in the local frame."""
    faces, barycentrics = hits
    positions, corners, center, scale = triangles
    vectors, vector_corners = normals
    points, axes, planes = fans
    axis, plane = np.empty(3), np.empty(3)
    for i in range(len(faces)):
        b, c = float(barycentrics[i, 0]), float(barycentrics[i, 1])
        a = 1.0 - b - c
        p, q, r = corners[faces[i]]
        k, m, n = vector_corners[faces[i]]
        for x in range(3):
            y, z = (x + 1) % 3, (x + 2) % 3
            point = a * positions[p, x] + b * positions[q, x] + c * positions[r, x]
            points[i, x] = (point - center[x]) * scale
            axis[x] = a * vectors[k, x] + b * vectors[m, x] + c * vectors[n, x]
            plane[x] = ((positions[q, y] - positions[p, y]) * scale) * (
                (positions[r, z] - positions[p, z]) * scale
            ) - ((positions[q, z] - positions[p, z]) * scale) * (
                (positions[r, y] - positions[p, y]) * scale
            )
        to_axis, to_plane = _inverse_length(axis), _inverse_length(plane)
        if axis[0] * plane[0] + axis[1] * plane[1] + axis[2] * plane[2] < 0.0:
            to_plane = -to_plane
        for x in range(3):
            axes[i, x] = axis[x] * to_axis
            planes[i, x] = plane[x] * to_plane if to_plane != 0.0 else axes[i, x]


@kernel
def _inverse_length(vector):  # type: ignore[no-untyped-def]
    """Return one over the length of a vector, 0 for a zero vector."""
    square = vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]
    return 1.0 / np.sqrt(square) if square > 0.0 else 0.0
