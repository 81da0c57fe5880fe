"""A picture thrown through space: where a surface lies in it, and how large a pixel is there.

A slide projector's matrix takes a point P of the world to s, t and q, each linear in P; the picture
is looked up at (s/q, t/q). From one pixel to the next P moves by dP in the plane of its triangle,
and by the rule of quotients the coordinate by

    d(s/q) = (ds - (s/q) dq) / q

with ds and dq the same linear functions of dP alone. dP is exact too: the ray of the next pixel,
r + dr, meets the plane with normal n at P + t dr - t (n·dr) / (n·r) r, to first order, where P lies
t times r before the eye.

Based on: Segal, Korobkin, van Widenfelt, Foran, Haeberli, "Fast shadows and lighting effects using
texture mapping", SIGGRAPH 1992. Departs from it in that the derivatives are taken per point.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray
from texbake.rendering.effect import RenderState
from texbake.rendering.effects.images import (
    LoadedImage,
    image_values,
    placed_image,
    with_levels,
)
from texbake.rendering.fragments import Floats, Fragments
from texbake.rendering.scene.textures import FILTERS_WITH_FOOTPRINT, ImageTexture
from texbake.texture.image import FloatImage

_NO_STEPS = np.empty((0, 2, 3))


def load_slide(
    texture: ImageTexture,
    pixels: FloatImage,
    *,
    filter_name: str,
    name: str,
    threads: int | None = None,
) -> LoadedImage:
    """Texels of a slide, with smaller levels where its filter has a footprint."""
    image = placed_image(
        texture, pixels, kind="color", filter_name=filter_name, uvs=None, name=name
    )
    return with_levels(image, threads=threads) if filter_name in FILTERS_WITH_FOOTPRINT else image


@kernel
def _steps_kernel(points, corners, faces, drawn_faces, places, rays, eye, out):  # type: ignore[no-untyped-def]
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


def pixel_steps(fragments: Fragments, state: RenderState) -> FloatArray:
    """(n, 2, 3) float64: how far points move in the world for one pixel to the right, and down.

    Not finite where a triangle is seen exactly edge-on.
    """
    drawn = fragments.drawn
    steps = np.empty((len(fragments), 2, 3))
    _steps_kernel(
        fragments.positions, drawn.positions, drawn.faces, fragments.drawn_faces, fragments.places,
        state.camera.view_rays(state.options.width, state.options.height),
        np.ascontiguousarray(state.camera.eye), steps,
    )  # fmt: skip
    return steps


@kernel
def _project_kernel(points, steps, matrix, places, changes, coverage):  # type: ignore[no-untyped-def]
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
            # The share of the pixel's own width that lies inside the picture.
            if width > 0.0:
                inside = min(at + 0.5 * width, 1.0) - max(at - 0.5 * width, 0.0)
                coverage[i] *= min(max(inside / width, 0.0), 1.0)
            elif not 0.0 <= at <= 1.0:
                coverage[i] = 0.0
            places[i, j] = at if math.isfinite(at) else 0.0


def thrown(
    image: LoadedImage, matrix: FloatArray, points: FloatArray, steps: FloatArray | None = None
) -> tuple[Floats, Floats]:
    """Look a picture up where a projector throws it onto points.

    Parameters
    ----------
    image
        By `load_slide`.
    matrix : (4, 4) float64
        World space to (s, t, r, q).
    points : (n, 3) float64
        World space.
    steps : (n, 2, 3) float64, optional
        By `pixel_steps`; None for points that are not those of pixels, which get level 0 of the
        picture, bilinear at the least.

    Returns
    -------
    values : (n, C) float32
        Anything where the coverage is 0.
    coverage : (n,) float32
        Share of the pixel inside the unit square, 0 behind the projector (q <= 0). Without steps 0
        or 1.
    """
    n = len(points)
    filtered = steps is not None and image.filter in FILTERS_WITH_FOOTPRINT
    places, coverage = np.empty((n, 2)), np.empty(n, np.float32)
    changes = np.zeros((n, 4), np.float32)
    _project_kernel(
        points, steps if filtered else _NO_STEPS, np.ascontiguousarray(matrix, np.float64),
        places, changes, coverage,
    )  # fmt: skip
    needs_changes = image.filter in FILTERS_WITH_FOOTPRINT
    return image_values(image, places, changes if needs_changes else None), coverage
