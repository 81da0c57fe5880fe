"""Normal maps: the mesh's normals replaced by those of an image.

In tangent space the normal is x T + y B + z N, with tangent and normal interpolated over the
triangle without renormalizing and B = w cross(N, T), normalized once at the end: what the bake
inverts. Tangents are those of the file, else MikkTSpace's, and made only for such a map.

Based on: Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", 2008.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.tangents import corner_tangents
from texbake.rendering.effect import (
    Call,
    Effect,
    RenderState,
    Result,
    Target,
    only_when_needed,
)
from texbake.rendering.effects.images import image_of, look_up
from texbake.rendering.effects.normals import MESH_NORMALS, finish_normal
from texbake.rendering.fragments import Fragments
from texbake.rendering.maps import normal_space
from texbake.rendering.raster.world import read_only
from texbake.rendering.request import RenderRequest


def _called_for(request: RenderRequest) -> Iterator[Call]:
    shaded = request.shaded if "normals" in request.keep else request.lit
    for index in shaded:
        if request.material(index).normal_map is not None:
            yield Call(index, request.name(index), "its material has a normal map")


def _needs(request: RenderRequest, target: Target) -> Iterator[str]:
    assert target is not None
    yield "images"
    holder = request.material(target).normal_map
    assert holder is not None
    if (holder.space or normal_space(holder.texture.image)) == "tangent":
        yield from ("vertex normals", "tangents")


def _load_tangents(state: RenderState, target: Target) -> npt.NDArray[np.float32]:
    assert target is not None
    mesh = state.drawn(target).mesh
    tangents = corner_tangents(mesh) if mesh.tangents is None else mesh.tangents
    return read_only(tangents, np.float32)


@kernel
def _corner_frames(normals, corners, tangents, face, frames):  # type: ignore[no-untyped-def]
    """Write normal and tangent of a face's corners side by side, (3, 6)."""
    for k in range(3):
        for axis in range(3):
            frames[k, axis] = normals[corners[face, k], axis]
            frames[k, 3 + axis] = tangents[face, k, axis]


@kernel
def _bend_kernel(  # type: ignore[no-untyped-def]
    normals, corners, tangents, faces, weights, texels, strength, back_facing, back, out
):
    f = np.empty((3, 6))
    known = np.int32(-1)  # neighbors mostly lie on the same face
    for i in range(len(faces)):
        if faces[i] != known:
            known = faces[i]
            _corner_frames(normals, corners, tangents, known, f)
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
        if not 0.0 < x * x + y * y + z * z < np.inf:  # no direction: the surface's own
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
def _turn_kernel(texels, matrix, back_facing, back, out):  # type: ignore[no-untyped-def]
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


def _shade(fragments: Fragments, state: RenderState) -> None:
    target = fragments.target
    texels = look_up(fragments, state, "normal_map.texture")
    fragments.normals = np.empty((len(fragments), 3), np.float32)
    space = image_of(state, target, "normal_map.texture").space
    holder = fragments.drawn.material.normal_map
    assert holder is not None
    if space == "tangent":
        normals, corners = state.of(MESH_NORMALS, target)
        _bend_kernel(
            normals, corners, state.of(MESH_TANGENTS, target), fragments.faces,
            fragments.weights, texels, float(holder.strength), fragments.back_facing,
            state.camera.axes[2], fragments.normals,
        )  # fmt: skip
        return
    inverse = fragments.drawn.object_from_world
    matrix = np.eye(3)
    if space == "object" and inverse is not None:
        matrix = np.ascontiguousarray(inverse[:3, :3].T)
    _turn_kernel(texels, matrix, fragments.back_facing, state.camera.axes[2], fragments.normals)


MESH_TANGENTS = Result(_load_tangents)

TANGENTS = Effect(
    name="tangents",
    does="finds MikkTSpace tangents",
    called_for=only_when_needed,
    left_out="nothing in the picture is told in tangent space",
    needs=lambda request, target: ("vertex normals", "texture coordinates"),
    load=MESH_TANGENTS,
)

NORMAL_MAP = Effect(
    name="normal map",
    does="takes normals from an image",
    called_for=_called_for,
    left_out="no lit material in the picture has a normal map",
    needs=_needs,
    shade=_shade,
)
