"""A wall that fills the picture, of which everything at every pixel is known in closed form."""

import numpy as np
import pytest
from random_scenes import write_images

from texbake import Lighting, Mesh, RenderOptions, Scene, SceneObject
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare

SIZE = 5.0  # half the side of the wall


def pixel_rays(camera, width, height):
    """(H, W, 3): directions through the middles of pixels, one unit deep."""
    origin, right, down = camera.view_rays(width, height)
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return origin + columns[..., None] * right + rows[..., None] * down


class Wall:
    """The square |x|, |y| <= 5 in z = 0 facing +z, (u, v) = (x, y) / 10 + 1/2, seen from z = 2.

    Attributes are (H, W, 3) float64 arrays of what lies at the middle of each pixel.
    """

    options = RenderOptions(width=24, height=16, supersampling=1, background=None)

    def __init__(self):
        self.camera = Camera.looking_at(
            (0.6, 0.4, 2.0), (0.1, -0.2, 0.0), fov=np.radians(60.0), near=0.01
        )
        rays = pixel_rays(self.camera, 24, 16)
        self.points = self.camera.eye - self.camera.eye[2] / rays[..., 2:] * rays
        self.to_eye = -rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        self.uvs = self.points[..., :2] / (2 * SIZE) + 0.5
        self.distances = np.linalg.norm(self.points - self.camera.eye, axis=-1)

    @staticmethod
    def mesh(normal=None, **fields):
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float64)
        faces = np.array([[0, 1, 2], [0, 2, 3]])
        if normal is not None:
            unit = np.asarray(normal, np.float64) / np.linalg.norm(normal)
            fields |= {"normals": unit[None], "normal_faces": np.zeros((2, 3), np.int32)}
        return Mesh(
            positions=np.concatenate([SIZE * (2 * corners - 1), np.zeros((4, 1))], axis=1),
            faces=faces,
            **{"uvs": corners, "uv_faces": faces, "name": "wall"} | fields,
        )

    def frame(self, material, lighting=None, *, options=None, normal=None, effects=None, **fields):
        """Draw the wall; `fields` are of its mesh."""
        scene = Scene(
            objects=(SceneObject(mesh=self.mesh(normal, **fields), material=material),),
            lighting=lighting or Lighting(),
        )
        chosen = {} if effects is None else {"effects": effects}
        return draw(prepare(scene, options or self.options, **chosen), self.camera)

    def light(self, *arguments, **named):
        """(16, 24, 3) float64: light that leaves each pixel's point."""
        frame = self.frame(*arguments, **named)
        assert (frame.coverage == 1.0).all()
        return frame.color[..., :3].astype(np.float64)


@pytest.fixture(scope="session")
def wall():
    return Wall()


@pytest.fixture(scope="session")
def images(tmp_path_factory):
    folder = tmp_path_factory.mktemp("images")
    write_images(folder)
    return folder
