"""The test models of Khronos, each by the criterion that it has printed on it or in its notes.

Based on: Khronos Group, "glTF Sample Assets", the descriptions of the models.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from texbake import Ambient, CameraView, Light, Lighting, RenderOptions, read_scene, render_scene
from texbake.rendering.scene.scene import place_mesh

pytestmark = pytest.mark.realdata

# Far enough away that the picture of a flat model is nearly a parallel projection.
FAR = 400.0
LIGHT = Lighting(
    lights=(Light(direction=(0.3, -0.4, -1.0), intensity=0.8),), ambient=Ambient(color=(0.3,) * 3)
)


def drawn(scene, center, side, size):
    """(size, size, 3) sRGB: a square of a model around a point, seen from far along z."""
    x, y, z = center
    view = CameraView(
        position=(x, y, z + FAR * side), target=tuple(center), up=(0, 1, 0),
        fov=2.0 * math.degrees(math.atan(0.5 / FAR)),
    )  # fmt: skip
    options = RenderOptions(width=size, height=size, supersampling=2)
    frame = render_scene(replace(scene, view=view, lighting=LIGHT), options)
    return np.clip(frame.color[..., :3], 0.0, 1.0) ** (1 / 2.2)


def cell(picture, center, side, corner, extent):
    """Pixels of a square of the model, its lower left corner in model units."""
    scale = len(picture) / side
    left = round((corner[0] - center[0] + side / 2) * scale)
    top = round((center[1] + side / 2 - corner[1] - extent) * scale)
    n = round(extent * scale)
    return picture[top : top + n, left : left + n]


def difference(picture, center, side, corner, other, extent):
    """Least mean difference of two squares, over shifts of 8 %: the marks are placed by hand."""
    shift = 0.08 * extent
    test = cell(picture, center, side, corner, extent)
    found = []
    for dx in np.linspace(-shift, shift, 13):
        for dy in np.linspace(-shift, shift, 13):
            sample = cell(picture, center, side, (other[0] + dx, other[1] + dy), extent)
            found.append(np.abs(test - sample).mean())
    return min(found)


def test_arrows_point_at_their_targets(data_dir):
    scene = read_scene(data_dir / "gltf/OrientationTest.glb")
    meshes = {item.name: place_mesh(item) for item in scene.objects}
    for side in ("X1", "X2", "Y1", "Y2", "Z1", "Z2"):
        arrow, target = meshes[f"Arrow{side}"].positions, meshes[f"Target{side}"].positions
        gap = np.linalg.norm(arrow[:, None] - target[None], axis=2).min()
        assert gap < 0.05  # of a cube of 10


@pytest.mark.parametrize(("name", "lefts", "steps"), [
    ("NormalTangentTest", (-1.11, -0.31, 0.49), (0.32,)),
    ("NormalTangentMirrorTest", (-1.425, 0.15), (0.32, 0.645, 0.97)),
])  # fmt: skip
def test_normal_maps_look_like_the_geometry_beside_them(data_dir, name, lefts, steps):
    scene = read_scene(data_dir / f"gltf/{name}.glb")
    center, side = (0.0, -0.12, 0.0), 3.0
    picture = drawn(scene, center, side, 600)  # 200 pixels per unit
    for left in lefts:
        for bottom in (-0.95, -0.55, -0.15, 0.25, 0.65):
            corner = np.array([left + 0.03, bottom + 0.03])
            assert cell(picture, center, side, corner, 0.24).std() > 0.02  # a ball
            for step in steps:
                beside = corner + np.array([step, 0.0])
                assert difference(picture, center, side, corner, beside, 0.24) < 0.03
