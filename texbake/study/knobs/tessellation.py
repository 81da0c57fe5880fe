"""How finely a displaced mesh is cut."""

from __future__ import annotations

import math

import numpy as np

from texbake.mesh.mesh import FloatArray
from texbake.mesh.shapes import plane
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.resolve import Frame
from texbake.rendering.scene.lights import Ambient, Light, Lighting
from texbake.rendering.scene.material import Displacement, Material
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture
from texbake.study.case import Case
from texbake.study.knob import Bench, Knob, Outcome, Setting
from texbake.study.truth.pictures import crop
from texbake.study.truth.sight import sight_rays
from texbake.study.truth.waves import texel_grid, wave_heights, wave_slopes

_EDGES = (32.0, 16.0, 8.0, 4.0, 2.0, 1.0)
_QUICK_EDGES = (16.0, 8.0, 4.0)


def _prepare(case: Case) -> Bench:
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

    def judge(edge_px: float, frame: Frame) -> Outcome:
        off = _distances(frame, camera)
        shown = np.unique(frame.face_ids[frame.face_ids >= 0])
        return Outcome(
            error=100.0 * float(off.mean()),
            picture=crop(frame.color, (0.4, 0.45)),
            figures={
                "maximum (% of width)": 100.0 * float(off.max()),
                "triangles in the picture": float(len(shown)),
            },
        )

    return Bench(
        subject=f"a square displaced by four waves, {width} x {height} pixels",
        truth="closed form",
        truth_text="The waves themselves: how far the surface point that each pixel sees lies off "
        "z = h(x, y), divided by the length of its gradient.",
        settings=tuple(Setting(f"{edge:g} px", edge) for edge in case.choose(_EDGES, _QUICK_EDGES)),
        work=work,
        judge=judge,
    )


def _distances(frame: Frame, camera: Camera) -> FloatArray:
    """(n,) distances of the points that pixels see from the waves, in widths of the square."""
    seen = frame.face_ids >= 0
    rays = sight_rays(camera, frame.width, frame.height)[seen]
    points = camera.eye + rays * frame.depths[seen].astype(np.float64)[:, None]
    x, y, z = points.T
    along, up = wave_slopes(x, y)
    return np.asarray(np.abs(z - wave_heights(x, y)) / np.sqrt(1.0 + along**2 + up**2))


KNOB = Knob(
    name="tessellation",
    title="Tessellation of a displaced mesh",
    about="The longest edge, in pixels, of the triangles that a displaced surface is cut into. "
    "Halving it makes four times the triangles and a quarter of the distance, until it is as fine "
    "as the picture.",
    error="distance from the surface, mean",
    unit="% of width",
    kind="length",
    needs="nothing",
    prepare=_prepare,
)
