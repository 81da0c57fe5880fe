"""Knobs of lighting: reflections of the environment, and shadow maps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.mesh import BoolArray, Float32Array, FloatArray
from texbake.mesh.shapes import plane, uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.resolve import picture_error
from texbake.rendering.scene.lights import Environment, Light, Lighting, Shadow
from texbake.rendering.scene.material import Material, Reflection
from texbake.rendering.scene.scene import Scene, SceneObject, camera_of
from texbake.rendering.scene.textures import ImageTexture
from texbake.study.knob import Case, Evaluation, Experiment, Knob, Setting
from texbake.study.truth.pictures import (
    ball_points,
    crop,
    has_shadow,
    sight_rays,
    with_shadows,
    with_width,
)
from texbake.texture.cube_map import texel_directions

_ENVIRONMENT_SIZES = (16, 32, 64, 128, 256, 512)
_ENVIRONMENT_QUICK_SIZES = (16, 64)
_SKY_SIZE = 128
_ENVIRONMENT_FLOOR, _FLOOR_TEXELS, _WAVES = 12.0, 512, 4
_MIDDLE, _ENVIRONMENT_RADIUS = (0.0, 1.2, 0.0), 0.25
_LEAST_COSINE = 0.3
# Steps between rows and between columns, for a crop that shows the whole ball.
_SKIPPED = 2
_LOOKUP, _PREFILTERED, _RENDERED = "one lookup", "prefiltered", "rendered"


def _prepare_environment(case: Case) -> Experiment:
    side = case.choose(400, 64)
    camera = Camera.looking_at((0.0, 1.6, 1.8), _MIDDLE, fov=math.radians(19.0), near=0.01)
    options = RenderOptions(width=side, height=side, supersampling=1)
    truth, seen = _traced(camera, side)
    sky = tuple(_sky(texel_directions(_SKY_SIZE).astype(np.float64)).astype(np.float32))

    def work(value: tuple[str, int]) -> Float32Array:
        scene = _scene(_mirror(*value), sky, lighting=value[0] == _PREFILTERED)
        return draw(prepare(scene, options, threads=case.threads), camera).color

    def judge(value: tuple[str, int], image: Float32Array) -> Evaluation:
        return Evaluation(picture_error(image, truth, seen), crop(image[::_SKIPPED, ::_SKIPPED]))

    sizes = case.choose(_ENVIRONMENT_SIZES, _ENVIRONMENT_QUICK_SIZES)
    return Experiment(
        subject=f"a mirror ball over a floor under a smooth sky, {side} x {side} pixels",
        truth="closed form",
        truth_text="One mirrored ray from each pixel's point on the ball to the floor or the sky.",
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


def _scene(material: Material, sky: tuple[Float32Array, ...], *, lighting: bool) -> Scene:
    flat, ball = plane(), uv_sphere(128, 256)
    x, y, _ = flat.positions.T
    floor = flat.replace(
        positions=np.stack(
            [(x - 0.5) * _ENVIRONMENT_FLOOR, np.zeros_like(x), (0.5 - y) * _ENVIRONMENT_FLOOR],
            axis=1,
        )
    )
    middles = (np.arange(_FLOOR_TEXELS) + 0.5) / _FLOOR_TEXELS
    colors = _pattern(*np.meshgrid(middles, middles[::-1])).astype(np.float32)
    texture = ImageTexture(image=colors, filter="trilinear")
    return Scene(
        objects=(
            SceneObject(mesh=floor, material=Material(shading="unlit", base_color=texture)),
            SceneObject(
                mesh=ball.replace(
                    positions=ball.positions * _ENVIRONMENT_RADIUS + np.array(_MIDDLE)
                ),
                material=material,
            ),
        ),
        lighting=Lighting(environment=Environment(faces=sky, size=_SKY_SIZE, lighting=lighting)),
    )


def _traced(camera: Camera, side: int) -> tuple[Float32Array, BoolArray]:
    """Return what the ball shows, (H, W, 3), and the pixels that show it well, (H, W)."""
    middle, rays = np.array(_MIDDLE), sight_rays(camera, side, side)
    points, cosines = ball_points(camera, rays, middle, _ENVIRONMENT_RADIUS)
    normals = (points - middle) / _ENVIRONMENT_RADIUS
    views = rays / pm.norm(rays, axis=-1, keepdims=True)
    mirrored = views - 2.0 * pm.vecdot(views, normals)[..., None] * normals
    steps = points[..., 1] / np.maximum(-mirrored[..., 1], 1e-9)
    u = (points[..., 0] + steps * mirrored[..., 0]) / _ENVIRONMENT_FLOOR + 0.5
    v = 0.5 - (points[..., 2] + steps * mirrored[..., 2]) / _ENVIRONMENT_FLOOR
    on_floor = (mirrored[..., 1] < 0.0) & (u > 0.0) & (u < 1.0) & (v > 0.0) & (v < 1.0)
    colors = np.where(on_floor[..., None], _pattern(u, v), _sky(mirrored))
    return colors.astype(np.float32), cosines > _LEAST_COSINE


def _pattern(u: FloatArray, v: FloatArray) -> FloatArray:
    """(..., 3) colors of the floor."""
    turn = 2.0 * math.pi * _WAVES
    wave = 0.5 + 0.5 * pm.sin(turn * u) * pm.sin(turn * v)
    return np.asarray(0.08 + 0.7 * wave[..., None] * np.array((1.0, 0.8, 0.55)))


def _sky(out: FloatArray) -> FloatArray:
    """(..., 3) colors in directions (..., 3), of any length but 0."""
    units = out / pm.norm(out, axis=-1, keepdims=True)
    up = (0.5 + 0.5 * units[..., 1])[..., None]
    wave = (0.5 + 0.5 * pm.sin(5.0 * units[..., 0]))[..., None]
    return np.asarray((0.15 + 0.5 * up) * np.array((0.6, 0.8, 1.0)) + 0.15 * wave)


ENVIRONMENT_KNOB = Knob(
    name="environment",
    title="Environment reflections",
    about="A lookup by direction alone, prefiltered or not, treats everything that is mirrored as "
    "infinitely far away, so the floor is missing. Six pictures from the middle of the ball show "
    "it; from the surface of the ball it would be seen at a slightly different place, which no "
    "size corrects.",
    error="picture, root mean square",
    unit="of 255",
    kind="picture",
    prepare=_prepare_environment,
)


_SHADOW_MAP_SIZES = (128, 256, 512, 1024, 2048, 4096)
_SHADOW_MAP_QUICK_SIZES = (64, 128)
_RADII = (0.0, 1.5, 4.0)  # texels
_CONVERGED = 8192
_BALL, _SHADOW_MAP_RADIUS = (0.0, 0.0, 1.0), 0.7
_LIGHT = (0.8, 0.5, -1.0)
_SHADOW_MAP_FLOOR = 8.0  # width, around the origin
_GRAY = 0.8
_PER_SIDE = 8  # rays of the truth along each side of a pixel


def _prepare_shadow_map(case: Case) -> Experiment:
    values = [
        (n, r) for n in case.choose(_SHADOW_MAP_SIZES, _SHADOW_MAP_QUICK_SIZES) for r in _RADII
    ]
    settings = tuple(Setting(f"{n}, {_filter(r)}", (n, r), _filter(r)) for n, r in values)
    if case.scene is not None and has_shadow(case.scene):
        return _on_scene(case.scene, settings, case)
    scene, camera = _made_scene()
    options = RenderOptions(
        width=case.choose(480, 64), height=case.choose(360, 48), supersampling=2,
        edges="supersample",
    )  # fmt: skip
    truth, floor = _cast(camera, options)

    def work(value: tuple[int, float]) -> Float32Array:
        shadow = Shadow(size=value[0], filter_radius=value[1])
        return draw(
            prepare(with_shadows(scene, shadow), options, threads=case.threads), camera
        ).color

    def judge(value: tuple[int, float], image: Float32Array) -> Evaluation:
        return Evaluation(picture_error(image, truth, floor), crop(image, (0.71, 0.48), zoom=4))

    return Experiment(
        subject=f"a ball over a floor, {options.width} x {options.height} pixels",
        truth="closed form",
        truth_text=f"{_PER_SIDE**2} rays per pixel from the floor towards the light, tested "
        "against the ball by formula; pixels of the ball itself are left out.",
        settings=settings,
        work=work,
        judge=judge,
    )


def _filter(radius: float) -> str:
    return f"radius {radius:g}" if radius else "no filter"


def _made_scene() -> tuple[Scene, Camera]:
    floor, ball = plane(), uv_sphere(128, 256)
    items = (
        SceneObject(
            mesh=floor.replace(positions=(floor.positions - (0.5, 0.5, 0.0)) * _SHADOW_MAP_FLOOR),
            material=Material(shading="lambert", base_color=(_GRAY,) * 3),
        ),
        SceneObject(
            mesh=ball.replace(positions=ball.positions * _SHADOW_MAP_RADIUS + np.array(_BALL)),
            material=Material(shading="lambert", base_color=(0.7, 0.35, 0.2)),
        ),
    )
    light = Light(direction=_LIGHT, intensity=1.0, shadow=Shadow())
    camera = Camera.looking_at(
        (0.4, -4.5, 3.2), (0.6, 0.2, 0.3), up=(0.0, 0.0, 1.0), fov=math.radians(36.0), near=0.01
    )
    return Scene(objects=items, lighting=Lighting(lights=(light,))), camera


def _cast(camera: Camera, options: RenderOptions) -> tuple[Float32Array, BoolArray]:
    """Return a picture of the floor, (H, W, 3), and the pixels that show only it, (H, W)."""
    height, width = options.height, options.width
    rays = sight_rays(camera, width * _PER_SIDE, height * _PER_SIDE).reshape(-1, 3)
    to_light = -np.array(_LIGHT) / pm.norm(_LIGHT)
    down = np.minimum(rays[:, 2], -1e-9)
    points = camera.eye - rays * (camera.eye[2] / down)[:, None]
    on_floor = (rays[:, 2] < 0.0) & (np.abs(points[:, :2]) < 0.5 * _SHADOW_MAP_FLOOR).all(axis=1)
    on_floor &= ~_meets_ball(np.broadcast_to(camera.eye, rays.shape), rays)
    lit = ~_meets_ball(points, np.broadcast_to(to_light, rays.shape))
    blocks = height, _PER_SIDE, width, _PER_SIDE
    shares = lit.reshape(blocks).mean(axis=(1, 3)) * (_GRAY * to_light[2])
    return (
        np.repeat(shares[..., None], 3, axis=2).astype(np.float32),
        on_floor.reshape(blocks).all(axis=(1, 3)),
    )


def _meets_ball(starts: FloatArray, directions: FloatArray) -> BoolArray:
    """Return whether rays from outside the ball meet it."""
    to_middle = np.array(_BALL) - starts
    along = pm.vecdot(to_middle, directions)
    squares = pm.vecdot(directions, directions)
    away = pm.vecdot(to_middle, to_middle) - along**2 / squares
    return np.asarray((along > 0.0) & (away < _SHADOW_MAP_RADIUS**2))


def _on_scene(scene: Scene, settings: tuple[Setting, ...], case: Case) -> Experiment:
    options = with_width(scene.options(supersampling=2, buffer=None), case.choose(480, 64))
    camera = camera_of(scene, options)

    def drawn(shadow: Shadow, choices: RenderOptions) -> Float32Array:
        return draw(
            prepare(with_shadows(scene, shadow), choices, threads=case.threads), camera
        ).color

    def work(value: tuple[int, float]) -> Float32Array:
        return drawn(Shadow(size=value[0], filter_radius=value[1]), options)

    finest = Shadow(size=case.choose(_CONVERGED, 512), filter_radius=0.0)
    truth = drawn(finest, replace(options, supersampling=4, edges="supersample"))

    def judge(value: tuple[int, float], image: Float32Array) -> Evaluation:
        return Evaluation(picture_error(image, truth), crop(image))

    return Experiment(
        subject=f"{scene.name}, {options.width} x {options.height} pixels",
        truth="converged",
        truth_text=f"Shadow maps of {finest.size} x {finest.size} without a filter, and 16 "
        "samples in each pixel, shaded one by one.",
        settings=settings,
        work=work,
        judge=judge,
    )


SHADOW_MAP_KNOB = Knob(
    name="shadow-map",
    title="Shadow map: size and filter",
    about="Texels along one side of a shadow map, and the radius in texels over which its "
    "comparisons are averaged. A filter hides the steps of a coarse map and blurs the edges of a "
    "fine one.",
    error="picture, root mean square",
    unit="of 255",
    kind="picture",
    prepare=_prepare_shadow_map,
)
