"""Projecting points into slides and shadow maps.

Based on: Segal, Korobkin, van Widenfelt, Foran, Haeberli, "Fast shadows and lighting effects using
texture mapping", SIGGRAPH 1992; for shadows, see the sources in
`texbake.rendering.effects.shadows`.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel
from texbake.rendering.kernels.lighting import row_of
from texbake.rendering.raster.clip import SUBPIXELS
from texbake.rendering.raster.world import object_of


@kernel
def find_pixel_steps(points, corners, faces, drawn_faces, places, rays, eye, out):  # type: ignore[no-untyped-def]
    """Write the motion of points in world space per pixel to the right, then down."""
    normal, ray = np.empty(3), np.empty(3)
    for i in range(len(points)):
        a, b, c = (
            corners[faces[drawn_faces[i], 0]],
            corners[faces[drawn_faces[i], 1]],
            corners[faces[drawn_faces[i], 2]],
        )
        facing, length, squared = 0.0, 0.0, 0.0
        for k in range(3):
            y, z = (k + 1) % 3, (k + 2) % 3
            normal[k] = (b[y] - a[y]) * (c[z] - a[z]) - (b[z] - a[z]) * (c[y] - a[y])
            ray[k] = rays[0, k] + places[i, 0] * rays[1, k] + places[i, 1] * rays[2, k]
            facing += normal[k] * ray[k]
            length += (points[i, k] - eye[k]) * ray[k]
            squared += ray[k] * ray[k]
        along = length / squared
        for j in range(2):
            turn = 0.0
            for k in range(3):
                turn += normal[k] * rays[1 + j, k]
            for k in range(3):
                out[i, j, k] = along * (rays[1 + j, k] - turn / facing * ray[k])


@kernel
def project_points(points, steps, matrix, places, changes, coverage):  # type: ignore[no-untyped-def]
    """Write the picture coordinates of points and the share of each pixel that is covered."""
    for i in range(len(points)):
        q = matrix[3, 3]
        for k in range(3):
            q += matrix[3, k] * points[i, k]
        coverage[i] = 1.0 if q > 0.0 else 0.0
        for j in range(2):
            at = matrix[j, 3]
            for k in range(3):
                at += matrix[j, k] * points[i, k]
            at = at / q if q > 0.0 else 0.0
            width = 0.0
            for d in range(len(steps[i]) if len(steps) > 0 else 0):
                ds, dq = 0.0, 0.0
                for k in range(3):
                    ds += matrix[j, k] * steps[i, d, k]
                    dq += matrix[3, k] * steps[i, d, k]
                change = (ds - at * dq) / q
                if not abs(change) <= 1.0:  # a pixel that holds the whole picture, or edge-on
                    change = 1.0
                changes[i, 2 * d + j] = change
                width += abs(change)
            # Share of the pixel's width inside the picture.
            if width > 0.0:
                inside = min(at + 0.5 * width, 1.0) - max(at - 0.5 * width, 0.0)
                coverage[i] *= min(max(inside / width, 0.0), 1.0)
            elif not 0.0 <= at <= 1.0:
                coverage[i] = 0.0
            places[i, j] = at if math.isfinite(at) else 0.0


@kernel
def find_seen_bounds(  # type: ignore[no-untyped-def]
    face_ids, depths, rays, eye, near, starts, receives, axes, rounding, first, stop, bounds
):
    """Extend each object's bounds along a light's axes by its visible samples."""
    owner = 0
    for row in range(first, stop):
        for column in range(face_ids.shape[1]):
            face = face_ids[row, column]
            if face < 0:
                continue
            if not starts[owner] <= face < starts[owner + 1]:
                owner = object_of(face, starts)
            if not receives[owner]:
                continue
            distance = near / depths[row, column]
            x, y = column + 0.5, row + 0.5
            squared = 0.0
            for k in range(3):
                ray = rays[0, k] + x * rays[1, k] + y * rays[2, k]
                squared += ray * ray
            room = rounding * distance * math.sqrt(squared)
            for k in range(3):
                at = 0.0
                for j in range(3):
                    ray = rays[0, j] + x * rays[1, j] + y * rays[2, j]
                    at += axes[k, j] * (eye[j] + distance * ray)
                bounds[owner, 0, k] = min(bounds[owner, 0, k], at - room)
                bounds[owner, 1, k] = max(bounds[owner, 1, k], at + room)


# Maximum distance that snapping moves a corner along an axis, in texels.
SNAPPED = 0.5 / SUBPIXELS

# Twice the rounding error of a float32: once for the corners' depths, once for their mean.
ROUNDED = 2.0**-23


@kernel
def view_of(point, light):  # type: ignore[no-untyped-def]
    """Cube face that a point projects to, by its largest component."""
    face, largest = 0, -1.0
    for k in range(3):
        offset = point[k] - light[k]
        if abs(offset) > largest:
            largest = abs(offset)
            face = 2 * k if offset > 0.0 else 2 * k + 1
    return face


@kernel
def plane_of(face, positions, faces, anchor, inverse, plane):  # type: ignore[no-untyped-def]
    """Write the plane of a triangle in clip space, computed relative to `anchor`.

    `plane` receives (a, b, c, d) with a x + b y + c z + d w = 0; all 0 for a triangle without area.
    """
    p, q, r = positions[faces[face, 0]], positions[faces[face, 1]], positions[faces[face, 2]]
    offset = 0.0
    for k in range(4):
        plane[k] = 0.0
    for k in range(3):
        y, z = (k + 1) % 3, (k + 2) % 3
        normal = (q[y] - p[y]) * (r[z] - p[z]) - (q[z] - p[z]) * (r[y] - p[y])
        offset -= normal * anchor[k]
        for j in range(4):
            plane[j] += inverse[k, j] * normal
    for j in range(4):
        plane[j] += inverse[3, j] * offset


@kernel
def lit_share(place, slopes, own, world, maps, view, radius, scratch):  # type: ignore[no-untyped-def]
    """Lit share of the filter's square around a point.

    `place` is column and row of the point in texels, its depth, and its x/w and y/w; `slopes` is
    the growth of its plane's depth per texel to the right and down.
    """
    positions, faces = world
    depths, face_ids, inverses, is_cone = maps
    column, row, depth, x, y = place
    height, width = depths.shape[1], depths.shape[2]
    if not (-radius <= column <= width + radius and -radius <= row <= height + radius):
        return 1.0
    room = (abs(slopes[0]) + abs(slopes[1])) * SNAPPED
    lit, meeting, dark = 0.0, 0.0, 0.0
    last_face, there, right, down = -1, np.inf, 0.0, 0.0
    for j in range(math.floor(row - radius), math.floor(row + radius) + 1):
        tall = min(row + radius, j + 1.0) - max(row - radius, float(j)) if radius > 0.0 else 1.0
        for i in range(math.floor(column - radius), math.floor(column + radius) + 1):
            area = tall
            if radius > 0.0:
                area *= min(column + radius, i + 1.0) - max(column - radius, float(i))
            here = depth + (i + 0.5 - column) * slopes[0] + (j + 0.5 - row) * slopes[1]
            inside = 0 <= i < width and 0 <= j < height
            if is_cone and (here <= 0.0 or not inside):
                continue  # beyond the horizon of the point's plane, or outside the map
            # There are no casters outside the map of a directional light.
            seen = depths[view, j, i] if inside else np.float32(0.0)
            if seen <= 0.0 or seen <= here + room + ROUNDED * seen:
                lit += area
                continue
            face = face_ids[view, j, i]
            if face != last_face:
                last_face = face
                corner = positions[faces[face, 0]]
                plane_of(face, positions, faces, corner, inverses[view], scratch)
                # The plane of a triangle seen edge-on is unusable; the first test decides.
                there, right, down = np.inf, 0.0, 0.0
                if scratch[2] != 0.0:
                    there = -(scratch[0] * x + scratch[1] * y + scratch[3]) / scratch[2]
                    right = abs(scratch[0] / scratch[2]) * 2.0 / width
                    down = abs(scratch[1] / scratch[2]) * 2.0 / height
            least = depth + ROUNDED * max(abs(depth), seen)
            shades = there > least
            is_own = own[0] <= face < own[1]
            if shades and is_own:
                rise = abs(i + 0.5 - column) * max(right, abs(slopes[0]))
                rise += abs(j + 0.5 - row) * max(down, abs(slopes[1]))
                shades = seen > least + rise
            if shades:
                dark += area
            elif is_own:
                lit += area
            else:
                meeting += area
    # The surfaces cannot meet if no texel sees the point's own surface.
    if lit == 0.0:
        return 0.0 if dark + meeting > 0.0 else 1.0
    return (lit + meeting) / (lit + meeting + dark)


@kernel
def dim_by_shadow(  # type: ignore[no-untyped-def]
    points, normals, own_faces, own, world, views, maps, light, radius, directions, radiance, out
):
    """Write a light's radiance times the lit share from its shadow map."""
    plane, scratch, clip = np.empty(4), np.empty(4), np.empty(4)
    height, width = maps[0].shape[1], maps[0].shape[2]
    for i in range(len(points)):
        d, r = row_of(directions, i), row_of(radiance, i)
        facing, strength = 0.0, 0.0
        for k in range(3):
            facing += normals[i, k] * directions[d, k]
            strength = max(strength, radiance[r, k])
        share = 1.0
        # Points that face away from the light reflect nothing, so shadows are skipped.
        if facing > 0.0 and strength > 0.0:
            view = view_of(points[i], light) if len(views) > 1 else 0
            for j in range(4):
                clip[j] = views[view, j, 3]
                for k in range(3):
                    clip[j] += views[view, j, k] * points[i, k]
            plane_of(own_faces[i], world[0], world[1], points[i], maps[2][view], plane)
            if clip[3] > 0.0 and plane[2] != 0.0:
                x, y, depth = clip[0] / clip[3], clip[1] / clip[3], clip[2] / clip[3]
                slopes = (-plane[0] / plane[2] * 2.0 / width, plane[1] / plane[2] * 2.0 / height)
                place = ((0.5 + 0.5 * x) * width, (0.5 - 0.5 * y) * height, depth, x, y)
                if math.isfinite(place[0] + place[1] + depth + slopes[0] + slopes[1]):
                    share = lit_share(place, slopes, own, world, maps, view, radius, scratch)
        for k in range(3):
            out[i, k] = radiance[r, k] * share
