"""Positions of fragments in world space, directions to the camera, and texture coordinates.

Effects that others need. Of several sets of texture coordinates only those are interpolated that
something looks up. Texture coordinates come with their screen-space derivatives if a
lookup is filtered over the pixel.

Based on: Heckbert, "Fundamentals of Texture Mapping and Image Warping", 1989. Unlike on graphics
hardware, derivatives are computed exactly from the plane of the triangle, not as differences of
neighboring pixels.

Kernel: `core/interpolation.c`.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.records import dataclass
from texbake.rendering.effect import Effect, RenderState
from texbake.rendering.fragments import Fragments
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.scene import apply_mapping, place_mesh


def textured_mesh(state: RenderState, target: int) -> Mesh:
    """Return the mesh of an object in world space, with the coordinates from its mapping."""
    mapped = state.get(map_mesh, target)
    return state.drawn(target).mesh if mapped is None else mapped.placed


def mapping_effect(request: RenderRequest, target: int) -> tuple[str, ...]:
    """Return the name of the effect that maps an object, if it has a mapping."""
    return () if request.scene.objects[target].mapping is None else ("mapping",)


@dataclass(frozen=True, eq=False)
class MappedMesh:
    """A mesh with the coordinates from its mapping, in object space and in world space."""

    mesh: Mesh
    placed: Mesh

    @property
    def n_bytes(self) -> int:
        """Memory of the coordinates in bytes."""
        uvs, faces = self.mesh.uvs, self.mesh.uv_faces
        return 0 if uvs is None or faces is None else uvs.nbytes + faces.nbytes


def map_mesh(state: RenderState, target: int) -> MappedMesh:
    """Give the mesh of an object the coordinates from its mapping."""
    item = apply_mapping(state.scene.objects[target], threads=state.threads)
    return MappedMesh(item.mesh, place_mesh(item))


def steps_along_texture(corner_uvs: FloatArray) -> FloatArray:
    """(F, 4) growth of barycentric weights per unit of u, then of v; 0 without area."""
    along, up = corner_uvs[:, 1] - corner_uvs[:, 0], corner_uvs[:, 2] - corner_uvs[:, 0]
    area = along[:, 0] * up[:, 1] - along[:, 1] * up[:, 0]
    return _divide_rows(np.stack([up[:, 1], -along[:, 1], -up[:, 0], along[:, 0]], axis=1), area)


def steps_along_surface(corners: FloatArray) -> FloatArray:
    """(F, 4) growth of barycentric weights along the first edge, then across to its left."""
    along, up = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    length = pm.norm(along, axis=1)
    area = pm.norm(np.cross(along, up), axis=1)
    shift = pm.vecdot(along, up)
    # In the plane of the triangle the corners are (0, 0), (length, 0) and (shift, area) / length.
    first = _divide_rows(np.stack([np.ones_like(length), np.zeros_like(length)], axis=1), length)
    second = _divide_rows(np.stack([-shift, length * length], axis=1), area * length)
    return np.where((area > 0.0)[:, None], np.concatenate([first, second], axis=1), 0.0)


def _divide_rows(rows: FloatArray, by: FloatArray) -> FloatArray:
    """Rows divided by numbers; 0 where the quotient overflows float64."""
    with np.errstate(all="ignore"):
        quotients = rows / by[:, None]
    return np.where(np.isfinite(quotients).all(axis=1, keepdims=True), quotients, 0.0)


def _find_positions(fragments: Fragments, state: RenderState) -> None:
    drawn = fragments.drawn
    fragments.positions = np.empty((len(fragments), 3))
    core.interpolate_positions(
        drawn.positions, drawn.faces, fragments.drawn_faces, fragments.drawn_weights,
        fragments.positions,
    )  # fmt: skip


def _find_view(fragments: Fragments, state: RenderState) -> None:
    rays = state.camera.view_rays(state.options.width, state.options.height)
    fragments.to_eye = np.empty((len(fragments), 3), np.float32)
    core.find_view_directions(fragments.places, rays, fragments.to_eye)


def _find_further_uvs(fragments: Fragments, state: RenderState) -> None:
    for name in state.request.uv_sets(fragments.target):
        _interpolate_uvs(fragments, state, name)


def _interpolate_uvs(fragments: Fragments, state: RenderState, name: str | None) -> None:
    uv_set = textured_mesh(state, fragments.target).uv_set(name)
    wanted = state.plan.has("derivatives", fragments.target)
    found = np.empty((len(fragments), 2))
    changes = np.empty((len(fragments) if wanted else 0, 4), np.float32)
    core.interpolate_uvs(
        uv_set.uvs, uv_set.faces, fragments.faces, fragments.weights, fragments.changes, found,
        changes,
    )  # fmt: skip
    fragments.coordinates[name] = found, changes


def coordinates_effect(uv_set: str | None) -> str:
    """Return the name of the effect that interpolates a set of texture coordinates."""
    return "texture coordinates" if uv_set is None else "further texture coordinates"


def _require_uvs(state: RenderState, target: int) -> None:
    textured_mesh(state, target).corner_uvs()  # raises if there are none


def _require_further_uvs(state: RenderState, target: int) -> None:
    for name in state.request.uv_sets(target):
        textured_mesh(state, target).uv_set(name)  # raises if there is none


MAPPING = Effect(
    name="mapping",
    does="gives meshes new texture coordinates",
    after="placing",
    left_out="no object has a mapping, or nothing reads its coordinates",
    load=map_mesh,
    moves_surface=True,
    deferred=True,
)

POSITIONS = Effect(
    name="positions",
    does="finds the world position of fragments",
    after="rendered environment",
    left_out="no light, texture or effect depends on where a point lies",
    shade=_find_positions,
)

VIEW_DIRECTIONS = Effect(
    name="view directions",
    does="finds the direction from fragments to the eye",
    after="shadows",
    left_out="nothing depends on the direction of view",
    shade=_find_view,
)

# Derivatives are computed together with coordinates and weights, if this effect is in the plan.
DERIVATIVES = Effect(
    name="derivatives",
    does="finds how texture coordinates change from pixel to pixel",
    after="view directions",
    left_out="no lookup is filtered over the pixel",
)

TEXTURE_COORDINATES = Effect(
    name="texture coordinates",
    does="interpolates texture coordinates",
    after="derivatives",
    left_out="nothing is looked up at (u, v)",
    needs=(mapping_effect,),
    load=_require_uvs,
    shade=partial(_interpolate_uvs, name=None),
)

FURTHER_COORDINATES = Effect(
    name="further texture coordinates",
    does="interpolates further sets of texture coordinates",
    after="texture coordinates",
    left_out="all textures lie on the first set",
    needs=(mapping_effect,),
    load=_require_further_uvs,
    shade=_find_further_uvs,
)
