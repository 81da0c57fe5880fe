"""Screen-space ambient occlusion: the unoccluded share of ambient light at each pixel.

At each pixel the hemisphere around the surface normal is divided into slices across the screen. In
each slice the horizon within the radius is searched on both sides, and the visible arc between the
two horizons is integrated analytically, weighted by the cosine to the normal. The slices are
rotated from pixel to pixel in a 4 x 4 pattern, which is then averaged out over as many pixels of
the same surface. Only surfaces that the camera sees can occlude.

Based on: Jimenez, Wu, Pesce and Jarabo, "Practical real-time strategies for accurate indirect
occlusion", 2016. Unlike there, normals are those of the triangles, so that a flat surface never
occludes itself.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel

# Width of the pattern of rotations, and of the mean that removes it.
PATTERN = 4

# Least sine of the elevation at which a point occludes. With float32 depths, points of a flat
# surface seen at a grazing angle deviate from it by this much.
FLAT = 1e-3


@kernel
def find_places(  # type: ignore[no-untyped-def]
    face_ids, depths, side, near, positions, faces, rays, places, normals, start, stop
):
    """Write position (relative to the camera) and normal of each pixel's nearest surface, or 0."""
    p, q = np.empty(3), np.empty(3)
    for row in range(start, stop):
        for column in range(places.shape[1]):
            nearest, face = np.float32(0.0), -1
            x, y = 0.0, 0.0
            for j in range(row * side, (row + 1) * side):
                for i in range(column * side, (column + 1) * side):
                    if depths[j, i] > nearest:
                        nearest, face = depths[j, i], face_ids[j, i]
                        x, y = (i + 0.5) / side, (j + 0.5) / side
            if face < 0:
                continue
            away = near / nearest
            for k in range(3):
                places[row, column, k] = away * (rays[0, k] + x * rays[1, k] + y * rays[2, k])
                p[k] = positions[faces[face, 1], k] - positions[faces[face, 0], k]
                q[k] = positions[faces[face, 2], k] - positions[faces[face, 0], k]
            nx, ny, nz = (
                p[1] * q[2] - p[2] * q[1],
                p[2] * q[0] - p[0] * q[2],
                p[0] * q[1] - p[1] * q[0],
            )
            toward = nx * places[row, column, 0] + ny * places[row, column, 1]
            toward += nz * places[row, column, 2]
            length = math.sqrt(nx * nx + ny * ny + nz * nz)
            if not 0.0 < length < np.inf:
                continue
            length = length if toward <= 0.0 else -length
            normals[row, column, 0] = nx / length
            normals[row, column, 1] = ny / length
            normals[row, column, 2] = nz / length


@kernel
def horizon_of(places, row, column, dx, dy, n_steps, reach, offset, radius, normal, to_eye):  # type: ignore[no-untyped-def]
    """Cosine between the horizon on one side of a pixel and the view direction; -1 for none."""
    highest = -1.0
    here = places[row, column]
    for step in range(n_steps):
        away = reach * (step + offset) / n_steps
        away = max(away, 1.0)
        j = math.floor(row + 0.5 + away * dy)
        i = math.floor(column + 0.5 + away * dx)
        if not (0 <= j < places.shape[0] and 0 <= i < places.shape[1]) or (
            j == row and i == column
        ):
            continue
        there = places[j, i]
        if there[0] == 0.0 and there[1] == 0.0 and there[2] == 0.0:
            continue
        squared, along, above = 0.0, 0.0, 0.0
        for k in range(3):
            apart = there[k] - here[k]
            squared += apart * apart
            along += apart * to_eye[k]
            above += apart * normal[k]
        if not 0.0 < squared < radius * radius:
            continue
        distance = math.sqrt(squared)
        if above <= FLAT * distance:
            continue
        # Fade out toward the radius to avoid a discontinuity.
        share = min(1.0, 2.0 * (1.0 - distance / radius))
        highest = max(highest, share * (along / distance + 1.0) - 1.0)
    return highest


@kernel
def arc_light(horizon, tilt):  # type: ignore[no-untyped-def]
    """Light between the view direction and a horizon, weighted by the cosine to the normal."""
    return 0.25 * (
        -math.cos(2.0 * horizon - tilt) + math.cos(tilt) + 2.0 * horizon * math.sin(tilt)
    )


