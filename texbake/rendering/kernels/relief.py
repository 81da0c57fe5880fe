"""Kernels of bump and parallax maps: tilting normals, embossing light and tracing heights.

Based on: Blinn, "Simulation of wrinkled surfaces", SIGGRAPH 1978; Mikkelsen, "Bump mapping
unparametrized surfaces on the GPU", 2010; Schlag, "Fast embossing effects on raster image data",
Graphics Gems IV, 1994; Tatarchuk, "Dynamic parallax occlusion mapping with approximate soft
shadows", I3D 2006.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel
from texbake.rendering.kernels.interpolation import finish_normal
from texbake.rendering.kernels.lighting import row_dot, row_of
from texbake.texture.interpolation import bilinear_cell, interpolate_cell, wrap_to_unit


@kernel
def measure_pixel_steps(positions, faces, of_fragments, changes, out):  # type: ignore[no-untyped-def]
    """Write the width of a pixel along the surface, for both axes."""
    for i in range(len(of_fragments)):
        a, b, c = faces[of_fragments[i]]
        right, down = 0.0, 0.0
        for k in range(3):
            along, up = positions[b, k] - positions[a, k], positions[c, k] - positions[a, k]
            right += (changes[i, 0] * along + changes[i, 1] * up) ** 2
            down += (changes[i, 2] * along + changes[i, 3] * up) ** 2
        out[i, 0] = out[i, 1] = math.sqrt(max(right, down))


@kernel
def dot(a, b):  # type: ignore[no-untyped-def]
    """Dot product of two vectors of three numbers."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def turned(matrix, x, y, z, out):  # type: ignore[no-untyped-def]
    """Write a vector transformed by a (3, 3) matrix; return its length."""
    for k in range(3):
        out[k] = matrix[k, 0] * x + matrix[k, 1] * y + matrix[k, 2] * z
    return math.sqrt(dot(out, out))


@kernel
def frame_at(i, surface, fragments, frame):  # type: ignore[no-untyped-def]
    """Write N, P_u, P_v, N_u and N_v at a fragment; return (P_u x P_v)·N, 0 without a frame."""
    positions, faces, normals, normal_faces, steps, to_object = surface
    of_fragments, weights, shading, sides = fragments
    face, side = of_fragments[i], -1.0 if sides[i] else 1.0
    length = turned(to_object, shading[i, 0], shading[i, 1], shading[i, 2], frame[0])
    if not length > 0.0:
        return 0.0
    squared = 0.0
    for k in range(3):
        frame[0, k] *= side / length
        a, b, c = faces[face]
        along, up = positions[b, k] - positions[a, k], positions[c, k] - positions[a, k]
        frame[1, k] = steps[face, 0] * along + steps[face, 1] * up
        frame[2, k] = steps[face, 2] * along + steps[face, 3] * up
        a, b, c = normal_faces[face]
        along, up = normals[b, k] - normals[a, k], normals[c, k] - normals[a, k]
        frame[3, k] = steps[face, 0] * along + steps[face, 1] * up
        frame[4, k] = steps[face, 2] * along + steps[face, 3] * up
        squared += (normals[a, k] + weights[i, 0] * along + weights[i, 1] * up) ** 2
    # Only the derivative's part orthogonal to N turns the unit normal, divided by N's length.
    size = math.sqrt(squared) if squared > 0.0 else np.inf
    for row in range(1, 5):
        off = dot(frame[row], frame[0])
        for k in range(3):
            frame[row, k] = (frame[row, k] - off * frame[0, k]) / (1.0 if row < 3 else size)
    n, u, v = frame[0], frame[1], frame[2]
    return (
        n[0] * (u[1] * v[2] - u[2] * v[1])
        + n[1] * (u[2] * v[0] - u[0] * v[2])
        + n[2] * (u[0] * v[1] - u[1] * v[0])
    )


@kernel
def tilt_normals(surface, fragments, to_world, heights, slopes, back, out):  # type: ignore[no-untyped-def]
    """Write normals tilted by heights and their slopes."""
    frame, bumped = np.empty((5, 3)), np.empty(3)
    shading, sides = fragments[2], fragments[3]
    for i in range(len(slopes)):
        area = frame_at(i, surface, fragments, frame)
        if area == 0.0 or not math.isfinite(area):
            for k in range(3):
                out[i, k] = shading[i, k]
            continue
        for k in range(3):
            frame[1, k] += slopes[i, 0] * frame[0, k] + heights[i] * frame[3, k]
            frame[2, k] += slopes[i, 1] * frame[0, k] + heights[i] * frame[4, k]
        u, v = frame[1], frame[2]
        turned(
            to_world,
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
            bumped,
        )
        side = -1.0 if sides[i] != (area < 0.0) else 1.0
        finish_normal(bumped[0], bumped[1], bumped[2], side, back, out[i])


