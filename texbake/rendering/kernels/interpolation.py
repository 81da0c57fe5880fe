"""Interpolating positions, directions, texture coordinates and normals at fragments.

Each function writes one row per fragment. Weights are those of the triangle's second and third
corner; `changes` are their growth for one pixel to the right, then for one pixel down.

Based on: Heckbert, "Fundamentals of Texture Mapping and Image Warping", 1989; Mikkelsen,
"Simulation of Wrinkled Surfaces Revisited", 2008, for normals in tangent space.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel


@kernel
def move_to_base(faces, weights, changes, corners, weights_out, changes_out):  # type: ignore[no-untyped-def]
    """Convert weights on pieces, and their changes, to weights on the base triangles."""
    for i in range(len(faces)):
        piece = corners[faces[i]]
        for k in range(2):
            along = np.float64(piece[1, k] - piece[0, k])
            up = np.float64(piece[2, k] - piece[0, k])
            weights_out[i, k] = piece[0, k] + weights[i, 0] * along + weights[i, 1] * up
            if len(changes) > 0:
                changes_out[i, k] = changes[i, 0] * along + changes[i, 1] * up
                changes_out[i, 2 + k] = changes[i, 2] * along + changes[i, 3] * up


@kernel
def interpolate_positions(points, corners, faces, weights, out):  # type: ignore[no-untyped-def]
    """Write the position of each fragment in world space."""
    for i in range(len(faces)):
        a, b, c = corners[faces[i], 0], corners[faces[i], 1], corners[faces[i], 2]
        weight1, weight2 = weights[i, 0], weights[i, 1]
        for k in range(3):
            # Relative to the first corner, so that weights of 0 give its position exactly.
            out[i, k] = (
                points[a, k]
                + weight1 * (points[b, k] - points[a, k])
                + weight2 * (points[c, k] - points[a, k])
            )


@kernel
def find_view_directions(places, rays, out):  # type: ignore[no-untyped-def]
    """Write the unit vector from each fragment to the camera."""
    for i in range(len(places)):
        squared = 0.0
        for k in range(3):
            ray = rays[0, k] + places[i, 0] * rays[1, k] + places[i, 1] * rays[2, k]
            out[i, k] = -ray
            squared += ray * ray
        scale = 1.0 / math.sqrt(squared)
        for k in range(3):
            out[i, k] *= scale


@kernel
def interpolate_uvs(uvs, corners, faces, weights, changes, out, changes_out):  # type: ignore[no-untyped-def]
    """Write texture coordinates and, unless `changes_out` is empty, their changes per pixel."""
    for i in range(len(faces)):
        a, b, c = corners[faces[i], 0], corners[faces[i], 1], corners[faces[i], 2]
        weight1, weight2 = weights[i, 0], weights[i, 1]
        for k in range(2):
            along, up = uvs[b, k] - uvs[a, k], uvs[c, k] - uvs[a, k]
            out[i, k] = uvs[a, k] + weight1 * along + weight2 * up
            if len(changes_out) > 0:
                changes_out[i, k] = changes[i, 0] * along + changes[i, 1] * up
                changes_out[i, 2 + k] = changes[i, 2] * along + changes[i, 3] * up


@kernel
def find_scaled_points(positions, corners, matrix, faces, weights, changes, out, widths):  # type: ignore[no-untyped-def]
    """Write points times a matrix and, unless `widths` is empty, the width of a pixel there."""
    places, known = np.empty((3, 3)), np.int32(-1)  # neighbors mostly lie on the same face
    for i in range(len(faces)):
        if faces[i] != known:
            known = faces[i]
            for corner in range(3):
                p = positions[corners[known, corner]]
                for k in range(3):
                    row = matrix[k]
                    places[corner, k] = row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3]
        for k in range(3):
            along, up = places[1, k] - places[0, k], places[2, k] - places[0, k]
            out[i, k] = places[0, k] + weights[i, 0] * along + weights[i, 1] * up
            if len(widths) > 0:
                right = abs(changes[i, 0] * along + changes[i, 1] * up)
                down = abs(changes[i, 2] * along + changes[i, 3] * up)
                widths[i, k] = max(right, down)


@kernel
def finish_normal(x, y, z, side, view, out):  # type: ignore[no-untyped-def]
    """Normalize a vector and face it to the visible side; a zero vector becomes `view`."""
    squared = x * x + y * y + z * z
    if 0.0 < squared < np.inf:
        scale = side / math.sqrt(squared)
        out[0], out[1], out[2] = x * scale, y * scale, z * scale
    else:
        out[0], out[1], out[2] = view[0], view[1], view[2]


@kernel
def interpolate_normals(normals, corners, faces, weights, back_facing, back, out):  # type: ignore[no-untyped-def]
    """Write the unit normal of each fragment, on the visible side."""
    for i in range(len(faces)):
        a, b, c = corners[faces[i], 0], corners[faces[i], 1], corners[faces[i], 2]
        weight1, weight2 = weights[i, 0], weights[i, 1]
        weight0 = 1.0 - weight1 - weight2
        x = weight0 * normals[a, 0] + weight1 * normals[b, 0] + weight2 * normals[c, 0]
        y = weight0 * normals[a, 1] + weight1 * normals[b, 1] + weight2 * normals[c, 1]
        z = weight0 * normals[a, 2] + weight1 * normals[b, 2] + weight2 * normals[c, 2]
        finish_normal(x, y, z, -1.0 if back_facing[i] else 1.0, back, out[i])


@kernel
def corner_frames(normals, corners, tangents, face, frames):  # type: ignore[no-untyped-def]
    """Write the normals and tangents of a face's corners side by side, (3, 6)."""
    for k in range(3):
        for axis in range(3):
            frames[k, axis] = normals[corners[face, k], axis]
            frames[k, 3 + axis] = tangents[face, k, axis]


