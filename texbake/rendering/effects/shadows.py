"""Shadow maps: rendering them, and dimming the light of lamps by them.

A map is rasterized for each light that casts shadows, unless no shadow can fall on anything in the
picture. Each texel holds the depth and the triangle that the light sees at its center.
`texbake.rendering.effects.shadow_fit` chooses the view. Partly transparent surfaces cast shadows as
if they were opaque.

The light at a point is multiplied by the unoccluded share of a square of texels around it
(percentage-closer filtering). The occlusion test has no bias to tune. A point's depth is valid only
at the point itself, while the surface gets nearer or farther across the filter's footprint. A texel
therefore occludes a point only if it passes these tests:

1. The plane of the point's triangle is extended to the center of the texel. The texel must lie in
   front of that plane by more than rounding.
2. The plane of the triangle in the texel is extended back to the point, and must lie in front of
   it, too. Two surfaces that meet between the point and the texel fail one of these tests: the
   first at a ridge, the second in a groove. This test is skipped if no texel around the point sees
   the point's own surface.
3. If the texel's triangle belongs to the point's own object, the surface in between may rise and
   fall on triangles smaller than a texel, as steeply as the steeper of the two. The texel must be
   nearer than that would allow.

In clip space depth z/w is linear in x/w and y/w on any plane, so extending a plane is a
multiplication by its slope, which is computed from the plane rather than from neighboring texels.
The only remaining bias is for rounding: snapping moves a corner by at most half a step of the
rasterizer's grid on either axis, which the slope turns into depth, and depths are float32.

Based on: Reeves, Salesin, Cook, "Rendering antialiased shadows with depth maps", SIGGRAPH 1987, for
the filter, here over an exact square instead of random samples; Isidoro, "Shadow mapping: GPU-based
tips and techniques", GDC 2006, for the receiver plane; Dou, Yan, Kerzner, Dai, Wyman, "Adaptive
depth bias for shadow maps", I3D 2014, for comparing planes at the texel's center; Williams,
"Casting curved shadows on curved surfaces", SIGGRAPH 1978, for shadow maps. The second and third
tests are original to this program.

Kernel: `core/shadow_maps.c`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import Float32Array, FloatArray, IntArray
from texbake.records import dataclass
from texbake.rendering.effect import Activation, Effect, Rejection, RenderState
from texbake.rendering.effects.lights import place_light, placed_light
from texbake.rendering.effects.shadow_fit import (
    Box,
    Pair,
    box_of,
    parallel_view,
    perspective_views,
    seen_bounds,
    shading_pairs,
)
from texbake.rendering.fragments import Fragments, IncidentLight
from texbake.rendering.rasterize import SHOW_BACK, SKIP, World, rasterize
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.lights import Light


@dataclass(frozen=True, eq=False)
class ShadowMap:
    """Depths and triangles seen from a light, in one view or the six faces of a cube."""

    # views, inverses (V, 4, 4): matrices from world to clip space, and their inverses
    views: FloatArray
    inverses: FloatArray
    # (V, H, W): z / w (greater is nearer to the light); 0 where the texel is empty
    depths: Float32Array
    face_ids: IntArray  # (V, H, W): triangle of the world; -1 where the texel is empty
    radius: float  # filter radius in texels
    position: FloatArray | None  # of the light; None for a directional one

    @property
    def n_bytes(self) -> int:
        """Memory of the map in bytes."""
        return self.depths.nbytes + self.face_ids.nbytes


def render_shadow_map(
    state: RenderState,
    views: FloatArray,
    shape: tuple[int, int],
    casters: Sequence[int],
    *,
    radius: float,
    position: FloatArray | None,
) -> ShadowMap:
    """Rasterize objects from a light, with `shape` rows and columns in each view."""
    modes = np.full(len(state.scene.objects), SKIP, np.uint8)
    modes[list(casters)] = SHOW_BACK
    found = [
        rasterize(state.world, view, shape[1], shape[0], modes=modes, threads=state.threads)
        for view in views
    ]
    return ShadowMap(
        views=views,
        inverses=np.ascontiguousarray(pm.inv(views)),
        depths=np.stack([item.depths for item in found]),
        face_ids=np.stack([item.face_ids for item in found]),
        radius=radius,
        position=position,
    )


def shadowed_radiance(
    shadow: ShadowMap,
    world: World,
    fragments: Fragments,
    normals: Float32Array,
    incident: IncidentLight,
) -> Float32Array:
    """(n, 3) float32: light of one lamp that arrives at fragments, with shadows."""
    out = np.empty((len(fragments), 3), np.float32)
    first, stop = world.starts[fragments.target : fragments.target + 2].tolist()
    is_point = shadow.position is not None
    core.dim_by_shadow(
        fragments.positions, normals, fragments.drawn_faces + np.int32(first), first, stop,
        world.positions, world.faces, shadow.views, shadow.depths, shadow.face_ids,
        shadow.inverses, is_point, shadow.position if is_point else np.zeros(3), shadow.radius,
        incident.directions, incident.radiance, out,
    )  # fmt: skip
    return out


def _pairs(
    request: RenderRequest, index: int, state: RenderState | None = None
) -> list[Pair] | str:
    """List pairs of casters and receivers for a light, or say why there are none."""
    objects = request.scene.objects
    casters = [i for i, item in enumerate(objects) if item.casts_shadows]
    receivers = [i for i in request.lit if objects[i].receives_shadows]
    if state is not None:
        receivers = [i for i in receivers if i in state.visible.objects]
    if index not in request.shining:
        return "it is dark"
    if not receivers:
        return "nothing that receives shadows is in the picture"
    if not casters:
        return "no object casts shadows"

    def box(i: int) -> Box | None:
        if state is not None:
            return box_of(state, i)
        return None if request.material(i).displacement is not None else objects[i].box_corners()

    boxes = {i: box(i) for i in {*casters, *receivers}}
    light = placed_light(request.light(index), request.camera)
    pairs = shading_pairs(light, {i: boxes[i] for i in casters}, {i: boxes[i] for i in receivers})
    return pairs or "its shadows fall on nothing that is in the picture"


def _map_reasons(request: RenderRequest, index: int) -> Iterator[str | Rejection]:
    if request.light(index).shadow is not None:
        found = _pairs(request, index)
        yield Rejection(found) if isinstance(found, str) else "it casts shadows"


def _unneeded(state: RenderState, target: int) -> str | None:
    found = _pairs(state.request, target, state)
    return found if isinstance(found, str) else None


def _light_shadow(state: RenderState, target: int) -> ShadowMap | None:
    """Rasterize the casters from a light; None if none is in front of a visible receiver."""
    light: Light = state.lights[target]
    placed = state.of(place_light, target)
    assert light.shadow is not None
    pairs = _pairs(state.request, target, state)
    assert not isinstance(pairs, str)
    casters = sorted({caster for caster, _ in pairs})
    boxes = {i: box_of(state, i) for i in casters}
    shape = (light.shadow.size, light.shadow.size)
    if light.kind == "directional":
        seen = seen_bounds(state, placed, sorted({receiver for _, receiver in pairs}))
        view = parallel_view(light, placed, [(boxes[i], seen[j]) for i, j in pairs])
        if view is None:
            return None
        views, shape = view[0][None], view[1]
    else:
        views = perspective_views(light, placed, list(boxes.values()))
    return render_shadow_map(
        state,
        views,
        shape,
        casters,
        radius=light.shadow.filter_radius,
        position=None if light.kind == "directional" else placed.position,
    )


def _dim(fragments: Fragments, state: RenderState, index: int, incident: IncidentLight) -> None:
    shadow = state.get(_light_shadow, index)
    if shadow is not None and state.plan.has("shadows", fragments.target):
        incident.radiance = shadowed_radiance(
            shadow, state.world, fragments, fragments.normals, incident
        )


def _receivers(request: RenderRequest) -> Iterator[Activation]:
    for index, light in enumerate(request.scene.lighting.lights):
        found = _pairs(request, index) if light.shadow is not None else "it casts none"
        if not isinstance(found, str):
            for receiver in sorted({receiver for _, receiver in found}):
                why = f'shadows of light "{light.name}" may fall on it'
                yield Activation(receiver, request.name(receiver), why)


SHADOW_MAPS = Effect(
    name="shadow maps",
    does="renders the depths that lights see",
    after="light profiles",
    of="light",
    among="lights",
    reasons=_map_reasons,
    without=lambda scene: scene.with_lights(shadow=None),
    left_out="no light casts shadows",
    needs=("lights",),
    unneeded=_unneeded,
    prepare=_light_shadow,
    dim=_dim,
    deferred=True,
)

# The lookup happens in `dim`; its requirements are declared for the objects that receive shadows.
SHADOWS = Effect(
    name="shadows",
    does="looks up shadow maps",
    after="positions",
    activations=_receivers,
    left_out="no shadow falls on anything in the picture",
    needs=("positions",),
)
