"""Static lighting at points on the surfaces of a scene, with shadows cast by rays.

Lamps light a surface as they do in a picture (`texbake.rendering.effects.lights`), including images
that they project, and only those cast shadows that do so in a picture.

Based on: Wächter, Binder, "A fast and robust method for avoiding self-intersection", Ray Tracing
Gems, 2019, for the distance from the surface at which rays start.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.texels import Samples
from texbake.core import portable_math as pm
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Float32Array, FloatArray, IntArray, Mesh
from texbake.mesh.normals import face_normals, shading_normals
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayScene
from texbake.records import dataclass
from texbake.rendering.effects.ambient import add_ambient
from texbake.rendering.effects.lights import PlacedLight, arriving_light, placed_light
from texbake.rendering.effects.projectors import LightCookie
from texbake.rendering.effects.shading_models import add_lambert
from texbake.rendering.rasterize import join_objects
from texbake.rendering.scene.lights import Light
from texbake.rendering.scene.scene import Scene

# Distance from the surface at which rays start, in units of the scene's size: 256 steps of a
# float32 there.
_START = 2.0**-17
# Longer than any segment in the local frame.
_THROUGH = 2.0
_WHITE = np.ones((1, 3), np.float32)
_ALL = np.ones(1, np.float32)


def is_static(light: Light) -> bool:
    """Whether a light can be baked: it is static, and independent of the camera."""
    return light.static and not light.follows_camera


class StaticLight:
    """All lights that go into maps, and the geometry that shadows them."""

    def __init__(self, scene: Scene, meshes: list[Mesh], threads: int | None) -> None:
        self._lights = [light for light in scene.lighting.lights if is_static(light)]
        self._placed = [placed_light(light) for light in self._lights]
        self._cookies: list[LightCookie | None] = [
            LightCookie.of(light, at)
            if light.kind == "spot" and light.profile is not None
            else None
            for light, at in zip(self._lights, self._placed, strict=True)
        ]
        self._ambient = scene.lighting.ambient
        self._up = scene.options().up
        self._frame = LocalFrame.around(*meshes)
        casters = [
            (mesh.positions, mesh.faces)
            for mesh, item in zip(meshes, scene.objects, strict=True)
            if item.casts_shadows
        ]
        self._scene: RayScene | None = None
        if casters and any(light.shadow is not None for light in self._lights):
            world = join_objects(casters)
            everything = Mesh(positions=world.positions, faces=world.faces, name=scene.name)
            self._scene = RayScene.build(everything, self._frame, threads=threads)

    def light_at(
        self, points: FloatArray, normals: Float32Array, sides: FloatArray, *, receives: bool
    ) -> Float32Array:
        """(n, 3) light of white, matte points by shading normals and `sides`, those of faces."""
        out = np.zeros((len(points), 3), np.float32)
        add_ambient(self._ambient, self._up, normals, _WHITE, _ALL, out)
        for light, at, cookie in zip(self._lights, self._placed, self._cookies, strict=True):
            arrived = arriving_light(at, points, normals)
            if cookie is not None:
                arrived.radiance = arrived.radiance * cookie.colors(points)
            if receives and light.shadow is not None and self._scene is not None:
                facing = pm.vecdot(normals, np.broadcast_to(arrived.directions, out.shape))
                dark = (facing <= 0.0) | ~arrived.radiance.any(axis=1)
                dark[~dark] = self._hidden(at, points[~dark], sides[~dark])
                arrived.radiance = arrived.radiance * ~dark[:, None]
            add_lambert(normals, arrived, _WHITE, out)
        return out

    def _hidden(self, light: PlacedLight, points: FloatArray, sides: FloatArray) -> Float32Array:
        """(n,) bool: whether something lies between points and a lamp."""
        assert self._scene is not None
        origins = self._frame.to_local(points)
        if light.kind == "directional":
            toward = np.broadcast_to(-light.direction, origins.shape)
            lengths = np.full(len(points), _THROUGH)
        else:
            toward = self._frame.to_local(light.position) - origins
            lengths = pm.norm(toward, axis=1)
            toward = toward / np.where(lengths > 0.0, lengths, 1.0)[:, None]
            # The surface that the lamp itself lies on does not hide it.
            lengths = np.maximum(lengths - 2.0 * _START, 0.0)
        # Start on the side of the face toward which the ray leaves.
        leaving = np.where(pm.vecdot(sides, toward) < 0.0, -_START, _START)
        origins += leaving[:, None] * sides
        rays = Rays(origins, np.ascontiguousarray(toward), lengths, np.zeros(len(points)))
        return np.asarray(self._scene.cast(rays, cull_back_faces=False).faces != NO_HIT)


@dataclass(frozen=True, eq=False)
class LitSurface:
    """A placed mesh with the normals that light maps interpolate."""

    mesh: Mesh
    normals: FloatArray
    normal_faces: IntArray
    sides: FloatArray

    @classmethod
    def of(cls, mesh: Mesh, threads: int | None) -> LitSurface:
        """Return a placed mesh with its normals."""
        return cls(mesh, *shading_normals(mesh, threads=threads), face_normals(mesh))

    def at(self, samples: Samples) -> tuple[FloatArray, Float32Array, FloatArray]:
        """Points, unit normals and face normals of samples."""
        second, third = samples.barycentrics.T
        weights = np.stack([1.0 - second - third, second, third], axis=1)
        corners = self.mesh.positions[self.mesh.faces[samples.faces]]
        # From the first corner: exact where the others' weights are 0.
        points = corners[:, 0] + pm.vecmat(weights[:, 1:], corners[:, 1:] - corners[:, :1])
        normals = pm.vecmat(weights, self.normals[self.normal_faces[samples.faces]])
        sides = self.sides[samples.faces]
        lengths = pm.norm(normals, axis=1, keepdims=True)
        normals = np.where(lengths > 0.0, normals / np.where(lengths > 0.0, lengths, 1.0), sides)
        return points, np.ascontiguousarray(normals, np.float32), sides
