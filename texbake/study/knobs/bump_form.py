"""First order against exact bump mapping, over the size of the bumps."""

from __future__ import annotations

import math

import numpy as np

from texbake.mesh.mesh import FloatArray
from texbake.mesh.shapes import uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.resolve import Frame
from texbake.rendering.scene.lights import Ambient, Light, Lighting
from texbake.rendering.scene.material import BumpMap, Material
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture
from texbake.study.case import Case
from texbake.study.knob import Bench, Knob, Outcome, Setting
from texbake.study.truth.pictures import crop
from texbake.study.truth.probes import angles_deg
from texbake.study.truth.radial import RadialSurface
from texbake.study.truth.sight import ball_points, sight_rays

_FORMS = ("blinn", "exact")
_SIZES = (0.01, 0.03, 0.1, 0.3)
_QUICK_SIZES = (0.01, 0.1)
# Of the rows and columns, for a crop that shows the whole ball.
_SKIPPED = 2
_EYE = (4.0, 0.0, 0.6)
# Cosine of the angle of sight beyond which the polygons of the ball show.
_LEAST_COSINE = 0.4


def _prepare(case: Case) -> Bench:
    side = case.choose(400, 80)
    n_lat = case.choose(256, 64)
    ball = uv_sphere(n_lat, 2 * n_lat)
    heights = _heights(case.choose(1024, 256)).astype(np.float32)[..., None]
    texture = ImageTexture(image=heights, filter="bilinear", wrap="repeat")
    camera = Camera.looking_at(
        _EYE, (0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), fov=math.radians(30.0), near=0.01
    )
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

    def judge(value: tuple[str, float], frame: Frame) -> Outcome:
        truth = _surface(value[1]).normals(points[seen])
        angles = angles_deg(frame.normals[seen].astype(np.float64), truth)
        return Outcome(
            error=float(angles.mean()),
            picture=crop(frame.color[::_SKIPPED, ::_SKIPPED]),
            figures={"angle, maximum (°)": float(angles.max())},
        )

    sizes = case.choose(_SIZES, _QUICK_SIZES)
    return Bench(
        subject=f"a ball of radius 1 with bumps of height d, {side} x {side} pixels",
        truth="closed form",
        truth_text="The normal of the surface r = 1 + d in the direction of each pixel's point of "
        "the ball, where it is seen by less than 66°.",
        settings=tuple(
            Setting(f"{form}, d = {size:g}", (form, size), form, f"d = {size:g}")
            for size in sizes
            for form in _FORMS
        ),
        work=work,
        judge=judge,
    )


def _waves(out: FloatArray) -> FloatArray:
    """Heights from -1 to 1 in the directions (..., 3)."""
    x, y, z = np.moveaxis(out, -1, 0)
    return np.asarray(0.5 * (np.sin(7.0 * y) * np.cos(5.0 * z) + np.sin(4.0 * x + 6.0 * z)))


def _surface(size: float) -> RadialSurface:
    return RadialSurface(lambda out: 1.0 + size * _waves(out))


def _heights(rows: int) -> FloatArray:
    """(rows, 2 rows): the waves over the coordinates of `uv_sphere`."""
    theta = math.pi * (np.arange(rows) + 0.5)[:, None] / rows
    phi = math.pi * (np.arange(2 * rows) + 0.5)[None, :] / rows
    out = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0.0 * phi], -1
    )
    return _waves(out)


KNOB = Knob(
    name="bump-form",
    title="Form of bump mapping",
    about="Blinn's first-order form leaves out that the surface under the bumps is bent itself, "
    "which is harmless while heights are small against its radius. The exact form keeps those "
    "terms.",
    error="angle of the normal, mean",
    unit="°",
    kind="angle",
    needs="nothing",
    prepare=_prepare,
)
