"""Parallax occlusion: texture coordinates moved to where the eye's ray meets heights below.

White is the surface itself and black lies `depth` below it. The ray goes straight on below the
surface, in the plane across its normal, until it is no higher than the map there. It is followed in
even steps, one per texel that it crosses but no more than `layers` in all, so that the more slanted
the view is, the more there are. Between the last step above the map and the first below it, where
it meets is found by the rule of false position (Illinois), which is exact where the map is linear.

All later lookups of the object are made there. Nothing else is changed: neither depth nor normals,
and derivatives stay those of the surface. The outline is that of the mesh; a ray that leaves the
texture goes on in what the texture has beyond its border. At grazing angles the ray is followed
for at most one unit of texture coordinates, and where the surface is seen from the other side of
its normal nothing is moved.

`depth` is in units of texture coordinates. Where those are stretched, one unit is the side of the
square that is as large as what one unit square of the texture covers there.

Based on: Policarpo, Oliveira, Comba, "Real-time relief mapping on arbitrary polygonal surfaces",
I3D 2005; Tatarchuk, "Dynamic parallax occlusion mapping with approximate soft shadows", I3D 2006.
Departs from them in that steps are counted in texels, and that the ray is turned into texture space
by the derivatives of the triangle itself, which tangents only approximate.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from texbake.mesh.mesh import FloatArray
from texbake.rendering.effect import Call, Effect, RenderState, Result, Target
from texbake.rendering.effects.images import LoadedImage, image_of
from texbake.rendering.effects.normals import interpolated_normals
from texbake.rendering.effects.points import steps_along_texture
from texbake.rendering.fragments import Floats, Fragments
from texbake.rendering.kernels.relief import follow_rays
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.textures import FILTERS_WITH_FOOTPRINT
from texbake.texture.lookup import wrap_code
from texbake.texture.sample import mip_levels

_NAME = "parallax.texture"


@dataclass(frozen=True, eq=False)
class TextureSlopes:
    """How texture coordinates grow along each face.

    Attributes
    ----------
    slopes : (F, 2, 3) float64
        Growth of u and of v along the axes of the world, of faces that have any.
    sizes : (F,) float64
        World length of one unit of texture coordinates; 0 where there is none.
    """

    slopes: FloatArray
    sizes: FloatArray

    @property
    def n_bytes(self) -> int:
        """Memory that it takes."""
        return self.slopes.nbytes + self.sizes.nbytes


def _called_for(request: RenderRequest) -> Iterator[Call]:
    for index in request.shaded:
        if request.material(index).parallax is not None:
            yield Call(index, request.name(index), "its material has a parallax map")


def _load(state: RenderState, target: Target) -> TextureSlopes:
    assert target is not None
    mesh = state.drawn(target).mesh
    corners = mesh.positions[mesh.faces]
    edges = corners[:, 1:] - corners[:, :1]
    along = steps_along_texture(mesh.corner_uvs()).reshape(-1, 2, 2) @ edges  # P_u and P_v
    across = np.cross(along[:, 0], along[:, 1])
    areas = np.linalg.norm(across, axis=1)
    squared = np.where(areas > 0.0, areas, np.inf)[:, None] ** 2
    slopes = np.stack(
        [np.cross(along[:, 1], across) / squared, np.cross(across, along[:, 0]) / squared], axis=1
    )
    return TextureSlopes(slopes, np.sqrt(areas))


def _ways(fragments: Fragments, state: RenderState, depth: float) -> FloatArray:
    """(n, 2) float64: how far in (u, v) the eye's ray gets while it falls by `depth`."""
    known = state.of(TEXTURE_SLOPES, fragments.target)
    assert fragments.to_eye is not None
    normals = interpolated_normals(fragments, state).astype(np.float64)
    to_eye = fragments.to_eye.astype(np.float64)
    facing = np.einsum("ij,ij->i", normals, to_eye)
    along = facing[:, None] * normals - to_eye
    ways = np.einsum("ijk,ik->ij", known.slopes[fragments.faces], along)
    falls = np.divide(
        depth * known.sizes[fragments.faces], facing, out=np.zeros_like(facing), where=facing > 0.0
    )
    ways *= falls[:, None]
    return np.where(np.isfinite(ways).all(axis=1, keepdims=True), ways, 0.0)


def _shade(fragments: Fragments, state: RenderState) -> None:
    holder = fragments.drawn.material.parallax
    uvs, uv_changes = fragments.uvs, fragments.uv_changes
    assert holder is not None and uvs is not None
    ways = _ways(fragments, state, holder.depth)
    image = image_of(state, fragments.target, _NAME)
    starts, steps = uvs, ways
    if image.turn is not None:
        starts, steps = uvs @ image.turn.T + image.offset, ways @ image.turn.T
    fragments.uvs = uvs + _shares(image, starts, steps, uv_changes, holder.layers)[:, None] * ways


def _shares(
    image: LoadedImage, starts: FloatArray, steps: FloatArray, changes: Floats | None, layers: int
) -> FloatArray:
    """(n,) float64: which share of its way to the lowest level each ray goes."""
    chain = image.chain
    levels = np.zeros(len(starts), np.int64)
    if image.filter in FILTERS_WITH_FOOTPRINT:
        assert changes is not None
        if image.turn is not None:
            turned = changes.reshape(-1, 2, 2) @ image.turn.T.astype(np.float32)
            changes = turned.reshape(-1, 4)
        found = mip_levels(changes, chain.width, chain.height, threads=1)
        levels = np.clip(np.nan_to_num(found, nan=0.0), 0, chain.n_levels - 1).astype(np.int64)
    shares = np.empty(len(starts))
    follow_rays(
        chain.texels, chain.offsets, chain.sizes, wrap_code(image.wrap), image.border[0],
        image.factor[0], np.ascontiguousarray(starts), np.ascontiguousarray(steps), levels, layers,
        shares,
    )  # fmt: skip
    return shares


TEXTURE_SLOPES = Result(_load)

PARALLAX = Effect(
    name="parallax",
    does="moves texture coordinates to where the view ray meets the heights",
    called_for=_called_for,
    left_out="no material in the picture has a parallax map",
    needs=lambda request, target: ("images", "view directions", "vertex normals"),
    load=TEXTURE_SLOPES,
    shade=_shade,
)
