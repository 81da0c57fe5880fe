"""Knobs of bump mapping: how slopes are taken from heights, and how they turn normals."""

from __future__ import annotations

import math

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.mesh import Float32Array, FloatArray, Mesh
from texbake.mesh.shapes import uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.resolve import Frame
from texbake.rendering.scene.lights import Ambient, Light, Lighting
from texbake.rendering.scene.material import BumpMap, Material
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture
from texbake.study.knob import Case, Evaluation, Experiment, Knob, Setting
from texbake.study.truth.pictures import ball_points, crop, sight_rays
from texbake.study.truth.probes import angles_deg
from texbake.study.truth.surfaces import RadialSurface, texel_grid, wave_heights, wave_normals
from texbake.texture.heights_and_normals import height_to_normal
from texbake.texture.lookup import lookup
from texbake.texture.options import HeightToNormalOptions

_BUMP_GRADIENT_SIZES = (64, 128, 256, 512, 1024)
_BUMP_GRADIENT_QUICK_SIZES = (32, 64)
_FORWARD, _ANALYTIC = "forward", "analytic"
_METHODS = (_FORWARD, "central", "sobel", "scharr", _ANALYTIC)


def _prepare_bump_gradient(case: Case) -> Experiment:
    sizes = case.choose(_BUMP_GRADIENT_SIZES, _BUMP_GRADIENT_QUICK_SIZES)
    grids = {size: tuple(axis.astype(np.float32) for axis in texel_grid(size)) for size in sizes}
    # The heights themselves are exact: only what is made from them is judged.
    heights = {size: wave_heights(*texel_grid(size)).astype(np.float32) for size in sizes}
    points = np.random.default_rng(0).random((case.choose(200_000, 5_000), 2))
    truth = wave_normals(points[:, 0], points[:, 1])

    def work(value: tuple[str, int]) -> Float32Array:
        method, size = value
        if method == _ANALYTIC:
            return np.asarray(wave_normals(*grids[size]), np.float32)
        if method == _FORWARD:
            return forward_normals(heights[size])
        return height_to_normal(heights[size], HeightToNormalOptions(scale=1.0, derivative=method))

    def judge(value: tuple[str, int], normals: Float32Array) -> Evaluation:
        angles = angles_deg(lookup(normals, points, threads=case.threads).astype(np.float64), truth)
        direction = np.array([-0.5, 0.5, 0.707], np.float32)
        shade = np.clip(pm.matmul(normals, direction), 0.0, 1.0)[..., None].repeat(3, axis=2)
        return Evaluation(
            error=float(angles.mean()),
            picture=crop(shade[: max(len(shade) // 4, 1), : max(len(shade) // 4, 1)]),
            figures={"angle, maximum (°)": float(angles.max())},
        )

    return Experiment(
        subject="four waves over the unit square, as heights in float32",
        truth="closed form",
        truth_text="The slopes of the waves by calculus, at points between texels, where normals "
        "are read bilinearly.",
        settings=tuple(
            Setting(f"{method} 1/{size}", (method, size), method)
            for size in sizes
            for method in _METHODS
        ),
        work=work,
        judge=judge,
    )


def forward_normals(heights: Float32Array) -> Float32Array:
    """(H, W, 3) normals from the difference to the next texel, as textbooks define bumps."""
    along_x = (np.roll(heights, -1, axis=1) - heights) * np.float32(heights.shape[1])
    up_y = (np.roll(heights, 1, axis=0) - heights) * np.float32(heights.shape[0])
    normals = np.stack([-along_x, -up_y, np.ones_like(heights)], axis=-1)
    return np.asarray(normals / np.sqrt(np.square(normals).sum(axis=-1, keepdims=True)))


BUMP_GRADIENT_KNOB = Knob(
    name="bump-gradient",
    title="Gradient of a bump map",
    about="Slopes of a height map from differences over one texel (1/64 to 1/1024 of its width), "
    "and by calculus. A forward difference is the slope half a texel too far; Sobel and Scharr "
    "average across, which suppresses noise and blurs exact heights.",
    error="angle of the normal, mean",
    unit="°",
    kind="angle",
    prepare=_prepare_bump_gradient,
)


_FORMS = ("blinn", "exact")
_LIT_FORMS = ("emboss", "emboss-normalized", "blinn", "exact")
_BUMP_FORM_SIZES = (0.01, 0.03, 0.1, 0.3)
_BUMP_FORM_QUICK_SIZES = (0.01, 0.1)
# Steps between rows and between columns, for a crop that shows the whole ball.
_SKIPPED = 2
_EYE = (4.0, 0.0, 0.6)
# Cosine of the viewing angle below which the polygons of the ball show.
_LEAST_COSINE = 0.4


def _view() -> Camera:
    return Camera.looking_at(
        _EYE, (0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), fov=math.radians(30.0), near=0.01
    )


def _ball_and_heights(case: Case) -> tuple[Mesh, ImageTexture]:
    n_lat = case.choose(256, 64)
    heights = _heights(case.choose(1024, 256)).astype(np.float32)[..., None]
    texture = ImageTexture(image=heights, filter="bilinear", wrap="repeat")
    return uv_sphere(n_lat, 2 * n_lat), texture


def _prepare_bump_form(case: Case) -> Experiment:
    side = case.choose(400, 80)
    ball, texture = _ball_and_heights(case)
    camera = _view()
    options = RenderOptions(width=side, height=side, supersampling=1)
    lighting = Lighting(
        lights=(Light(direction=(-1.0, 0.7, -0.8)),), ambient=Ambient(color=(0.08, 0.08, 0.1))
    )
    points, cosines = ball_points(camera, sight_rays(camera, side, side), np.zeros(3), 1.0)
    seen = cosines > _LEAST_COSINE

    def work(value: tuple[str, float]) -> Frame:
        form, size = value
        material = Material(
            shading="lambert", bump_map=BumpMap(texture=texture, height=size, form=form)
        )
        scene = Scene(objects=(SceneObject(mesh=ball, material=material),), lighting=lighting)
        return draw(prepare(scene, options, threads=case.threads), camera, keep=("normals",))

    def judge(value: tuple[str, float], frame: Frame) -> Evaluation:
        truth = _surface(value[1]).normals(points[seen])
        angles = angles_deg(frame.normals[seen].astype(np.float64), truth)
        return Evaluation(
            error=float(angles.mean()),
            picture=crop(frame.color[::_SKIPPED, ::_SKIPPED]),
            figures={"angle, maximum (°)": float(angles.max())},
        )

    sizes = case.choose(_BUMP_FORM_SIZES, _BUMP_FORM_QUICK_SIZES)
    return Experiment(
        subject=f"a ball of radius 1 with bumps of height d, {side} x {side} pixels",
        truth="closed form",
        truth_text="The normal of the surface r = 1 + d in the direction of each pixel's point on "
        "the ball, where the viewing angle is less than 66°.",
        settings=tuple(
            Setting(f"{form}, d = {size:g}", (form, size), form, f"d = {size:g}")
            for size in sizes
            for form in _FORMS
        ),
        work=work,
        judge=judge,
    )


def _waves(out: FloatArray) -> FloatArray:
    """Return heights from -1 to 1 in the directions (..., 3)."""
    x, y, z = np.moveaxis(out, -1, 0)
    return np.asarray(0.5 * (pm.sin(7.0 * y) * pm.cos(5.0 * z) + pm.sin(4.0 * x + 6.0 * z)))


def _surface(size: float) -> RadialSurface:
    return RadialSurface(lambda out: 1.0 + size * _waves(out))


def _heights(rows: int) -> FloatArray:
    """(rows, 2 rows) heights of the waves over the coordinates of `uv_sphere`."""
    theta = math.pi * (np.arange(rows) + 0.5)[:, None] / rows
    phi = math.pi * (np.arange(2 * rows) + 0.5)[None, :] / rows
    out = np.stack(
        [pm.sin(theta) * pm.cos(phi), pm.sin(theta) * pm.sin(phi), pm.cos(theta) + 0.0 * phi], -1
    )
    return _waves(out)


BUMP_FORM_KNOB = Knob(
    name="bump-form",
    title="Form of bump mapping",
    about="Blinn's first-order form ignores that the surface under the bumps is curved itself, "
    "which is harmless while heights are small compared with its radius. The exact form keeps "
    "those terms.",
    error="angle of the normal, mean",
    unit="°",
    kind="angle",
    prepare=_prepare_bump_form,
)


_LIGHT = (-1.0, 0.35, -0.4)
# Least cosine of the angle to the light, with bumps and without: no form bends light around a side.
_LEAST_LIT = 0.15


def _prepare_bump_light(case: Case) -> Experiment:
    side = case.choose(400, 80)
    ball, texture = _ball_and_heights(case)
    camera = _view()
    options = RenderOptions(width=side, height=side, supersampling=1)
    points, cosines = ball_points(camera, sight_rays(camera, side, side), np.zeros(3), 1.0)
    to_light = -np.asarray(_LIGHT) / pm.norm(_LIGHT)
    seen = (cosines > _LEAST_COSINE) & (pm.matmul(points, to_light) > _LEAST_LIT)

    def work(value: tuple[str, float]) -> Frame:
        form, size = value
        bumps = BumpMap(texture=texture, height=size, form=form)
        material = Material(shading="lambert", base_color=(1.0, 1.0, 1.0), bump_map=bumps)
        lighting = Lighting(lights=(Light(direction=_LIGHT),))
        scene = Scene(objects=(SceneObject(mesh=ball, material=material),), lighting=lighting)
        return draw(prepare(scene, options, threads=case.threads), camera)

    def judge(value: tuple[str, float], frame: Frame) -> Evaluation:
        truth = pm.matmul(_surface(value[1]).normals(points[seen]), to_light)
        lit = truth > _LEAST_LIT
        light = frame.color[seen][lit, 0].astype(np.float64)
        angles = np.degrees(np.abs(pm.arccos(np.clip(light, 0.0, 1.0)) - pm.arccos(truth[lit])))
        return Evaluation(
            error=float(angles.mean()),
            picture=crop(frame.color[::_SKIPPED, ::_SKIPPED]),
            figures={
                "angle, maximum (°)": float(angles.max()),
                "too bright by, maximum": float((light - truth[lit]).max()),
            },
        )

    sizes = case.choose(_BUMP_FORM_SIZES, _BUMP_FORM_QUICK_SIZES)
    return Experiment(
        subject=f"a white ball of radius 1 with bumps of height d in one light, {side} x {side} "
        "pixels",
        truth="closed form",
        truth_text="The angle between the light and the normal of the surface r = 1 + d, where "
        "both the ball and the surface face the light. That of a picture is the arc cosine of its "
        "brightness.",
        settings=tuple(
            Setting(f"{form.replace('-', ' ')}, d = {size:g}", (form, size), form, f"d = {size:g}")
            for size in sizes
            for form in _LIT_FORMS
        ),
        work=work,
        judge=judge,
    )


BUMP_LIGHT_KNOB = Knob(
    name="bump-light",
    title="Light on bumps",
    about="Embossing takes the slope of the heights along the light. Without the length of the "
    "bent normal slopes are too bright. Divided by it, the light is that of Blinn's form, and the "
    "exact form also knows that the surface under the bumps is curved.",
    error="angle to the light, mean",
    unit="°",
    kind="angle",
    prepare=_prepare_bump_light,
)
