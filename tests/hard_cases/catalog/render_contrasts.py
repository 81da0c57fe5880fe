"""Contrasts on the screen: perspective, depth, mirrors and lenses, and lights at distance 0."""

from __future__ import annotations

from typing import Any

import numpy as np
from catalog.contrast import Contrast, not_finite
from catalog.scenes import SCENES, floor, looking, scene

import texbake
from texbake import CameraView, Material, RenderOptions, Scene, SceneObject
from texbake.mesh.shapes import plane

OPTIONS = RenderOptions(width=64, height=64, supersampling=1, fov=60.0, background=None)
BY_NAME = {case.name: case for case in SCENES}


def _rendered(made: Scene) -> Any:
    return texbake.render_scene(made, OPTIONS, threads=1)


def _pixel_rays() -> Any:
    """(64, 64, 3) directions through the pixels' centers, along -z."""
    x, y = np.meshgrid(*[(np.arange(64) + 0.5) / 32.0 - 1.0] * 2)
    slope = np.tan(np.radians(30.0))
    return np.stack([x * slope, -y * slope, -np.ones((64, 64))], axis=-1)


def _ground() -> Scene:
    """A floor that begins behind the eye."""
    return scene(
        SceneObject(mesh=floor(40.0, -1.0)), view=looking((0.0, 0.0, 0.0), (0.0, 0.0, -1.0))
    )


def _divided_by_w(made: Scene) -> Any:
    """Corners divided by w, whatever its sign, and triangles filled between them."""
    mesh = made.objects[0].mesh
    slope = np.tan(np.radians(30.0))
    screen = mesh.positions[:, :2] / (-mesh.positions[:, 2:] * slope)
    points = _pixel_rays()[..., :2] / slope
    covered = np.zeros((64, 64), bool)
    for a, b, c in screen[mesh.faces]:
        signs = [
            (q - p)[0] * (points - p)[..., 1] - (q - p)[1] * (points - p)[..., 0] > 0
            for p, q in ((a, b), (b, c), (c, a))
        ]
        covered |= (signs[0] == signs[1]) & (signs[1] == signs[2])
    return covered


def _ground_error(_: Scene, covered: Any) -> float:
    """Pixels that differ from the closed form: whose ray meets the floor's square."""
    rays = _pixel_rays()
    with np.errstate(divide="ignore"):
        reach = -1.0 / rays[..., 1]
    x, z = rays[..., 0] * reach, rays[..., 2] * reach
    expected = (reach > 0) & (np.abs(x) < 20.0) & (np.abs(z) < 20.0)
    return float(np.count_nonzero(covered != expected))


def _two_walls() -> Scene:
    """Two walls a millionth of their distance apart, a million near planes away."""
    wall = plane()
    points = wall.positions - [0.5, 0.5, 0.0]
    near, far = (wall.replace(positions=points * 3e3 - [0, 0, d]) for d in (1e3, 1e3 * (1 + 1e-6)))
    red, green = (Material(shading="unlit", base_color=c) for c in ((1.0, 0, 0), (0, 1.0, 0)))
    view = CameraView(position=(0.0, 0.0, 0.0), target=(0.0, 0.0, -1.0), near=1e-3)
    return scene(
        SceneObject(mesh=near, material=red), SceneObject(mesh=far, material=green), view=view
    )


def _usual_depth(_: Scene) -> Any:
    """z from 0 at the near to 1 at the far plane in float32; what comes last wins where equal."""
    n, f = np.float32(1e-3), np.float32(1e6)
    depths = [f / (f - n) * (1 - n / np.float32(d)) for d in (1e3, 1e3 * (1 + 1e-6))]
    return np.full((64, 64), depths[1] <= depths[0])


def _slanted() -> Scene:
    """A wall of two triangles that leads away from the eye, with a black and a white half."""
    halves = np.zeros((1, 2, 3), np.float32)
    halves[:, 1] = 1.0
    picture = texbake.ImageTexture(image=halves, filter="nearest")
    wall = plane()
    x, y = wall.positions[:, 0], wall.positions[:, 1]
    points = np.column_stack(
        [np.where(x > 0, 6.0, -0.9), (y - 0.5) * 8.0, np.where(x > 0, -9, -1.2)]
    )
    return scene(
        SceneObject(
            mesh=wall.replace(positions=points),
            material=Material(shading="unlit", base_color=picture, double_sided=True),
        ),
        view=looking((0.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
    )


def _affine(made: Scene) -> Any:
    options = RenderOptions(
        width=64, height=64, supersampling=1, fov=60.0, background=None, interpolation="affine"
    )
    return texbake.render_scene(made, options, threads=1).color


def _wall_error(made: Scene, color: Any) -> float:
    """Pixels of the wrong half, against the ray's own place on the wall."""
    points = made.objects[0].mesh.positions
    origin, along = points[0], points[1] - points[0]
    rays = _pixel_rays()
    # In the ground plan: origin + s along = t ray.
    s = (origin[0] * rays[..., 2] - origin[2] * rays[..., 0]) / (
        along[2] * rays[..., 0] - along[0] * rays[..., 2]
    )
    seen = color[..., 3] > 0.0
    return float(np.count_nonzero(seen & ((color[..., 0] > 0.5) != (s > 0.5))))


def _bent(_: Scene) -> Any:
    """Snell's law from inside glass, at all angles."""
    sines = 1.5 * np.sin(np.linspace(0.0, np.pi / 2.0, 4096))
    return np.sqrt(1.0 - sines**2)


def _lit(made: Scene) -> Any:
    """1 / d² and n · l at points of the floor, its middle among them."""
    points = made.objects[0].mesh.positions
    to_light = -points
    distances = np.linalg.norm(to_light, axis=1, keepdims=True)
    return (to_light / distances) @ [0.0, 1.0, 0.0] / distances[:, 0] ** 2


def _colors(made: Scene) -> Any:
    return _rendered(made).color.reshape(-1, 4)


RENDER_CONTRASTS = (
    Contrast(name="w through 0",
             wrong="corners behind the camera appear in front",
             unit="wrong pixels of 4096", prepare=_ground, naive=_divided_by_w,
             ours=lambda made: _rendered(made).coverage > 0.5, error=_ground_error, bound=0.0,
             why="exact", alike=False),
    Contrast(name="walls 1e-6 apart, 1e6 near planes away",
             wrong="both depths round to one float32",
             unit="pixels that show the wall behind", prepare=_two_walls, naive=_usual_depth,
             ours=lambda made: _rendered(made).color[..., 1] > 0.5,
             error=lambda _, behind: float(np.count_nonzero(behind)), bound=0.0,
             why="exact", alike=False),
    Contrast(name="a wall that leads away",
             wrong="coordinates are interpolated in screen space",
             unit="pixels in the wrong half, of 4096", prepare=_slanted, naive=_affine,
             ours=lambda made: _rendered(made).color, error=_wall_error, bound=0.0, why="exact"),
    Contrast(name="refraction past the critical angle",
             wrong="the square root of a negative number",
             unit="directions or pixels that are NaN",
             prepare=BY_NAME["refraction past the critical angle"].make, naive=_bent, ours=_colors,
             error=not_finite, bound=0.0,
             why="exact", alike=False),
    Contrast(name="a light at a vertex",
             wrong="0 / 0 and 1 / 0²",
             unit="points or pixels that are NaN",
             prepare=BY_NAME["point light at a vertex"].make, naive=_lit, ours=_colors,
             error=not_finite, bound=0.0,
             why="exact", alike=False),
)  # fmt: skip