@kernel
def find_light_steps(surface, fragments, directions, to_object, steps, shifts, lengths):  # type: ignore[no-untyped-def]
    """Write the step (L_u, L_v) along the light, and its length."""
    frame, light = np.empty((5, 3)), np.empty(3)
    for i in range(len(steps)):
        shifts[i, 0], shifts[i, 1], lengths[i] = 0.0, 0.0, 0.0
        area = frame_at(i, surface, fragments, frame)
        d = row_of(directions, i)
        size = turned(to_object, directions[d, 0], directions[d, 1], directions[d, 2], light)
        u, v = frame[1], frame[2]
        uu, uv, vv = dot(u, u), dot(u, v), dot(v, v)
        if area == 0.0 or not size > 0.0:
            continue
        along, up = dot(light, u) / size, dot(light, v) / size
        x = -(along * vv - up * uv) / (uu * vv - uv * uv)
        y = -(up * uu - along * uv) / (uu * vv - uv * uv)
        longest = max(abs(x) / steps[i, 0], abs(y) / steps[i, 1])
        if 0.0 < longest < np.inf:
            lengths[i] = 0.5 / longest
            shifts[i, 0], shifts[i, 1] = x * lengths[i], y * lengths[i]


@kernel
def add_embossed(normals, directions, radiance, base, metalness, lifts, out):  # type: ignore[no-untyped-def]
    """Add the slope of a height along the light to diffuse light."""
    for i in range(len(normals)):
        d, r, b = row_of(directions, i), row_of(radiance, i), row_of(base, i)
        facing = row_dot(normals, i, directions, d)
        if facing > 0.0:
            added = max(lifts[i], -facing) * (1.0 - metalness[row_of(metalness, i), 0])
            for k in range(3):
                out[i, k] += radiance[r, k] * base[b, k] * added


# Maximum number of rounds of false position, and its tolerance as a share of the depth: 1/16 of a
# 16-bit step.
REFINEMENTS = 8

CLOSE = 2.0**-20


@kernel
def height_above(texels, level, outside, ray, share):  # type: ignore[no-untyped-def]
    """Height of the ray above the map at a share of its way down from 1 to 0."""
    first, width, height, wrap = level
    border, factor = outside
    u, v = wrap_to_unit(ray[0] + share * ray[2], wrap), wrap_to_unit(ray[1] + share * ray[3], wrap)
    cell, x, y = bilinear_cell(u, v, width, height, wrap, first)
    return 1.0 - share - np.float64(factor * interpolate_cell(texels, cell, x, y, 0, border))


@kernel
def met(texels, level, outside, ray, near, above, far, below):  # type: ignore[no-untyped-def]
    """Find the intersection with the map between a position above it and one below."""
    share, side = far, 0
    for _ in range(REFINEMENTS):
        share = near + (far - near) * above / (above - below)
        there = height_above(texels, level, outside, ray, share)
        if abs(there) <= CLOSE:
            break
        # Illinois variant: halve the value of an end that is kept twice in a row.
        if there > 0.0:
            near, above = share, there
            below *= 0.5 if side > 0 else 1.0
            side = 1
        else:
            far, below = share, there
            above *= 0.5 if side < 0 else 1.0
            side = -1
    return share


@kernel
def follow_rays(  # type: ignore[no-untyped-def]
    texels, offsets, sizes, wrap, border, factor, starts, steps, levels, layers, shares
):
    """Write the share of its way at which each ray meets the map."""
    outside = (border, factor)
    for i in range(len(starts)):
        height, width = sizes[levels[i], 0], sizes[levels[i], 1]
        level = (offsets[levels[i]], width, height, wrap)
        ray = (starts[i, 0], starts[i, 1], steps[i, 0], steps[i, 1])
        last = 1.0 / max(math.hypot(ray[2], ray[3]), 1.0)
        crossed = math.hypot(last * ray[2] * width, last * ray[3] * height)
        n = max(min(math.ceil(crossed), layers), 1)
        near, far, k = 0.0, 0.0, 0
        above = below = height_above(texels, level, outside, ray, 0.0)
        while below > 0.0 and k < n:
            k += 1
            near, above, far = far, below, last * k / n
            below = height_above(texels, level, outside, ray, far)
        if k > 0 and below < 0.0:
            far = met(texels, level, outside, ray, near, above, far, below)
        shares[i] = far
