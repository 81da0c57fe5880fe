"""Which points a projector of a texture sees: what faces away from it, and what is hidden from it.

With `facing`, a point gets the picture only if the projector and the camera are on the same side of
its triangle's plane, whichever way the triangle is wound. With `occlusion`, the scene is rasterized
from the projector, as for the shadow map of a light, and a point gets the share of the picture that
nothing hides.

The projector of a matrix stands where s, t and q are all 0. Clip space is (2s - q, 2t - q, z, q)
with a constant z, so that z/w falls with the distance.

Based on: Segal, Korobkin, van Widenfelt, Foran, Haeberli, "Fast shadows and lighting effects using
texture mapping", SIGGRAPH 1992, for pictures and shadow maps through one projection.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.mesh import FloatArray
from texbake.rendering.effect import RenderState
from texbake.rendering.effects.lights import PlacedLight
from texbake.rendering.effects.shadows import ShadowMap, shadowed_radiance
from texbake.rendering.fragments import Floats, Fragments, IncidentLight, one_row
from texbake.rendering.rasterize import SHOW_BACK, SKIP, rasterize
from texbake.rendering.scene.lights import Shadow
from texbake.rendering.scene.material import ProjectedTexture
from texbake.rendering.scene.transforms import projector_position

# Near plane relative to the depth of the farthest caster. Reversed depth keeps its precision.
_NEAR = 2.0**-20


@dataclass(frozen=True, eq=False)
class ProjectorView:
    """What a projector sees; `shadow` is None where nothing is in its picture to hide anything."""

    light: PlacedLight
    shadow: ShadowMap | None

    @property
    def n_bytes(self) -> int:
        """Memory of its depths."""
        return 0 if self.shadow is None else self.shadow.n_bytes


def projector_view(state: RenderState, item: ProjectedTexture) -> ProjectorView:
    """Rasterize the objects that cast shadows from the position of a projector."""
    matrix = item.world_matrix
    light = PlacedLight(
        kind="point",
        radiance=one_row((1.0, 1.0, 1.0), 3),
        position=np.ascontiguousarray(projector_position(matrix)),
        direction=np.array([0.0, 0.0, -1.0]),
        up=np.array([0.0, 1.0, 0.0]),
        cosines=(-1.0, -1.0),
        decay=0.0,
    )
    objects = state.scene.objects
    casters = [i for i, each in enumerate(objects) if each.casts_shadows]
    depths = [pm.matmul(state.drawn(i).positions, matrix[3, :3]) + matrix[3, 3] for i in casters]
    farthest = max((float(depth.max()) for depth in depths if len(depth)), default=0.0)
    if not farthest > 0.0:
        return ProjectorView(light, None)
    s, t, q = matrix[0], matrix[1], matrix[3]
    clip = np.stack([2.0 * s - q, 2.0 * t - q, [0.0, 0.0, 0.0, _NEAR * farthest], q])
    modes = np.full(len(objects), SKIP, np.uint8)
    modes[casters] = SHOW_BACK
    options = Shadow()
    seen = rasterize(
        state.world, clip, options.size, options.size, modes=modes, threads=state.threads
    )
    shadow = ShadowMap(
        views=clip[None],
        inverses=np.ascontiguousarray(pm.inv(clip)[None]),
        depths=seen.depths[None],
        face_ids=seen.face_ids[None],
        radius=options.filter_radius,
    )
    return ProjectorView(light, shadow)


def visibility_from(fragments: Fragments, state: RenderState, view: ProjectorView) -> Floats:
    """(n,) float32: share of the picture that reaches fragments."""
    if view.shadow is None:
        return np.ones(len(fragments), np.float32)
    first, stop = state.world.starts[fragments.target : fragments.target + 2]
    offsets = view.light.position - fragments.positions
    lengths = pm.norm(offsets, axis=1, keepdims=True)
    toward: Floats = (offsets / np.where(lengths > 0.0, lengths, 1.0)).astype(np.float32)
    # The direction to the projector stands for the normal: facing is a question of its own.
    found = shadowed_radiance(
        view.shadow, view.light, state.world, fragments.positions, toward,
        fragments.drawn_faces + np.int32(first),
        IncidentLight(directions=toward, radiance=view.light.radiance), own=(int(first), int(stop)),
    )  # fmt: skip
    return np.ascontiguousarray(found[:, 0])


def facing_projector(fragments: Fragments, state: RenderState, position: FloatArray) -> Floats:
    """(n,) float32: 1 where the camera sees the side that faces a position, else 0."""
    drawn = fragments.drawn
    a, b, c = np.moveaxis(drawn.positions[drawn.faces[fragments.drawn_faces]], 1, 0)
    normals = np.cross(b - a, c - a)
    to_eye, to_projector = (pm.vecdot(normals, place - a) for place in (state.camera.eye, position))
    return np.asarray(to_eye * to_projector > 0.0, np.float32)
