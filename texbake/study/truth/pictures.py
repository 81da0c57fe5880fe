"""How far a picture is from another, crops of pictures, and what pixels see in closed form."""

from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Float32Array, FloatArray, Mesh
from texbake.mesh.normals import shading_normals
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayScene
from texbake.records import dataclass
from texbake.rendering.camera import Camera
from texbake.rendering.maps import MapSource
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render
from texbake.rendering.scene.lights import Shadow
from texbake.rendering.scene.scene import Scene
from texbake.rendering.scene.textures import ImageTexture
from texbake.study.truth.surfaces import Surface

# Pixels along one side of the crops.
CROP = 200
_ZOOM = 4.0


def close_up(
    mesh: Mesh,
    *,
    normal_map: MapSource | None = None,
    zoom: float = _ZOOM,
    threads: int | None = None,
) -> Float32Array:
    """(CROP, CROP, 3) float32 picture of the middle of a mesh with its maps, close up."""
    options = RenderOptions(width=CROP, height=CROP, supersampling=2)
    camera = Camera.framing(mesh, options=options)
    near = replace(camera, fov=2.0 * pm.arctan(pm.tan(camera.fov / 2.0) / zoom))
    frame = render(mesh, normal_map=normal_map, options=options, camera=near, threads=threads)
    return frame.color[..., :3]


def crop(
    picture: Float32Array, center: tuple[float, float] = (0.5, 0.5), zoom: int = 1
) -> Float32Array:
    """(CROP, CROP, 3) part about a center in shares from the upper left, enlarged by `zoom`."""
    height, width = picture.shape[:2]
    zoom = max(zoom, math.ceil(CROP / min(height, width)))
    side = math.ceil(CROP / zoom)
    left, top = (
        round(min(max(share * size - side / 2, 0.0), size - side))
        for share, size in zip(center, (width, height), strict=True)
    )
    part = picture[top : top + side, left : left + side, :3]
    return np.ascontiguousarray(part.repeat(zoom, axis=0).repeat(zoom, axis=1)[:CROP, :CROP])


def sight_rays(
    camera: Camera, width: int, height: int, *, right: float = 0.0, down: float = 0.0
) -> FloatArray:
    """(H, W, 3) world directions one unit deep, `right` and `down` pixels off the middle."""
    corner, to_right, to_below = camera.view_rays(width, height)
    columns = (np.arange(width) + 0.5 + right)[None, :, None]
    rows = (np.arange(height) + 0.5 + down)[:, None, None]
    return np.asarray(corner + columns * to_right + rows * to_below)


def ball_points(
    camera: Camera, rays: FloatArray, middle: FloatArray, radius: float
) -> tuple[FloatArray, FloatArray]:
    """(..., 3) where rays first meet a ball, or come nearest, and (...) cosines, 0 for misses."""
    units = rays / pm.norm(rays, axis=-1, keepdims=True)
    to_middle = middle - camera.eye
    along = pm.matmul(units, to_middle)
    inside = np.maximum(along**2 - pm.matmul(to_middle, to_middle) + radius**2, 0.0)
    points = camera.eye + units * (along - np.sqrt(inside))[..., None]
    cosines = -pm.vecdot(points - middle, units) / radius
    return points, np.where(inside > 0.0, cosines, 0.0)


_EYE = (0.0, 0.35, 0.0)
_TARGET = (0.0, 0.0, -1.2)
_FOV = math.radians(40.0)


