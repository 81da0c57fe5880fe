"""Shading normals: those of the mesh, interpolated; none for what no light falls on.

Two effects: the normals of vertices, once a scene; and one unit vector a fragment, on the side that
is seen. A fragment without a normal, as on a face without area, gets the direction against the
view.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.normals import shading_normals
from texbake.rendering.effect import (
    Call,
    Effect,
    RenderState,
    Result,
    Target,
    only_when_needed,
)
from texbake.rendering.fragments import Floats, Fragments
from texbake.rendering.raster.world import read_only
from texbake.rendering.request import RenderRequest


def _load(state: RenderState, target: Target) -> tuple[FloatArray, IntArray]:
    assert target is not None
    normals, corners = shading_normals(state.drawn(target).mesh, threads=state.threads)
    return read_only(normals, np.float64), read_only(corners, np.int32)


def _called_for(request: RenderRequest) -> Iterator[Call]:
    if "normals" in request.keep:
        for index in request.shaded:
            if request.material(index).normal_map is None:
                yield Call(index, "the caller", "the frame keeps normals")


@kernel
def finish_normal(x, y, z, side, view, out):  # type: ignore[no-untyped-def]
    """Write a vector as a unit normal on the side seen; without length, against the view."""
    squared = x * x + y * y + z * z
    if 0.0 < squared < np.inf:
        scale = side / math.sqrt(squared)
        out[0], out[1], out[2] = x * scale, y * scale, z * scale
    else:
        out[0], out[1], out[2] = view[0], view[1], view[2]


@kernel
def _interpolate_kernel(normals, corners, faces, weights, back_facing, back, out):  # type: ignore[no-untyped-def]
    for i in range(len(faces)):
        a, b, c = corners[faces[i], 0], corners[faces[i], 1], corners[faces[i], 2]
        weight1, weight2 = weights[i, 0], weights[i, 1]
        weight0 = 1.0 - weight1 - weight2
        x = weight0 * normals[a, 0] + weight1 * normals[b, 0] + weight2 * normals[c, 0]
        y = weight0 * normals[a, 1] + weight1 * normals[b, 1] + weight2 * normals[c, 1]
        z = weight0 * normals[a, 2] + weight1 * normals[b, 2] + weight2 * normals[c, 2]
        finish_normal(x, y, z, -1.0 if back_facing[i] else 1.0, back, out[i])


def interpolated_normals(fragments: Fragments, state: RenderState) -> Floats:
    """(n, 3) float32: unit normals of the mesh, or of the finer triangles that are drawn."""
    drawn = fragments.drawn
    if drawn.normals is not None and drawn.normal_faces is not None:
        normals, corners = drawn.normals, drawn.normal_faces
        faces, weights = fragments.drawn_faces, fragments.drawn_weights
    else:
        normals, corners = state.of(MESH_NORMALS, fragments.target)
        faces, weights = fragments.faces, fragments.weights
    out = np.empty((len(fragments), 3), np.float32)
    _interpolate_kernel(
        normals, corners, faces, weights, fragments.back_facing, state.camera.axes[2], out
    )
    return out


def _shade(fragments: Fragments, state: RenderState) -> None:
    fragments.normals = interpolated_normals(fragments, state)


MESH_NORMALS = Result(_load)

VERTEX_NORMALS = Effect(
    name="vertex normals",
    does="finds the normals of vertices",
    called_for=only_when_needed,
    left_out="nothing in the picture has a side that light could fall on",
    load=MESH_NORMALS,
)

NORMALS = Effect(
    name="normals",
    does="interpolates normals",
    called_for=_called_for,
    left_out="no object in the picture is lit by the normals of its mesh",
    needs=lambda request, target: ("vertex normals",),
    shade=_shade,
)
