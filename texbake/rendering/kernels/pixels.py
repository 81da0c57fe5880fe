"""Compositing layers, summing samples and averaging pixels.

Based on: Porter and Duff, "Compositing digital images", SIGGRAPH 1984.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel
from texbake.rendering.raster.world import (
    object_of,
)


@kernel
def mark_seen_objects(face_ids, starts, seen, start, stop):  # type: ignore[no-untyped-def]
    """Mark the objects that are visible in some sample."""
    owner = 0
    for row in range(start, stop):
        for column in range(face_ids.shape[1]):
            face = face_ids[row, column]
            if face < 0:
                continue
            if not starts[owner] <= face < starts[owner + 1]:
                owner = object_of(face, starts)
            seen[owner] = True


@kernel
def put_layer_behind(of_samples, colors, opacity, directions, light, passed, normals, seen):  # type: ignore[no-untyped-def]
    """Composite a layer behind the layers in front of it."""
    for j in range(of_samples.shape[0]):
        for i in range(of_samples.shape[1]):
            fragment = of_samples[j, i]
            if fragment < 0:
                continue
            share = passed[j, i] * opacity[fragment]
            if share > 0.0:
                seen[j, i] = True
            for k in range(3):
                light[j, i, k] += share * colors[fragment, k]
                if len(directions) > 0:
                    normals[j, i, k] += share * directions[fragment, k]
            passed[j, i] *= np.float32(1.0) - opacity[fragment]


@kernel
def sum_samples(light, passed, normals, seen, first_row, side, color, coverage, normal_sums):  # type: ignore[no-untyped-def]
    """Add the samples of some rows to their pixels."""
    for j in range(light.shape[0]):
        row = first_row + j // side
        for i in range(light.shape[1]):
            column = i // side
            for k in range(3):
                color[row, column, k] += light[j, i, k]
                if len(normals) > 0:
                    normal_sums[row, column, k] += normals[j, i, k]
            color[row, column, 3] += np.float32(1.0) - passed[j, i]
            if seen[j, i]:
                coverage[row, column] += np.float32(1.0)


@kernel
def find_nearest(face_ids, depths, side, near, ids_out, depths_out):  # type: ignore[no-untyped-def]
    """Write the nearest triangle in each pixel and its distance."""
    for row in range(ids_out.shape[0]):
        for column in range(ids_out.shape[1]):
            nearest = np.float32(0.0)
            for j in range(row * side, (row + 1) * side):
                for i in range(column * side, (column + 1) * side):
                    if depths[j, i] > nearest:
                        nearest = depths[j, i]
                        ids_out[row, column] = face_ids[j, i]
            if nearest > 0.0:
                depths_out[row, column] = near / nearest


@kernel
def add_fragments(pixels, counts, light, normals, color, coverage, normal_sums):  # type: ignore[no-untyped-def]
    """Add opaque fragments to their pixels."""
    for i in range(len(pixels)):
        pixel, count = pixels[i], counts[i]
        for k in range(3):
            color[pixel, k] += count * light[i, k]
        color[pixel, 3] += count
        coverage[pixel] += count
        if len(normals) > 0:
            for k in range(3):
                normal_sums[pixel, k] += count * normals[i, k]


@kernel
def finish_pixels(color, coverage, normals, n_samples, behind, opaque, start, stop):  # type: ignore[no-untyped-def]
    """Divide sums by the samples, and composite over the background."""
    for row in range(start, stop):
        for column in range(color.shape[1]):
            coverage[row, column] /= n_samples
            hiding = min(np.float64(color[row, column, 3]), n_samples)
            j = row if behind.shape[0] > 1 else 0
            i = column if behind.shape[1] > 1 else 0
            for k in range(3):
                light = np.float64(color[row, column, k])
                if opaque:
                    light = (light + (n_samples - hiding) * behind[j, i, k]) / n_samples
                elif hiding > 0.0:
                    # Not premultiplied: the color is that of the surface, whatever its coverage.
                    light /= hiding
                color[row, column, k] = light
            color[row, column, 3] = 1.0 if opaque else hiding / n_samples
            if len(normals) > 0:
                x, y, z = normals[row, column]
                length = np.sqrt(x * x + y * y + z * z)
                if length > 0.0:
                    for k in range(3):
                        normals[row, column, k] /= length
