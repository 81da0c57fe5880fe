"""Directional, point and spot lights, and the light that arrives from them at fragments.

A white surface that faces a light reflects its color times its intensity. Point and spot lights
fall off as 1 / d^decay with the distance d. A spot has full strength inside its inner cone and
fades smoothly (3t^2 - 2t^3) to 0 at its outer cone. A light cookie in a rectangular gate bounds the
light instead of the cone, which is then one around its corners. At the position of a point light
itself, the light comes along the normal with its strength at a distance of 0.001.

Kernel: `core/lamps.c`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import Float32Array, FloatArray
from texbake.records import dataclass
from texbake.rendering.camera import Camera
from texbake.rendering.effect import Effect, Rejection, RenderState
from texbake.rendering.fragments import Fragments, IncidentLight, one_row
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.lights import Light
from texbake.rendering.scene.projected import picture_aspect

# Below this sine of the angle between a light's direction and its `up`, rounding decides the axes.
_PARALLEL = 1e-9
# Factor of the cosine of a cookie's corners: the cone leaves pixels on its border to the cookie.
_AROUND_CORNERS = 0.99


@dataclass(frozen=True, eq=False)
class PlacedLight:
    """A light in world space for the kernels; `cosines` of its cones, -1 for a point light."""

    kind: str
    radiance: Float32Array
    position: FloatArray
    direction: FloatArray
    up: FloatArray
    cosines: tuple[float, float]
    decay: float

    @property
    def axes(self) -> FloatArray:
        """(3, 3): rows right, up and back of a camera that looks along the light."""
        upward = self.up
        right = np.cross(upward, -self.direction)
        if pm.norm(right) <= _PARALLEL * pm.norm(upward):
            upward = np.eye(3)[np.abs(self.direction).argmin()]
            right = np.cross(upward, -self.direction)
        right /= pm.norm(right)
        return np.stack([right, np.cross(-self.direction, right), -self.direction])


def _reasons(request: RenderRequest, index: int) -> Iterator[str | Rejection]:
    light = request.light(index)
    if not light.shines:
        yield Rejection("it is dark")
    elif index not in request.shining:
        yield Rejection("its cone meets no object")
    elif not request.lit:
        yield Rejection("no object in the picture is lit")
    else:
        yield f"it is {light.kind}"


def place_light(state: RenderState, target: int) -> PlacedLight:
    """Place a light of the scene in world space."""
    return placed_light(state.lights[target], state.camera)


def placed_light(light: Light, camera: Camera | None = None) -> PlacedLight:
    """Place a light in world space; `camera` is needed only for a light that follows it."""
    follows = light.follows_camera and camera is not None
    axes = camera.axes.T if follows and camera is not None else np.eye(3)
    position = pm.matmul(axes, np.asarray(light.position, np.float64))
    direction, up = (
        pm.matmul(axes, np.asarray(vector, np.float64)) for vector in (light.direction, light.up)
    )
    if follows and camera is not None:
        position = position + camera.eye
    length = float(pm.norm(direction))
    return PlacedLight(
        kind=light.kind,
        radiance=one_row(tuple(light.intensity * c for c in light.color), 3),
        position=position,
        direction=direction / length if length > 0.0 else direction,
        up=up,
        cosines=_cosines(light) if light.kind == "spot" else (-1.0, -1.0),
        decay=float(light.decay),
    )


def _cosines(light: Light) -> tuple[float, float]:
    """Cosines of the inner and outer cone of a spot."""
    if light.profile is not None and light.gate == "rectangle":
        # Without an aspect, the cone surrounds a square, so that no file is opened for it.
        extent = cookie_extent(light if light.aspect is not None else replace(light, aspect=1.0))
        corner = _AROUND_CORNERS / float(pm.norm([1.0, *extent]))
        return corner, corner
    half = math.radians(light.angle) / 2.0
    inner = half * (1.0 - min(max(light.blend, 0.0), 1.0))
    return pm.cos(inner), pm.cos(half)


def cookie_extent(light: Light) -> tuple[float, float]:
    """Half the width and height of a spot's cookie at distance 1."""
    assert light.profile is not None
    aspect = picture_aspect(light.profile) if light.aspect is None else light.aspect
    side = max(aspect, 1.0) if light.gate == "rectangle" else min(aspect, 1.0)
    reach = pm.tan(math.radians(light.angle) / 2.0)
    return reach * aspect / side, reach / side


def fix_in_world(light: Light, camera: Camera) -> Light:
    """Fix a light that follows the camera at its present position; return others unchanged."""
    if not light.follows_camera:
        return light
    placed = placed_light(light, camera)
    return replace(
        light,
        position=tuple(placed.position),
        direction=tuple(placed.direction),
        up=tuple(placed.up),
        follows_camera=False,
    )


def arriving_light(light: PlacedLight, points: FloatArray, normals: Float32Array) -> IncidentLight:
    """Compute the unshadowed light that arrives from one lamp at points (n, 3) in world space."""
    if light.kind == "directional":
        return IncidentLight(one_row(tuple(-light.direction), 3), light.radiance)
    n = len(normals)
    found = IncidentLight(np.empty((n, 3), np.float32), np.empty((n, 3), np.float32))
    core.find_arriving_light(
        points, normals, light.position, light.direction, *light.cosines, light.decay,
        light.radiance, found.directions, found.radiance,
    )  # fmt: skip
    return found


def incident(fragments: Fragments, state: RenderState, index: int) -> IncidentLight:
    """Light of one lamp at fragments, dimmed by the shadows and cookies in the plan."""
    light = arriving_light(state.of(place_light, index), fragments.positions, fragments.normals)
    passes = [
        item for item in state.plan.passes if item.effect.of == "light" and item.is_for(index)
    ]
    steps = [(item.name, item.effect.dim) for item in passes]
    steps += [(item.name, item.effect.tint) for item in passes]
    known = None
    for name, work in steps:
        if work is not None:
            if light.radiance is not known and not reaches_any(fragments, light):
                break
            known = light.radiance
            with state.costs.timed(name):
                work(fragments, state, index, light)
    return light


def reaches_any(fragments: Fragments, incident: IncidentLight) -> bool:
    """Whether light arrives at the visible side of a fragment."""
    directions = np.broadcast_to(incident.directions, fragments.normals.shape)
    arrives = incident.radiance.any(axis=1) & (pm.vecdot(fragments.normals, directions) > 0.0)
    return bool(arrives.any())


LIGHTS = Effect(
    name="lights",
    does="places lights in world space",
    after="occlusion picture",
    of="light",
    among="lights",
    reasons=_reasons,
    without=lambda scene: scene.with_lights(intensity=0.0),
    left_out="the scene has no lights",
    prepare=place_light,
)
