"""Size and filter of shadow maps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray
from texbake.mesh.shapes import plane, uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Light, Lighting, Shadow
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.view import camera_of
from texbake.study.case import Case
from texbake.study.knob import Bench, Knob, Outcome, Setting
from texbake.study.truth.pictures import crop, picture_error
from texbake.study.truth.scenes import has_shadow, with_shadows, with_width
from texbake.study.truth.sight import sight_rays

_SIZES = (128, 256, 512, 1024, 2048, 4096)
_QUICK_SIZES = (64, 128)
_RADII = (0.0, 1.5, 4.0)  # texels
_CONVERGED = 8192
_BALL, _RADIUS = (0.0, 0.0, 1.0), 0.7
_LIGHT = (0.8, 0.5, -1.0)
_FLOOR = 8.0  # wide, about the origin
_GRAY = 0.8
_PER_SIDE = 8  # rays of the truth, along each side of a pixel


def _prepare(case: Case) -> Bench:
    values = [(n, r) for n in case.choose(_SIZES, _QUICK_SIZES) for r in _RADII]
    settings = tuple(Setting(f"{n}, {_filter(r)}", (n, r), _filter(r)) for n, r in values)
    if case.scene is not None and has_shadow(case.scene):
        return _on_scene(case.scene, settings, case)
    scene, camera = _made_scene()
    options = RenderOptions(
        width=case.choose(480, 64), height=case.choose(360, 48), supersampling=2,
        edges="supersample",
    )  # fmt: skip
    truth, floor = _cast(camera, options)

    def work(value: tuple[int, float]) -> npt.NDArray[np.float32]:
        shadow = Shadow(size=value[0], filter_radius=value[1])
        return draw(
            prepare(with_shadows(scene, shadow), options, threads=case.threads), camera
        ).color

    def judge(value: tuple[int, float], image: npt.NDArray[np.float32]) -> Outcome:
        return Outcome(picture_error(image, truth, floor), crop(image, (0.71, 0.48), zoom=4))

    return Bench(
        subject=f"a ball over a floor, {options.width} x {options.height} pixels",
        truth="closed form",
        truth_text=f"{_PER_SIDE**2} rays a pixel from the floor towards the light, held against "
        "the ball by formula; the ball's own pixels are left out.",
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
            mesh=floor.replace(positions=(floor.positions - (0.5, 0.5, 0.0)) * _FLOOR),
            material=Material(shading="lambert", base_color=(_GRAY,) * 3),
        ),
        SceneObject(
            mesh=ball.replace(positions=ball.positions * _RADIUS + np.array(_BALL)),
            material=Material(shading="lambert", base_color=(0.7, 0.35, 0.2)),
        ),
    )
    light = Light(direction=_LIGHT, intensity=1.0, shadow=Shadow())
    camera = Camera.looking_at(
        (0.4, -4.5, 3.2), (0.6, 0.2, 0.3), up=(0.0, 0.0, 1.0), fov=math.radians(36.0), near=0.01
    )
    return Scene(objects=items, lighting=Lighting(lights=(light,))), camera


def _cast(
    camera: Camera, options: RenderOptions
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.bool_]]:
    """(H, W, 3) picture of the floor, and (H, W) the pixels that see nothing else."""
    height, width = options.height, options.width
    rays = sight_rays(camera, width * _PER_SIDE, height * _PER_SIDE).reshape(-1, 3)
    to_light = -np.array(_LIGHT) / np.linalg.norm(_LIGHT)
    down = np.minimum(rays[:, 2], -1e-9)
    points = camera.eye - rays * (camera.eye[2] / down)[:, None]
    on_floor = (rays[:, 2] < 0.0) & (np.abs(points[:, :2]) < 0.5 * _FLOOR).all(axis=1)
    on_floor &= ~_meets_ball(np.broadcast_to(camera.eye, rays.shape), rays)
    lit = ~_meets_ball(points, np.broadcast_to(to_light, rays.shape))
    blocks = height, _PER_SIDE, width, _PER_SIDE
    shares = lit.reshape(blocks).mean(axis=(1, 3)) * (_GRAY * to_light[2])
    return (
        np.repeat(shares[..., None], 3, axis=2).astype(np.float32),
        on_floor.reshape(blocks).all(axis=(1, 3)),
    )


def _meets_ball(starts: FloatArray, directions: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether rays from outside the ball meet it ahead of them."""
    to_middle = np.array(_BALL) - starts
    along = np.einsum("ij,ij->i", to_middle, directions)
    squares = np.einsum("ij,ij->i", directions, directions)
    away = np.einsum("ij,ij->i", to_middle, to_middle) - along**2 / squares
    return np.asarray((along > 0.0) & (away < _RADIUS**2))


def _on_scene(scene: Scene, settings: tuple[Setting, ...], case: Case) -> Bench:
    options = with_width(scene.options(supersampling=2, buffer=None), case.choose(480, 64))
    camera = camera_of(scene, options)

    def drawn(shadow: Shadow, choices: RenderOptions) -> npt.NDArray[np.float32]:
        return draw(
            prepare(with_shadows(scene, shadow), choices, threads=case.threads), camera
        ).color

    def work(value: tuple[int, float]) -> npt.NDArray[np.float32]:
        return drawn(Shadow(size=value[0], filter_radius=value[1]), options)

    finest = Shadow(size=case.choose(_CONVERGED, 512), filter_radius=0.0)
    truth = drawn(finest, replace(options, supersampling=4, edges="supersample"))

    def judge(value: tuple[int, float], image: npt.NDArray[np.float32]) -> Outcome:
        return Outcome(picture_error(image, truth), crop(image))

    return Bench(
        subject=f"{scene.name}, {options.width} x {options.height} pixels",
        truth="converged",
        truth_text=f"Shadow maps of {finest.size} x {finest.size} without a filter, and 16 "
        "samples in each pixel, shaded one by one.",
        settings=settings,
        work=work,
        judge=judge,
    )


KNOB = Knob(
    name="shadow-map",
    title="Shadow map: size and filter",
    about="Texels a side of a shadow map, and the radius in texels over which its comparisons are "
    "averaged. A filter hides the steps of a coarse map and blurs the edge of a fine one.",
    error="picture, root mean square",
    unit="of 255",
    kind="picture",
    needs="scene",
    prepare=_prepare,
)
