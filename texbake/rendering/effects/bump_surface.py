"""A surface that a height is laid over: its frame at fragments, and the height about them.

Everything is told in the object's own space, in whose units heights are. P(u, v) is a point of a
triangle, N the shading normal that the fragment has. P_u and P_v are those of the triangle, turned
into the plane across N; N_u and N_v those of the mesh's normals, interpolated over the triangle and
normalized.

The height is looked up one texel apart, or one pixel where that is more. Within a texel it is
linear, so shorter steps would show the texels as facets; over less than a pixel there is nothing to
be seen. A procedure in space has no texture coordinates: there u and v are lengths along the
triangle, and the step is a pixel. Where a triangle has no area, in space or on the texture, there
is no frame.

Based on: Blinn, "Simulation of wrinkled surfaces", SIGGRAPH 1978; Mikkelsen, "Bump mapping
unparametrized surfaces on the GPU", 2010, for slopes without texture coordinates.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from texbake.kernels import kernel
from texbake.mesh.compose import transformed_normals
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.rendering.effect import RenderState, Target
from texbake.rendering.effects.images import image_of, look_up
from texbake.rendering.effects.normals import MESH_NORMALS
from texbake.rendering.effects.slots import procedure_values
from texbake.rendering.fragments import Fragments
from texbake.rendering.raster.world import read_only
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.material import BumpMap
from texbake.rendering.scene.textures import ImageTexture
from texbake.rendering.surface_steps import steps_along_surface, steps_along_texture

_NAME = "bump_map.texture"


@dataclass(frozen=True, kw_only=True, eq=False)
class BumpSurface:
    """A surface in its object's space, by corners of its faces once placed.

    Attributes
    ----------
    positions, faces : (V, 3) float64, (F, 3) int32
    normals, normal_faces : (N, 3) float64, (F, 3) int32
    steps : (F, 4) float64
        Growth of the weights for one more u, then v.
    to_object, to_world : (3, 3) float64
        What takes normals there and back, up to their length.
    directions_to_object : (3, 3) float64
        What takes directions there.
    """

    positions: FloatArray
    faces: IntArray
    normals: FloatArray
    normal_faces: IntArray
    steps: FloatArray
    to_object: FloatArray
    to_world: FloatArray
    directions_to_object: FloatArray

    @property
    def n_bytes(self) -> int:
        """Memory that nothing else holds."""
        return self.steps.nbytes


def is_over_uvs(holder: BumpMap) -> bool:
    """Whether d is a function of texture coordinates and not of the point in space."""
    return isinstance(holder.texture, ImageTexture) or holder.texture.space == "uv"


def bump_of(request: RenderRequest, target: Target) -> BumpMap:
    """Return the bump map of an object that has one."""
    assert target is not None
    holder = request.material(target).bump_map
    assert holder is not None
    return holder


def bump_surface(state: RenderState, target: Target) -> BumpSurface:
    """Surface of an object with a bump map, for any camera."""
    assert target is not None
    item = state.scene.objects[target]
    mesh = state.drawn(target).mesh
    linear = np.eye(3) if item.transform is None else item.transform[:3, :3]
    inverse: FloatArray = np.asarray(np.linalg.inv(linear), np.float64)
    normals, corners = state.of(MESH_NORMALS, target)
    if item.transform is not None:
        normals = transformed_normals(normals, inverse)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = normals / np.where(lengths > 0.0, lengths, 1.0)
    points = item.mesh.positions
    steps = (
        steps_along_texture(mesh.corner_uvs())
        if is_over_uvs(bump_of(state.request, target))
        else steps_along_surface(points[mesh.faces])
    )
    return BumpSurface(
        positions=read_only(points, np.float64),
        faces=read_only(mesh.faces, np.int32),
        normals=read_only(normals, np.float64),
        normal_faces=read_only(corners, np.int32),
        steps=read_only(steps, np.float64),
        to_object=np.ascontiguousarray(linear.T),
        to_world=np.ascontiguousarray(inverse.T),
        directions_to_object=inverse,
    )


@kernel
def _steps_kernel(positions, faces, of_fragments, changes, out):  # type: ignore[no-untyped-def]
    """Width of a pixel along the surface, for both axes."""
    for i in range(len(of_fragments)):
        a, b, c = faces[of_fragments[i]]
        right, down = 0.0, 0.0
        for k in range(3):
            along, up = positions[b, k] - positions[a, k], positions[c, k] - positions[a, k]
            right += (changes[i, 0] * along + changes[i, 1] * up) ** 2
            down += (changes[i, 2] * along + changes[i, 3] * up) ** 2
        out[i, 0] = out[i, 1] = math.sqrt(max(right, down))


def lookup_steps(fragments: Fragments, state: RenderState, surface: BumpSurface) -> FloatArray:
    """(n, 2) float64: how far apart d is looked up along u, and along v."""
    holder = bump_of(state.request, fragments.target)
    if not is_over_uvs(holder):
        steps = np.empty((len(fragments), 2))
        _steps_kernel(surface.positions, surface.faces, fragments.faces, fragments.changes, steps)
        return steps
    assert fragments.uv_changes is not None
    pixels = np.abs(fragments.uv_changes.reshape(-1, 2, 2)).max(axis=1).astype(np.float64)
    if not isinstance(holder.texture, ImageTexture):
        return np.asarray(pixels)
    image = image_of(state, fragments.target, _NAME)
    turn = np.eye(2) if image.turn is None else image.turn
    # Texels that one more u, and one more v, are.
    scales = np.linalg.norm(turn * [[image.chain.width], [image.chain.height]], axis=0)
    texels = np.divide(1.0, scales, out=np.zeros(2), where=scales > 0.0)
    return np.asarray(np.maximum(pixels, texels))


def heights_at(
    fragments: Fragments, state: RenderState, surface: BumpSurface, shifts: FloatArray
) -> FloatArray:
    """(n,) float64: d some way (n or 1, 2) in (u, v) from fragments, in units of the object."""
    holder = bump_of(state.request, fragments.target)
    texture = holder.texture
    if is_over_uvs(holder):
        assert fragments.uvs is not None
        moved = replace(fragments, uvs=fragments.uvs + shifts)
    else:
        along = np.einsum("ij,ijk->ik", shifts, surface.steps[fragments.faces].reshape(-1, 2, 2))
        moved = replace(fragments, weights=fragments.weights + along)
    values = (
        look_up(moved, state, _NAME)
        if isinstance(texture, ImageTexture)
        else procedure_values(moved, texture, 1)
    )
    return np.asarray(values[:, 0] * np.float64(holder.height))


@kernel
def dot(a, b):  # type: ignore[no-untyped-def]
    """Dot product of two vectors of three numbers."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def turned(matrix, x, y, z, out):  # type: ignore[no-untyped-def]
    """Write a vector taken through a (3, 3) map; return its length."""
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
    # Of what is interpolated only the part across N turns the unit normal, by its share of it.
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


def kernel_arrays(
    fragments: Fragments, surface: BumpSurface
) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Return a surface and fragments on it as the kernels take them."""
    return (
        (
            surface.positions, surface.faces, surface.normals, surface.normal_faces, surface.steps,
            surface.to_object,
        ),
        (fragments.faces, fragments.weights, fragments.normals, fragments.back_facing),
    )  # fmt: skip
