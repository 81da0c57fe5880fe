"""Parallax occlusion mapping: shifts texture coordinates to where the view ray meets a height map.

White is the surface itself, and black lies `depth` below it. The view ray continues below the
surface until it meets the heights. It is followed in even steps, one per texel that it crosses but
at most `layers`, so slanted views take more steps.

All later lookups of the object use the shifted coordinates; depth, normals, derivatives and the
outline stay those of the surface. At grazing angles the ray is followed for at most one unit of
texture coordinates. Fragments seen from behind their normal are not shifted.

`depth` is in units of texture coordinates. On a stretched mapping, the length of one unit is the
square root of the surface area that a unit square of the texture covers. The ray is transformed to
texture space by the exact derivatives of the triangle, which tangents only approximate.

Kernel, which names the sources: `core/parallax.c`.
"""

from __future__ import annotations

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import Float32Array, FloatArray, Mesh
from texbake.records import dataclass
from texbake.rendering.effect import Effect, RenderState
from texbake.rendering.effects.images import LoadedImage, image_of
from texbake.rendering.effects.normals import interpolated_normals
from texbake.rendering.effects.points import steps_along_texture, textured_mesh
from texbake.rendering.fragments import Fragments
from texbake.rendering.scene.textures import FILTERS_WITH_FOOTPRINT
from texbake.texture.lookup import wrap_codes
from texbake.texture.sample import mip_levels

_NAME = "parallax.texture"


@dataclass(frozen=True, eq=False)
class TextureSlopes:
    """Gradients of texture coordinates on each face."""

    slopes: FloatArray  # (F, 2, 3): gradients of u and of v in world space; 0 on degenerate faces
    # (F,): world length of one unit of texture coordinates; 0 on degenerate faces
    sizes: FloatArray


def _texture_slopes(state: RenderState, target: int) -> TextureSlopes:
    mesh, holder = textured_mesh(state, target), state.request.material(target).parallax
    assert holder is not None
    corners = mesh.positions[mesh.faces]
    edges = corners[:, 1:] - corners[:, :1]
    steps = steps_along_texture(mesh.corner_uvs(holder.texture.uv_set))
    along = pm.matmul(steps.reshape(-1, 2, 2), edges)  # P_u and P_v
    across = np.cross(along[:, 0], along[:, 1])
    areas = pm.norm(across, axis=1)
    squared = np.where(areas > 0.0, areas, np.inf)[:, None] ** 2
    slopes = np.stack(
        [np.cross(along[:, 1], across) / squared, np.cross(across, along[:, 0]) / squared], axis=1
    )
    return TextureSlopes(slopes, np.sqrt(areas))


def _view_offsets(fragments: Fragments, state: RenderState, depth: float) -> FloatArray:
    """(n, 2) float64: distance in (u, v) that the view ray travels while it descends `depth`."""
    known = state.of(_texture_slopes, fragments.target)
    normals = interpolated_normals(fragments, state).astype(np.float64)
    to_eye = fragments.to_eye.astype(np.float64)
    facing = pm.vecdot(normals, to_eye)
    along = facing[:, None] * normals - to_eye
    ways = pm.matvec(known.slopes[fragments.faces], along)
    falls = np.divide(
        depth * known.sizes[fragments.faces], facing, out=np.zeros_like(facing), where=facing > 0.0
    )
    ways *= falls[:, None]
    return np.where(np.isfinite(ways).all(axis=1, keepdims=True), ways, 0.0)


def _shade(fragments: Fragments, state: RenderState) -> None:
    holder = fragments.drawn.material.parallax
    assert holder is not None
    uv_set = holder.texture.uv_set
    uvs, uv_changes = fragments.coordinates[uv_set]
    ways = _view_offsets(fragments, state, holder.depth)
    image = image_of(state, fragments.target, _NAME)
    starts, steps = image.place(uvs), image.direct(ways)
    shifts = _hit_positions(image, starts, steps, uv_changes, holder.layers)[:, None] * ways
    _move(fragments, textured_mesh(state, fragments.target), uv_set, shifts)


def _move(fragments: Fragments, mesh: Mesh, uv_set: str | None, shifts: FloatArray) -> None:
    """Shift coordinates on one set, and those of all other sets to the same place of the face."""
    weights = None
    for name, (uvs, changes) in fragments.coordinates.items():
        shift = shifts
        if name != uv_set:
            if weights is None:
                steps = steps_along_texture(mesh.corner_uvs(uv_set)[fragments.faces])
                weights = pm.vecmat(shifts, steps.reshape(-1, 2, 2))
            corners = mesh.corner_uvs(name)[fragments.faces]
            shift = pm.vecmat(weights, corners[:, 1:] - corners[:, :1])
        fragments.coordinates[name] = uvs + shift, changes


def _hit_positions(
    image: LoadedImage, starts: FloatArray, steps: FloatArray, changes: Float32Array, layers: int
) -> FloatArray:
    """(n,) float64: position of each hit along its ray, from 0 (surface) to 1 (deepest)."""
    chain = image.chain
    levels = np.zeros(len(starts), np.int64)
    if image.filter in FILTERS_WITH_FOOTPRINT:
        found = mip_levels(image.change(changes), chain.width, chain.height, threads=1)
        levels = np.clip(np.nan_to_num(found, nan=0.0), 0, chain.n_levels - 1).astype(np.int64)
    shares = np.empty(len(starts))
    core.follow_rays(
        chain.texels, chain.offsets, chain.sizes, wrap_codes(image.wrap), image.border[0],
        image.factor[0], np.ascontiguousarray(starts), np.ascontiguousarray(steps), levels, layers,
        shares,
    )  # fmt: skip
    return shares


PARALLAX = Effect(
    name="parallax",
    does="moves texture coordinates to where the view ray meets the heights",
    after="vertex normals",
    material_field="parallax",
    strength="depth",
    why="its material has a parallax map",
    pointless=lambda request, index: (
        ""
        if request.moves_textures(index)
        else "its material looks up nothing at texture coordinates"
    ),
    left_out="no material in the picture has a parallax map",
    needs=("images", "view directions", "vertex normals"),
    load=_texture_slopes,
    shade=_shade,
)
