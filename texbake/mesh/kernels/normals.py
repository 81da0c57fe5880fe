"""Normals of faces and vertices weighted by angle, and the mean curvature of a field of normals.

Based on:
    Thürmer, Wüthrich, "Computing Vertex Normals from Polygonal Facets", Journal of Graphics Tools
        3(1), 1998;
    Rusinkiewicz, "Estimating Curvatures and Their Derivatives on Triangle Meshes", 2004.
"""

from __future__ import annotations

import math

from texbake.kernels import kernel

# A cross product shorter than this times the square of the longest edge is rounding, not area:
# subtracting, multiplying and subtracting again leave up to 4 units of 2^-53 an edge.
AREA_ROUNDING = 8.0 * 2.0**-53

# In radians. A sum of weighted normals below it is what rounding leaves of normals that cancel.
_CANCELED = 1e-12


@kernel
def _scaled_edge(positions, scale, tail, head):  # type: ignore[no-untyped-def]
    return (
        positions[head, 0] * scale - positions[tail, 0] * scale,
        positions[head, 1] * scale - positions[tail, 1] * scale,
        positions[head, 2] * scale - positions[tail, 2] * scale,
    )


@kernel
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _area_vector(ab, ac):  # type: ignore[no-untyped-def]
    """Cross product of two edges and its length; the length is 0 where it is only rounding."""
    cross = (
        ab[1] * ac[2] - ab[2] * ac[1],
        ab[2] * ac[0] - ab[0] * ac[2],
        ab[0] * ac[1] - ab[1] * ac[0],
    )
    length = math.sqrt(_dot(cross, cross))
    bc = (ac[0] - ab[0], ac[1] - ab[1], ac[2] - ab[2])
    longest_squared = max(_dot(ab, ab), _dot(ac, ac), _dot(bc, bc))
    if length <= AREA_ROUNDING * longest_squared:
        length = 0.0
    return cross, length


@kernel
def face_normals_kernel(positions, faces, scale, start, stop, normals):  # type: ignore[no-untyped-def]
    """Write the unit normals of faces start to stop - 1."""
    for face in range(start, stop):
        ab = _scaled_edge(positions, scale, faces[face, 0], faces[face, 1])
        ac = _scaled_edge(positions, scale, faces[face, 0], faces[face, 2])
        cross, length = _area_vector(ab, ac)
        for axis in range(3):
            normals[face, axis] = cross[axis] / length if length > 0.0 else 0.0


@kernel
def vertex_normals_kernel(positions, faces, scale, start, stop, normals):  # type: ignore[no-untyped-def]
    """Add every face to those of its corners that lie in start to stop - 1; then normalize them."""
    for face in range(len(faces)):
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        owns_a, owns_b, owns_c = start <= a < stop, start <= b < stop, start <= c < stop
        if not (owns_a or owns_b or owns_c):
            continue
        ab = _scaled_edge(positions, scale, a, b)
        ac = _scaled_edge(positions, scale, a, c)
        cross, length = _area_vector(ab, ac)
        if length == 0.0:
            continue
        bc = (ac[0] - ab[0], ac[1] - ab[1], ac[2] - ab[2])
        angle_a = math.atan2(length, _dot(ab, ac))
        angle_b = math.atan2(length, -_dot(ab, bc))
        angle_c = max(math.pi - angle_a - angle_b, 0.0)
        for axis in range(3):
            unit = cross[axis] / length
            if owns_a:
                normals[a, axis] += angle_a * unit
            if owns_b:
                normals[b, axis] += angle_b * unit
            if owns_c:
                normals[c, axis] += angle_c * unit
    for vertex in range(start, stop):
        x, y, z = normals[vertex, 0], normals[vertex, 1], normals[vertex, 2]
        length = math.sqrt(x * x + y * y + z * z)
        for axis in range(3):
            normals[vertex, axis] = normals[vertex, axis] / length if length > _CANCELED else 0.0


@kernel
def curvature_kernel(points, faces, firsts, normals, turns, areas):  # type: ignore[no-untyped-def]
    """Add the mean curvature of each face times its area, and its area, to its vertices."""
    for face in range(len(faces)):
        a, b, c = faces[face]
        abx, acx = points[b, 0] - points[a, 0], points[c, 0] - points[a, 0]
        aby, acy = points[b, 1] - points[a, 1], points[c, 1] - points[a, 1]
        abz, acz = points[b, 2] - points[a, 2], points[c, 2] - points[a, 2]
        x, y, z = aby * acz - abz * acy, abz * acx - abx * acz, abx * acy - aby * acx
        length = math.sqrt(x * x + y * y + z * z)
        if length == 0.0:
            continue
        x, y, z = x / length, y / length, z / length
        # A corner's weight falls off across the face along normal x opposite edge / (2 area).
        turn = (
            _crossed_dot(x, y, z, acx - abx, acy - aby, acz - abz, normals[a])
            + _crossed_dot(x, y, z, -acx, -acy, -acz, normals[b])
            + _crossed_dot(x, y, z, abx, aby, abz, normals[c])
        ) / 4.0
        for vertex in (a, b, c):
            turns[firsts[vertex]] += turn
            areas[firsts[vertex]] += length / 2.0


@kernel
def _crossed_dot(x, y, z, ex, ey, ez, normal):  # type: ignore[no-untyped-def]
    """Scalar triple product of a face's normal, an edge and a vertex's normal."""
    return (
        (y * ez - z * ey) * normal[0]
        + (z * ex - x * ez) * normal[1]
        + (x * ey - y * ex) * normal[2]
    )
