"""Barycentric interpolation at the points that rays hit: the kernels of the maps."""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel


@kernel
def interpolate_kernel(faces, barycentrics, values, corners, found):  # type: ignore[no-untyped-def]
    """Write values of corners, interpolated at points of faces."""
    for i in range(len(faces)):
        b, c = float(barycentrics[i, 0]), float(barycentrics[i, 1])
        p, q, r = corners[faces[i]]
        for channel in range(values.shape[1]):
            found[i, channel] = (
                (1.0 - b - c) * values[p, channel] + b * values[q, channel] + c * values[r, channel]
            )


@kernel
def high_normals_kernel(faces, barycentrics, normals, corners, values):  # type: ignore[no-untyped-def]
    """Write unit normals at points of faces; zero where the normals of the corners cancel."""
    for i in range(len(faces)):
        b, c = float(barycentrics[i, 0]), float(barycentrics[i, 1])
        p, q, r = corners[faces[i]]
        x = (1.0 - b - c) * normals[p, 0] + b * normals[q, 0] + c * normals[r, 0]
        y = (1.0 - b - c) * normals[p, 1] + b * normals[q, 1] + c * normals[r, 1]
        z = (1.0 - b - c) * normals[p, 2] + b * normals[q, 2] + c * normals[r, 2]
        length = np.sqrt(x * x + y * y + z * z)
        if length == 0.0:
            length = 1.0
        values[i, 0] = x / length
        values[i, 1] = y / length
        values[i, 2] = z / length


@kernel
def tangent_space_kernel(faces, barycentrics, normals, corners, tangents, normalize, values):  # type: ignore[no-untyped-def]
    """Express model-space vectors in the tangent space at points of faces, in place."""
    for i in range(len(faces)):
        face = faces[i]
        b, c = float(barycentrics[i, 0]), float(barycentrics[i, 1])
        a = 1.0 - b - c
        p, q, r = corners[face]
        nx = a * normals[p, 0] + b * normals[q, 0] + c * normals[r, 0]
        ny = a * normals[p, 1] + b * normals[q, 1] + c * normals[r, 1]
        nz = a * normals[p, 2] + b * normals[q, 2] + c * normals[r, 2]
        tx = a * tangents[face, 0, 0] + b * tangents[face, 1, 0] + c * tangents[face, 2, 0]
        ty = a * tangents[face, 0, 1] + b * tangents[face, 1, 1] + c * tangents[face, 2, 1]
        tz = a * tangents[face, 0, 2] + b * tangents[face, 1, 2] + c * tangents[face, 2, 2]
        sign = float(tangents[face, 0, 3])
        bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        bx, by, bz = sign * bx, sign * by, sign * bz
        # Rows of the inverse, times the determinant: B x N, N x T, T x B.
        determinant = (by * nz - bz * ny) * tx + (bz * nx - bx * nz) * ty + (bx * ny - by * nx) * tz
        if determinant == 0.0:
            values[i, 0], values[i, 1], values[i, 2] = 0.0, 0.0, 1.0 if normalize else 0.0
            continue
        vx, vy, vz = float(values[i, 0]), float(values[i, 1]), float(values[i, 2])
        x = (by * nz - bz * ny) * vx + (bz * nx - bx * nz) * vy + (bx * ny - by * nx) * vz
        y = (ny * tz - nz * ty) * vx + (nz * tx - nx * tz) * vy + (nx * ty - ny * tx) * vz
        z = (ty * bz - tz * by) * vx + (tz * bx - tx * bz) * vy + (tx * by - ty * bx) * vz
        length = np.sqrt(x * x + y * y + z * z) if normalize else abs(determinant)
        if length == 0.0:
            length = 1.0
        length = length if determinant > 0.0 else -length
        values[i, 0] = x / length
        values[i, 1] = y / length
        values[i, 2] = z / length


@kernel
def displacement_kernel(faces, barycentrics, offsets, normals, corners, values):  # type: ignore[no-untyped-def]
    """Write the lengths of offsets along the normals at points of faces."""
    for i in range(len(faces)):
        b, c = float(barycentrics[i, 0]), float(barycentrics[i, 1])
        p, q, r = corners[faces[i]]
        height = 0.0
        square = 0.0
        for axis in range(3):
            normal = (1.0 - b - c) * normals[p, axis] + b * normals[q, axis] + c * normals[r, axis]
            height += normal * offsets[i, axis]
            square += normal * normal
        values[i, 0] = height / np.sqrt(square) if square > 0.0 else 0.0


@kernel
def position_kernel(faces, barycentrics, offsets, positions, corners, values):  # type: ignore[no-untyped-def]
    """Write points of faces, moved by offsets."""
    for i in range(len(faces)):
        b, c = float(barycentrics[i, 0]), float(barycentrics[i, 1])
        p, q, r = corners[faces[i]]
        for axis in range(3):
            # From one corner, so that a coordinate that all three share stays exact.
            start = positions[p, axis]
            along = b * (positions[q, axis] - start) + c * (positions[r, axis] - start)
            values[i, axis] = start + along + offsets[i, axis]


@kernel
def image_coordinates_kernel(faces, barycentrics, uvs, corners, placing, places):  # type: ignore[no-untyped-def]
    """Write texture coordinates at points of faces, after an affine transform."""
    for i in range(len(faces)):
        b, c = float(barycentrics[i, 0]), float(barycentrics[i, 1])
        p, q, r = corners[faces[i]]
        u = (1.0 - b - c) * uvs[p, 0] + b * uvs[q, 0] + c * uvs[r, 0]
        v = (1.0 - b - c) * uvs[p, 1] + b * uvs[q, 1] + c * uvs[r, 1]
        for row in range(2):
            places[i, row] = placing[row, 0] * u + placing[row, 1] * v + placing[row, 2]
