"""What a mirror shows: the environment, a prefiltered one, or one rendered from its own place."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray
from texbake.mesh.shapes import plane, uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Environment, Lighting
from texbake.rendering.scene.material import Material, Reflection
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture
from texbake.study.case import Case
from texbake.study.knob import Bench, Knob, Outcome, Setting
from texbake.study.truth.pictures import crop, picture_error
from texbake.study.truth.sight import ball_points, sight_rays
from texbake.texture.cube_map import texel_directions

_SIZES = (16, 32, 64, 128, 256, 512)
_QUICK_SIZES = (16, 64)
_SKY_SIZE = 128
_FLOOR, _FLOOR_TEXELS, _WAVES = 12.0, 512, 4
_MIDDLE, _RADIUS = (0.0, 1.2, 0.0), 0.25
_LEAST_COSINE = 0.3
# Of the rows and columns, for a crop that shows the whole ball.
_SKIPPED = 2
_LOOKUP, _PREFILTERED, _RENDERED = "one lookup", "prefiltered", "rendered"


def _prepare(case: Case) -> Bench:
    side = case.choose(400, 64)
    camera = Camera.looking_at((0.0, 1.6, 1.8), _MIDDLE, fov=math.radians(19.0), near=0.01)
    options = RenderOptions(width=side, height=side, supersampling=1)
    truth, seen = _traced(camera, side)
    sky = tuple(_sky(texel_directions(_SKY_SIZE).astype(np.float64)).astype(np.float32))

    def work(value: tuple[str, int]) -> npt.NDArray[np.float32]:
        scene = _scene(_mirror(*value), sky, lighting=value[0] == _PREFILTERED)
        return draw(prepare(scene, options, threads=case.threads), camera).color

    def judge(value: tuple[str, int], image: npt.NDArray[np.float32]) -> Outcome:
        return Outcome(picture_error(image, truth, seen), crop(image[::_SKIPPED, ::_SKIPPED]))

    sizes = case.choose(_SIZES, _QUICK_SIZES)
    return Bench(
        subject=f"a mirror ball over a floor under a smooth sky, {side} x {side} pixels",
        truth="closed form",
        truth_text="One mirrored ray from each pixel's point of the ball, to the floor or the sky.",
        settings=(
            Setting(_LOOKUP, (_LOOKUP, 0)),
            Setting(_PREFILTERED, (_PREFILTERED, 0)),
            *(Setting(f"{_RENDERED}, {n}", (_RENDERED, n), _RENDERED) for n in sizes),
        ),
        work=work,
        judge=judge,
    )


def _mirror(kind: str, size: int) -> Material:
    if kind == _PREFILTERED:
        return Material(base_color=(1.0, 1.0, 1.0), metalness=1.0, roughness=0.0)
    shown = Reflection(environment="rendered", size=size) if size else Reflection()
    return Material(shading="unlit", base_color=(0.0, 0.0, 0.0), reflection=shown)


def _scene(
    material: Material, sky: tuple[npt.NDArray[np.float32], ...], *, lighting: bool
) -> Scene:
    flat, ball = plane(), uv_sphere(128, 256)
    x, y, _ = flat.positions.T
    floor = flat.replace(
        positions=np.stack([(x - 0.5) * _FLOOR, np.zeros_like(x), (0.5 - y) * _FLOOR], axis=1)
    )
    middles = (np.arange(_FLOOR_TEXELS) + 0.5) / _FLOOR_TEXELS
    colors = _pattern(*np.meshgrid(middles, middles[::-1])).astype(np.float32)
    texture = ImageTexture(image=colors, filter="trilinear")
    return Scene(
        objects=(
            SceneObject(mesh=floor, material=Material(shading="unlit", base_color=texture)),
            SceneObject(
                mesh=ball.replace(positions=ball.positions * _RADIUS + np.array(_MIDDLE)),
                material=material,
            ),
        ),
        lighting=Lighting(environment=Environment(faces=sky, size=_SKY_SIZE, lighting=lighting)),
    )


def _traced(camera: Camera, side: int) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.bool_]]:
    """(H, W, 3) what the ball shows, and (H, W) the pixels that see it well."""
    middle, rays = np.array(_MIDDLE), sight_rays(camera, side, side)
    points, cosines = ball_points(camera, rays, middle, _RADIUS)
    normals = (points - middle) / _RADIUS
    views = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    mirrored = views - 2.0 * np.einsum("ijk,ijk->ij", views, normals)[..., None] * normals
    steps = points[..., 1] / np.maximum(-mirrored[..., 1], 1e-9)
    u = (points[..., 0] + steps * mirrored[..., 0]) / _FLOOR + 0.5
    v = 0.5 - (points[..., 2] + steps * mirrored[..., 2]) / _FLOOR
    on_floor = (mirrored[..., 1] < 0.0) & (u > 0.0) & (u < 1.0) & (v > 0.0) & (v < 1.0)
    colors = np.where(on_floor[..., None], _pattern(u, v), _sky(mirrored))
    return colors.astype(np.float32), cosines > _LEAST_COSINE


def _pattern(u: FloatArray, v: FloatArray) -> FloatArray:
    """(..., 3) colors of the floor."""
    turn = 2.0 * math.pi * _WAVES
    wave = 0.5 + 0.5 * np.sin(turn * u) * np.sin(turn * v)
    return np.asarray(0.08 + 0.7 * wave[..., None] * np.array((1.0, 0.8, 0.55)))


def _sky(out: FloatArray) -> FloatArray:
    """(..., 3) colors in directions (..., 3), of any length but 0."""
    units = out / np.linalg.norm(out, axis=-1, keepdims=True)
    up = (0.5 + 0.5 * units[..., 1])[..., None]
    wave = (0.5 + 0.5 * np.sin(5.0 * units[..., 0]))[..., None]
    return np.asarray((0.15 + 0.5 * up) * np.array((0.6, 0.8, 1.0)) + 0.15 * wave)


KNOB = Knob(
    name="environment",
    title="Environment reflections",
    about="A lookup by direction alone takes all that is mirrored for infinitely far away, "
    "prefiltered or not, so that the floor is missing. Six pictures from the middle of the ball "
    "have it; from the ball's surface it would be seen a little elsewhere, which no size mends.",
    error="picture, root mean square",
    unit="of 255",
    kind="picture",
    needs="nothing",
    prepare=_prepare,
)