@kernel
def bend_normals(  # type: ignore[no-untyped-def]
    normals, corners, tangents, faces, weights, texels, strength, back_facing, back, out
):
    """Write the normals of a tangent-space map in world space."""
    f = np.empty((3, 6))
    known = np.int32(-1)  # neighbors mostly lie on the same face
    for i in range(len(faces)):
        if faces[i] != known:
            known = faces[i]
            corner_frames(normals, corners, tangents, known, f)
        w1, w2 = weights[i, 0], weights[i, 1]
        w0 = 1.0 - w1 - w2
        nx = w0 * f[0, 0] + w1 * f[1, 0] + w2 * f[2, 0]
        ny = w0 * f[0, 1] + w1 * f[1, 1] + w2 * f[2, 1]
        nz = w0 * f[0, 2] + w1 * f[1, 2] + w2 * f[2, 2]
        tx = w0 * f[0, 3] + w1 * f[1, 3] + w2 * f[2, 3]
        ty = w0 * f[0, 4] + w1 * f[1, 4] + w2 * f[2, 4]
        tz = w0 * f[0, 5] + w1 * f[1, 5] + w2 * f[2, 5]
        x, y, z = strength * texels[i, 0], strength * texels[i, 1], np.float64(texels[i, 2])
        y *= tangents[known, 0, 3]
        if not 0.0 < x * x + y * y + z * z < np.inf:  # no direction: use the surface normal
            x, y, z = 0.0, 0.0, np.float64(1.0)
        finish_normal(
            x * tx + y * (ny * tz - nz * ty) + z * nx,
            x * ty + y * (nz * tx - nx * tz) + z * ny,
            x * tz + y * (nx * ty - ny * tx) + z * nz,
            -1.0 if back_facing[i] else 1.0,
            back,
            out[i],
        )


@kernel
def turn_normals(texels, matrix, back_facing, back, out):  # type: ignore[no-untyped-def]
    """Write the normals of a map in another space, transformed by a matrix."""
    for i in range(len(texels)):
        x, y, z = texels[i, 0], texels[i, 1], texels[i, 2]
        finish_normal(
            matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z,
            matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z,
            matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z,
            -1.0 if back_facing[i] else 1.0,
            back,
            out[i],
        )
