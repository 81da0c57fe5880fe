"""Kernels that pull a cage in, vertex by vertex, until a point would come through one of its faces.

Each sweep moves every vertex to the least distance at which its faces still enclose all points, but
only half of the way if that is farther in, so that no vertex leaves its neighbors far outside. A
face encloses a point behind its plane, which is linear in the distance of each corner: each bound
has a closed form.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel

# Share of a point's weight below which a corner leaves the point to the two others: it depends on
# their side of the face, and the bound on this corner would be rounding.
_LEAST_WEIGHT = 1e-4


@kernel
def fit_cage_kernel(low, points, corners_around, limits, n_sweeps, distances):  # type: ignore[no-untyped-def]
    """Fit the distances of all vertices; return how far the farthest point lies outside."""
    positions, faces, normals = low
    order, first_corners = corners_around
    floors, ceilings = limits
    corners = np.empty((3, 3))
    for sweep in range(n_sweeps):
        greatest = 0.0
        for vertex in range(len(distances)):
            bound = floors[vertex]
            for at in range(first_corners[vertex], first_corners[vertex + 1]):
                face, corner = order[at] // 3, order[at] % 3
                corners_kernel(face, positions, faces, normals, distances, corners)
                needed = needed_kernel(
                    face, corner, corners, normals[vertex], distances[vertex], points
                )
                bound = max(bound, needed)
            bound = min(bound, ceilings[vertex])
            change = bound - distances[vertex]
            if change < 0.0 and sweep < n_sweeps - 1:
                change *= 0.5
            distances[vertex] += change
            greatest = max(greatest, abs(change))
        if greatest < 1e-9:
            break
    return outside_kernel(positions, faces, normals, distances, points, corners)


@kernel
def corners_kernel(face, positions, faces, normals, distances, corners):  # type: ignore[no-untyped-def]
    """Write the positions of a face's corners in the cage."""
    for corner in range(3):
        vertex = faces[face, corner]
        for axis in range(3):
            moved = distances[vertex] * normals[vertex, axis]
            corners[corner, axis] = positions[vertex, axis] + moved


@kernel
def area_vector_kernel(a, b, c):  # type: ignore[no-untyped-def]
    """Normal of a triangle, twice its area long."""
    x0, y0, z0 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    x1, y1, z1 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return y0 * z1 - z0 * y1, z0 * x1 - x0 * z1, x0 * y1 - y0 * x1


@kernel
def needed_kernel(face, corner, corners, normal, distance, points):  # type: ignore[no-untyped-def]
    """Least distance of a corner at which all points over its face lie behind the face."""
    positions, first_points = points
    after, last = corners[(corner + 1) % 3], corners[(corner + 2) % 3]
    here = corners[corner]
    x, y, z = area_vector_kernel(here, after, last)
    least_slope = _LEAST_WEIGHT * np.sqrt(x * x + y * y + z * z)
    needed = -np.inf
    for i in range(first_points[face], first_points[face + 1]):
        # The corner must lie in front of the plane through the point and the two other corners.
        x, y, z = area_vector_kernel(positions[i], after, last)
        slope = x * normal[0] + y * normal[1] + z * normal[2]
        volume = (
            x * (here[0] - positions[i, 0])
            + y * (here[1] - positions[i, 1])
            + z * (here[2] - positions[i, 2])
        )
        if slope > least_slope:
            needed = max(needed, distance - volume / slope)
    return needed


@kernel
def outside_kernel(positions, faces, normals, distances, points, corners):  # type: ignore[no-untyped-def]
    """How far the farthest point lies in front of its face."""
    places, first_points = points
    farthest = 0.0
    for face in range(len(faces)):
        if first_points[face] == first_points[face + 1]:
            continue
        corners_kernel(face, positions, faces, normals, distances, corners)
        x, y, z = area_vector_kernel(corners[0], corners[1], corners[2])
        length = np.sqrt(x * x + y * y + z * z)
        if length == 0.0:
            continue
        for i in range(first_points[face], first_points[face + 1]):
            height = (
                x * (places[i, 0] - corners[0, 0])
                + y * (places[i, 1] - corners[0, 1])
                + z * (places[i, 2] - corners[0, 2])
            ) / length
            farthest = max(farthest, height)
    return farthest
