"""A floor seen at a grazing angle: what each pixel sees of it, in closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray
from texbake.rendering.camera import Camera
from texbake.study.truth.sight import sight_rays

_EYE = (0.0, 0.35, 0.0)
_TARGET = (0.0, 0.0, -1.2)
_FOV = math.radians(40.0)


@dataclass(frozen=True)
class Floor:
    """The plane y = 0 with coordinates u = x, v = -z, in a picture of `width` x `height`."""

    width: int
    height: int

    @property
    def camera(self) -> Camera:
        """Where it is seen from; the horizon lies above the picture."""
        return Camera.looking_at(_EYE, _TARGET, fov=_FOV, near=0.01)

    def rays(self, right: float = 0.0, down: float = 0.0) -> FloatArray:
        """(H, W, 3) directions of sight, as deep as they go along the view.

        `right` and `down` are in pixels from the middle of each.
        """
        return sight_rays(self.camera, self.width, self.height, right=right, down=down)

    def uvs(self, right: float = 0.0, down: float = 0.0) -> FloatArray:
        """(H · W, 2) texture coordinates that pixels see."""
        rays = self.rays(right, down).reshape(-1, 3)
        points = self.camera.eye + rays * (self.camera.eye[1] / -rays[:, 1])[:, None]
        return np.stack([points[:, 0], -points[:, 2]], axis=1)

    def changes(self) -> npt.NDArray[np.float32]:
        """(H · W, 4) du/dx, dv/dx, du/dy, dv/dy of the coordinates for one pixel, exactly.

        u is a quotient of two functions that are linear over the picture, and so is v.
        """
        here, eye = self.rays().reshape(-1, 3), self.camera.eye
        to_right = (self.rays(right=1.0) - self.rays()).reshape(-1, 3)
        to_below = (self.rays(down=1.0) - self.rays()).reshape(-1, 3)
        columns = [
            sign * -eye[1] * (step[:, axis] * here[:, 1] - here[:, axis] * step[:, 1])
            / here[:, 1] ** 2
            for step in (to_right, to_below)
            for axis, sign in ((0, 1.0), (2, -1.0))
        ]  # fmt: skip
        return np.stack(columns, axis=1).astype(np.float32)