@kernel
def find_arriving_shares(  # type: ignore[no-untyped-def]
    places, normals, right, up, pixels_per_unit, radius, n_slices, n_steps, out, start, stop
):
    """Write the unoccluded share of ambient light at each pixel."""
    to_eye = np.empty(3)
    for row in range(start, stop):
        for column in range(places.shape[1]):
            normal, place = normals[row, column], places[row, column]
            if normal[0] == 0.0 and normal[1] == 0.0 and normal[2] == 0.0:
                continue
            distance = math.sqrt(place[0] ** 2 + place[1] ** 2 + place[2] ** 2)
            for k in range(3):
                to_eye[k] = -place[k] / distance
            reach = min(radius * pixels_per_unit / distance, 0.5 * places.shape[1])
            turn = (row % PATTERN) * PATTERN + column % PATTERN
            offset = 0.25 + 0.75 * ((turn * 5) % 16) / 16.0
            arriving, total = 0.0, 0.0
            for s in range(n_slices):
                angle = math.pi * (s + ((turn * 7) % 16) / 16.0) / n_slices
                arriving_here, all_here = slice_light(
                    places, row, column, math.cos(angle), math.sin(angle), right, up, normal,
                    to_eye, n_steps, reach, offset, radius,
                )  # fmt: skip
                arriving += arriving_here
                total += all_here
            # Relative to the unoccluded light in the same slices, so that a plane gives 1.
            out[row, column] = min(max(arriving / total, 0.0), 1.0) if total > 0.0 else 1.0


@kernel
def slice_light(  # type: ignore[no-untyped-def]
    places, row, column, cosine, sine, right, up, normal, to_eye, n_steps, reach, offset, radius
):
    """Unoccluded light in one slice through the view direction, and the total without occlusion."""
    # Axis of the slice: its screen direction orthogonal to the view. Then the slice's normal.
    along_eye = 0.0
    for k in range(3):
        along_eye += (cosine * right[k] - sine * up[k]) * to_eye[k]
    tx = cosine * right[0] - sine * up[0] - along_eye * to_eye[0]
    ty = cosine * right[1] - sine * up[1] - along_eye * to_eye[1]
    tz = cosine * right[2] - sine * up[2] - along_eye * to_eye[2]
    length = math.sqrt(tx * tx + ty * ty + tz * tz)
    tx, ty, tz = tx / length, ty / length, tz / length
    across = normal[0] * tx + normal[1] * ty + normal[2] * tz
    toward = normal[0] * to_eye[0] + normal[1] * to_eye[1] + normal[2] * to_eye[2]
    projected = math.sqrt(across * across + toward * toward)
    if projected < 1e-6:  # the slice lies in the surface
        return 0.0, 0.0
    tilt = math.atan2(across, toward)
    ahead = horizon_of(
        places, row, column, cosine, sine, n_steps, reach, offset, radius, normal, to_eye
    )
    behind = horizon_of(
        places, row, column, -cosine, -sine, n_steps, reach, offset, radius, normal, to_eye
    )
    # Horizons as angles from the view direction, limited by the surface itself.
    most, least = tilt + 0.5 * math.pi, tilt - 0.5 * math.pi
    first = min(math.acos(min(max(ahead, -1.0), 1.0)), most)
    second = max(-math.acos(min(max(behind, -1.0), 1.0)), least)
    return (
        projected * (arc_light(first, tilt) + arc_light(second, tilt)),
        projected * (arc_light(most, tilt) + arc_light(least, tilt)),
    )


@kernel
def smooth_shares(rough, places, normals, radius, out, start, stop):  # type: ignore[no-untyped-def]
    """Average over the pixels of the pattern that lie on the same surface."""
    for row in range(start, stop):
        for column in range(rough.shape[1]):
            total, weight = 0.0, 0.0
            for j in range(row - 2, row + 2):
                for i in range(column - 2, column + 2):
                    if not (0 <= j < rough.shape[0] and 0 <= i < rough.shape[1]):
                        continue
                    off, alike = 0.0, 0.0
                    for k in range(3):
                        off += (places[j, i, k] - places[row, column, k]) * normals[row, column, k]
                        alike += normals[j, i, k] * normals[row, column, k]
                    if abs(off) < 0.1 * radius and alike > 0.5:
                        total += rough[j, i]
                        weight += 1.0
            out[row, column] = total / weight if weight > 0.0 else 1.0
