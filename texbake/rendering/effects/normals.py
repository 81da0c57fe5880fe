"""Shading normals: interpolated from the mesh, or taken from a normal map.

Unlit objects need no normals. A fragment without one, such as on a face without area, gets the
direction to the camera.

In tangent space the normal is x T + y B + z N. Tangent T and normal N are interpolated over the
triangle without renormalization, B = w cross(N, T), and the result is normalized once at the end;
this is the inverse of what baking does. Tangents are read from the file, or else computed by
MikkTSpace, and only for a tangent-space map. Those of MikkTSpace are turned with an image whose
texture coordinates are turned or mirrored.

Based on: Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", 2008.

Kernel: `core/shading_normals.c`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import Float32Array, FloatArray, IntArray
from texbake.mesh.normals import shading_normals
from texbake.mesh.tangents import image_axes, shading_tangents
from texbake.rendering.effect import Effect, RenderState
from texbake.rendering.effects.images import image_of, look_up
from texbake.rendering.effects.points import coordinates_effect, textured_mesh
from texbake.rendering.fragments import Fragments
from texbake.rendering.maps import normal_space
from texbake.rendering.rasterize import read_only
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.material import NormalMap


def mesh_normals(state: RenderState, target: int) -> tuple[FloatArray, IntArray]:
    """Shading normals (N, 3) of an object in world space, and their indices (F, 3)."""
    normals, corners = shading_normals(state.drawn(target).mesh, threads=state.threads)
    return read_only(normals, np.float64), read_only(corners, np.int32)


def interpolated_normals(fragments: Fragments, state: RenderState) -> Float32Array:
    """(n, 3) float32: unit normals of the mesh, or of its displaced and subdivided triangles."""
    drawn = fragments.drawn
    if drawn.normals is not None and drawn.normal_faces is not None:
        normals, corners = drawn.normals, drawn.normal_faces
        faces, weights = fragments.drawn_faces, fragments.drawn_weights
    else:
        normals, corners = state.of(mesh_normals, fragments.target)
        faces, weights = fragments.faces, fragments.weights
    out = np.empty((len(fragments), 3), np.float32)
    core.interpolate_normals(
        normals, corners, faces, weights, fragments.back_facing, state.camera.axes[2], out
    )
    return out


def _interpolate(fragments: Fragments, state: RenderState) -> None:
    fragments.normals = interpolated_normals(fragments, state)


VERTEX_NORMALS = Effect(
    name="vertex normals",
    does="computes vertex normals",
    after="procedures",
    left_out="nothing in the picture needs normals",
    load=mesh_normals,
)

NORMALS = Effect(
    name="normals",
    does="interpolates normals",
    after="projected textures",
    when=lambda request, index: (
        "normals" in request.keep and request.material(index).normal_map is None
    ),
    why="the frame keeps normals",
    requested_by="the caller",
    left_out="no object in the picture is lit by the normals of its mesh",
    needs=("vertex normals",),
    shade=_interpolate,
    rate="vertex",
    gives_normals=True,
)


def same_from_all_sides(request: RenderRequest, index: int) -> str:
    """Say why normals would change nothing; "" if they may."""
    return "" if request.needs_normals(index) else "its light is the same from all sides"


def _map_of(request: RenderRequest, target: int) -> NormalMap:
    holder = request.material(target).normal_map
    assert holder is not None
    return holder


def _frames_for_map(request: RenderRequest, target: int) -> Iterator[str]:
    holder = _map_of(request, target)
    if (holder.space or normal_space(holder.texture.image)) == "tangent":
        yield from ("vertex normals", "tangents")


def _mesh_tangents(state: RenderState, target: int) -> Float32Array:
    uv_set = _map_of(state.request, target).texture.uv_set
    return read_only(shading_tangents(textured_mesh(state, target).on_uv_set(uv_set)), np.float32)


def _look_up_normals(fragments: Fragments, state: RenderState) -> None:
    target = fragments.target
    texels = look_up(fragments, state, "normal_map.texture")
    fragments.normals = np.empty((len(fragments), 3), np.float32)
    image = image_of(state, target, "normal_map.texture")
    space = image.space
    if space == "tangent":
        has_own = textured_mesh(state, target).tangents is not None and image.uv_set is None
        if image.turn is not None and not has_own:
            texels[:, :2] = pm.matmul(texels[:, :2], image_axes(image.turn))
        normals, corners = state.of(mesh_normals, target)
        core.bend_normals(
            normals, corners, state.of(_mesh_tangents, target), fragments.faces,
            fragments.weights, texels, float(_map_of(state.request, target).strength),
            fragments.back_facing,
            state.camera.axes[2], fragments.normals,
        )  # fmt: skip
        return
    inverse = fragments.drawn.object_from_world
    matrix = np.eye(3)
    if space == "object" and inverse is not None:
        matrix = np.ascontiguousarray(inverse[:3, :3].T)
    core.turn_normals(
        texels, matrix, fragments.back_facing, state.camera.axes[2], fragments.normals
    )


TANGENTS = Effect(
    name="tangents",
    does="computes MikkTSpace tangents",
    after="normals",
    left_out="no map in the picture is in tangent space",
    needs=(
        "vertex normals",
        lambda request, target: coordinates_effect(_map_of(request, target).texture.uv_set),
    ),
    load=_mesh_tangents,
)

NORMAL_MAP = Effect(
    name="normal map",
    does="takes normals from an image",
    after="tangents",
    material_field="normal_map",
    among="with_normals",
    strength="strength",
    why="its material has a normal map",
    pointless=same_from_all_sides,
    left_out="no lit material in the picture has a normal map",
    needs=("images", _frames_for_map),
    shade=_look_up_normals,
    rate="vertex",
    gives_normals=True,
)
