"""Where fragments lie: in the world, seen from the eye, and on the texture.

Three effects that others need: world positions, unit vectors to the eye, and texture coordinates
with, where lookups are filtered over the pixel, their derivatives on the screen.

Based on: Heckbert, "Fundamentals of Texture Mapping and Image Warping", 1989. Departs from graphics
hardware in that derivatives are exact, from the plane of the triangle, and not differences of
neighboring pixels.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel
from texbake.rendering.effect import Effect, RenderState, Result, Target, only_when_needed
from texbake.rendering.fragments import Fragments


@kernel
def _positions_kernel(points, corners, faces, weights, out):  # type: ignore[no-untyped-def]
    for i in range(len(faces)):
        a, b, c = corners[faces[i], 0], corners[faces[i], 1], corners[faces[i], 2]
        weight1, weight2 = weights[i, 0], weights[i, 1]
        for k in range(3):
            # From the first corner: exact where weights are 0, whatever the size of coordinates.
            out[i, k] = (
                points[a, k]
                + weight1 * (points[b, k] - points[a, k])
                + weight2 * (points[c, k] - points[a, k])
            )


def _find_positions(fragments: Fragments, state: RenderState) -> None:
    drawn = fragments.drawn
    fragments.positions = np.empty((len(fragments), 3))
    _positions_kernel(
        drawn.positions, drawn.faces, fragments.drawn_faces, fragments.drawn_weights,
        fragments.positions,
    )  # fmt: skip


@kernel
def _to_eye_kernel(places, rays, out):  # type: ignore[no-untyped-def]
    for i in range(len(places)):
        squared = 0.0
        for k in range(3):
            ray = rays[0, k] + places[i, 0] * rays[1, k] + places[i, 1] * rays[2, k]
            out[i, k] = -ray
            squared += ray * ray
        scale = 1.0 / math.sqrt(squared)
        for k in range(3):
            out[i, k] *= scale


def _find_view(fragments: Fragments, state: RenderState) -> None:
    rays = state.camera.view_rays(state.options.width, state.options.height)
    fragments.to_eye = np.empty((len(fragments), 3), np.float32)
    _to_eye_kernel(fragments.places, rays, fragments.to_eye)


@kernel
def _uvs_kernel(uvs, corners, faces, weights, changes, out, changes_out):  # type: ignore[no-untyped-def]
    for i in range(len(faces)):
        a, b, c = corners[faces[i], 0], corners[faces[i], 1], corners[faces[i], 2]
        weight1, weight2 = weights[i, 0], weights[i, 1]
        for k in range(2):
            along, up = uvs[b, k] - uvs[a, k], uvs[c, k] - uvs[a, k]
            out[i, k] = uvs[a, k] + weight1 * along + weight2 * up
            if len(changes_out) > 0:
                changes_out[i, k] = changes[i, 0] * along + changes[i, 1] * up
                changes_out[i, 2 + k] = changes[i, 2] * along + changes[i, 3] * up


def _find_uvs(fragments: Fragments, state: RenderState) -> None:
    mesh = fragments.drawn.mesh
    assert mesh.uvs is not None and mesh.uv_faces is not None
    wanted = state.plan.has("derivatives", fragments.target)
    fragments.uvs = np.empty((len(fragments), 2))
    fragments.uv_changes = np.empty((len(fragments) if wanted else 0, 4), np.float32)
    _uvs_kernel(
        mesh.uvs, mesh.uv_faces, fragments.faces, fragments.weights, fragments.changes,
        fragments.uvs, fragments.uv_changes,
    )  # fmt: skip


def _require_uvs(state: RenderState, target: Target) -> None:
    assert target is not None
    state.drawn(target).mesh.corner_uvs()  # raises where there are none


POSITIONS = Effect(
    name="positions",
    does="finds the world position of fragments",
    called_for=only_when_needed,
    left_out="no light, texture or effect depends on where a point lies",
    shade=_find_positions,
)

VIEW_DIRECTIONS = Effect(
    name="view directions",
    does="finds the direction from fragments to the eye",
    called_for=only_when_needed,
    left_out="nothing looks different from another side",
    shade=_find_view,
)

# Computed together with the coordinates and the weights, and only with this in the plan.
DERIVATIVES = Effect(
    name="derivatives",
    does="finds how texture coordinates change from pixel to pixel",
    called_for=only_when_needed,
    left_out="no lookup is filtered over the pixel",
)

_REQUIRED_UVS = Result(_require_uvs)

TEXTURE_COORDINATES = Effect(
    name="texture coordinates",
    does="interpolates (u, v)",
    called_for=only_when_needed,
    left_out="nothing is looked up at (u, v)",
    load=_REQUIRED_UVS,
    shade=_find_uvs,
)