@dataclass(frozen=True)
class Floor:
    """The plane y = 0 with coordinates u = x, v = -z, in a picture of `width` x `height`."""

    width: int
    height: int

    @property
    def camera(self) -> Camera:
        """Looks at the floor at a grazing angle; the horizon lies above the picture."""
        return Camera.looking_at(_EYE, _TARGET, fov=_FOV, near=0.01)

    def rays(self, right: float = 0.0, down: float = 0.0) -> FloatArray:
        """(H, W, 3) directions of view; see `sight_rays`."""
        return sight_rays(self.camera, self.width, self.height, right=right, down=down)

    def uvs(self, right: float = 0.0, down: float = 0.0) -> FloatArray:
        """(H · W, 2) texture coordinates that pixels see."""
        rays = self.rays(right, down).reshape(-1, 3)
        points = self.camera.eye + rays * (self.camera.eye[1] / -rays[:, 1])[:, None]
        return np.stack([points[:, 0], -points[:, 2]], axis=1)

    def changes(self) -> Float32Array:
        """(H · W, 4) exact du/dx, dv/dx, du/dy, dv/dy for one pixel."""
        here, eye = self.rays().reshape(-1, 3), self.camera.eye
        to_right = (self.rays(right=1.0) - self.rays()).reshape(-1, 3)
        to_below = (self.rays(down=1.0) - self.rays()).reshape(-1, 3)
        columns = [
            sign * -eye[1] * (step[:, axis] * here[:, 1] - here[:, axis] * step[:, 1])
            / here[:, 1] ** 2
            for step in (to_right, to_below)
            for axis, sign in ((0, 1.0), (2, -1.0))
        ]  # fmt: skip
        return np.stack(columns, axis=1).astype(np.float32)


RAYS_PER_SIDE = 4  # of a pixel


def lambert_picture(
    mesh: Mesh, surface: Surface | None, camera: Camera, size: int, to_light: FloatArray
) -> Float32Array:
    """(size, size, 3) cosines of the angle to the light, by normals of the closed form if any."""
    rays = sight_rays(camera, size * RAYS_PER_SIDE, size * RAYS_PER_SIDE).reshape(-1, 3)
    rays /= pm.norm(rays, axis=1, keepdims=True)
    frame = LocalFrame.around(mesh)
    origins = np.broadcast_to(frame.to_local(camera.eye[None]), rays.shape)
    reach = pm.norm(origins[0]) + 2.0  # behind the mesh, which is about one unit wide
    hits = RayScene.build(mesh, frame).cast(
        Rays(np.ascontiguousarray(origins), rays, np.full(len(rays), reach), np.zeros(len(rays)))
    )
    seen = np.flatnonzero(hits.faces != NO_HIT)
    weights = hits.barycentrics[seen]
    weights = np.column_stack([1.0 - weights.sum(axis=1), weights])
    if surface is not None:
        normals = surface.normals(pm.vecmat(weights, mesh.positions[mesh.faces[hits.faces[seen]]]))
    else:
        values, rows = shading_normals(mesh)
        normals = pm.vecmat(weights, values[rows[hits.faces[seen]]])
        normals /= np.maximum(pm.norm(normals, axis=1, keepdims=True), 1e-30)
    light = np.zeros(len(rays))
    light[seen] = np.maximum(pm.matmul(normals, to_light), 0.0)
    picture = light.reshape(size, RAYS_PER_SIDE, size, RAYS_PER_SIDE).mean(axis=(1, 3))
    return np.repeat(picture[..., None], 3, axis=2).astype(np.float32)


def with_width(options: RenderOptions, width: int) -> RenderOptions:
    """Return options of a picture of another width and the same shape."""
    height = max(round(width * options.height / options.width), 1)
    return replace(options, width=width, height=height)


def has_image(scene: Scene) -> bool:
    """Whether a slot of any material holds an image, whose lookups can be filtered."""
    return any(
        isinstance(getattr(item.material, slot.name), ImageTexture)
        for item in scene.objects
        for slot in fields(item.material)
    )


def has_shadow(scene: Scene) -> bool:
    """Whether any light casts shadows."""
    return any(light.shadow is not None for light in scene.lighting.lights)


def with_shadows(scene: Scene, shadow: Shadow) -> Scene:
    """Return the scene with other shadow maps for all lights that have one."""
    lights = tuple(
        light if light.shadow is None else replace(light, shadow=shadow)
        for light in scene.lighting.lights
    )
    return replace(scene, lighting=replace(scene.lighting, lights=lights))
