"""Knobs of displacement: what it adds to a normal map, and how finely a mesh is cut for it."""

from __future__ import annotations

import math

import numpy as np

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.mesh.mesh import Float32Array, FloatArray
from texbake.mesh.shapes import plane
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render
from texbake.rendering.resolve import Frame, picture_error
from texbake.rendering.scene.lights import Ambient, Light, Lighting
from texbake.rendering.scene.material import Displacement, Material
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture
from texbake.study.knob import Case, Evaluation, Experiment, Knob, Setting
from texbake.study.truth.pictures import crop, sight_rays
from texbake.study.truth.surfaces import texel_grid, wave_heights, wave_slopes

_KINDS = {
    "bare": (),
    "normal map": ("normal",),
    "displacement": ("displacement",),
    "both": ("normal", "displacement"),
}


def _prepare_surface_detail(case: Case) -> Experiment:
    pair = case.pair
    size = case.choose(2048, 128)
    baked = bake(
        pair.high,
        pair.low,
        BakeOptions(size=size, maps=("normal", "displacement"), threads=case.threads),
    )
    maps: dict[str, Float32Array] = {
        "normal": baked.maps["normal"].values,
        "displacement": baked.maps["displacement"].values[..., 0],
    }
    pixels = case.choose(600, 96)
    options = RenderOptions(width=pixels, height=pixels, supersampling=2)
    camera = Camera.framing(pair.high, pair.low, options=options)
    truth = render(pair.high, options=options, camera=camera, threads=case.threads)

    def work(kind: str) -> Frame:
        chosen = _KINDS[kind]
        return render(
            pair.low,
            normal_map=maps["normal"] if "normal" in chosen else None,
            displacement=maps["displacement"] if "displacement" in chosen else None,
            options=options,
            camera=camera,
            threads=case.threads,
        )

    def judge(kind: str, frame: Frame) -> Evaluation:
        either = (frame.coverage > 0.0) | (truth.coverage > 0.0)
        outline = np.abs(frame.coverage - truth.coverage)
        return Evaluation(
            error=picture_error(frame.color, truth.color, either),
            picture=crop(frame.color, (0.5, 0.5)),
            figures={
                "silhouette (% of the mesh's pixels)": 100.0
                * float(outline.sum() / truth.coverage.sum())
            },
        )

    return Experiment(
        subject=f"{pair.subject}, maps of {size} x {size}, {pixels} x {pixels} pixels",
        truth="high-poly mesh",
        truth_text="A picture of the high-poly mesh itself with the same camera and lighting.",
        settings=tuple(Setting(kind, kind) for kind in _KINDS),
        work=work,
        judge=judge,
    )


SURFACE_DETAIL_KNOB = Knob(
    name="surface-detail",
    title="Normal map, displacement, both",
    about="A normal map shades a low-poly mesh as if it were the high-poly one and leaves its "
    "silhouette unchanged. Displacement changes the silhouette too, at the price of all the "
    "triangles that the mesh is divided into.",
    error="picture, root mean square",
    unit="of 255",
    kind="picture",
    prepare=_prepare_surface_detail,
)


_EDGES = (32.0, 16.0, 8.0, 4.0, 2.0, 1.0)
_QUICK_EDGES = (16.0, 8.0, 4.0)


def _prepare_tessellation(case: Case) -> Experiment:
    width, height = case.choose((640, 480), (96, 72))
    heights = wave_heights(*texel_grid(case.choose(2048, 512))).astype(np.float32)
    texture = ImageTexture(image=heights[..., None], filter="bilinear", wrap="repeat")
    camera = Camera.looking_at(
        (0.5, -0.75, 0.75), (0.5, 0.5, 0.0), up=(0.0, 0.0, 1.0), fov=math.radians(36.0), near=0.01
    )
    options = RenderOptions(width=width, height=height, supersampling=1)
    lighting = Lighting(
        lights=(Light(direction=(1.0, 0.6, -0.9), intensity=1.0),),
        ambient=Ambient(color=(0.1, 0.1, 0.12)),
    )
    mesh = plane(4, 4)

    def work(edge_px: float) -> Frame:
        relief = Displacement(texture=texture, height=1.0, mid=0.0, edge_px=edge_px)
        material = Material(shading="lambert", displacement=relief)
        scene = Scene(objects=(SceneObject(mesh=mesh, material=material),), lighting=lighting)
        return draw(prepare(scene, options, threads=case.threads), camera)

    def judge(edge_px: float, frame: Frame) -> Evaluation:
        off = _distances(frame, camera)
        shown = np.unique(frame.face_ids[frame.face_ids >= 0])
        return Evaluation(
            error=100.0 * float(off.mean()),
            picture=crop(frame.color, (0.4, 0.45)),
            figures={
                "maximum (% of width)": 100.0 * float(off.max()),
                "triangles in the picture": float(len(shown)),
            },
        )

    return Experiment(
        subject=f"a square displaced by four waves, {width} x {height} pixels",
        truth="closed form",
        truth_text="The waves themselves: how far the surface point that each pixel sees is from "
        "z = h(x, y), divided by the length of the gradient.",
        settings=tuple(Setting(f"{edge:g} px", edge) for edge in case.choose(_EDGES, _QUICK_EDGES)),
        work=work,
        judge=judge,
    )


def _distances(frame: Frame, camera: Camera) -> FloatArray:
    """(n,) distances between points that pixels see and the waves, in widths of the square."""
    seen = frame.face_ids >= 0
    rays = sight_rays(camera, frame.width, frame.height)[seen]
    points = camera.eye + rays * frame.depths[seen].astype(np.float64)[:, None]
    x, y, z = points.T
    along, up = wave_slopes(x, y)
    return np.asarray(np.abs(z - wave_heights(x, y)) / np.sqrt(1.0 + along**2 + up**2))


TESSELLATION_KNOB = Knob(
    name="tessellation",
    title="Tessellation of a displaced mesh",
    about="The longest edge, in pixels, of the triangles that a displaced surface is divided into. "
    "Halving it makes four times the triangles and a quarter of the error, until it is as fine as "
    "the picture.",
    error="distance from the surface, mean",
    unit="% of width",
    kind="length",
    prepare=_prepare_tessellation,
)
