"""Pictures that are projected onto surfaces, as by a slide projector."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Annotated

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.mapping.classical.projector import whole_matrix
from texbake.mesh.mesh import FloatArray, frozen
from texbake.records import dataclass
from texbake.rendering.camera import Camera
from texbake.rendering.scene.lights import Vector
from texbake.rendering.scene.textures import ImageTexture
from texbake.schema import Option, check_fields, option
from texbake.texture.image import Image, read_header

# Share of the greatest stretch of a matrix below which its rays count as parallel, by rounding.
_PARALLEL = 1e-12

# Maps clip coordinates from -w to w to s and t from 0 to q; r and q are the depth.
_PICTURE_FROM_CLIP = np.array(
    [[0.5, 0.0, 0.0, 0.5], [0.0, 0.5, 0.0, 0.5], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]]
)


def projector_matrix(
    *,
    position: Vector,
    target: Vector,
    up: Vector = (0.0, 1.0, 0.0),
    fov: float = 35.0,
    aspect: float = 1.0,
) -> FloatArray:
    """(4, 4) matrix of a projector in world space, its vertical `fov` in degrees."""
    if not 0.0 < aspect < math.inf:
        raise OptionError(f"aspect: {aspect} is not above 0; it is width over height")
    # The near plane does not affect s, t and q.
    camera = Camera.looking_at(position, target, up=up, fov=math.radians(fov), near=1.0)
    return pm.matmul(_PICTURE_FROM_CLIP, camera.clip_from_world(aspect))


def projector_position(matrix: FloatArray) -> FloatArray:
    """(3,): the point where s, t and q of a projector's matrix (4, 4) are all 0."""
    rows = np.asarray(matrix, np.float64)[[0, 1, 3]]
    sizes, _ = pm.svd(rows[:, :3])
    if not sizes[2] > _PARALLEL * sizes[0]:
        raise OptionError("matrix: its rays are parallel; leave out facing and occlusion")
    return np.asarray(-pm.solve(rows[:, :3], rows[:, 3]))


def picture_aspect(texture: ImageTexture) -> float:
    """Width over height of a texture's picture; a file's pixels are not read for this."""
    image = texture.image
    if isinstance(image, np.ndarray):
        height, width = image.shape[:2]
    elif isinstance(image, Image):
        height, width = image.pixels.shape[:2]
    else:
        header = read_header(image)
        width, height = header.width, header.height
    return float(width / height)


@dataclass(frozen=True, kw_only=True, eq=False)
class ProjectedTexture:
    """A picture projected onto the surface, as by a slide projector.

    `matrix` (4, 4) takes world points to homogeneous (s, t, r, q); a (3, 4) matrix has the rows s,
    t and q, as cameras in computer vision do. The picture is looked up at (s/q, t/q) inside the
    unit square; points behind the projector (q <= 0) get none of it. It replaces the base color
    according to its own opacity times `strength`. If `matrix` is a function, it gets the `aspect`
    of the picture, whose file is opened only if the picture may hit something.
    """

    texture: Annotated[ImageTexture, Option("Image that is projected.")]
    matrix: Annotated[
        FloatArray | Callable[..., FloatArray],
        Option(
            "4 x 4 numbers that take a point of the world to (s, t, r, q), or 3 x 4 to (s, t, q)."
        ),
    ]
    strength: float = option(1.0, "Factor of the image's opacity.")
    facing: bool = option(False, "Whether surfaces that face away from the projector get no image.")
    occlusion: bool = option(
        False, "Whether surfaces that others hide from the projector get no image."
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if callable(self.matrix):
            self.matrix(aspect=1.0)  # raises if there is none
            return
        rows = np.array(self.matrix, np.float64)
        if rows.shape not in ((3, 4), (4, 4)) or not np.isfinite(rows).all():
            raise OptionError("matrix: it is not 4 x 4 or 3 x 4 finite numbers")
        object.__setattr__(self, "matrix", frozen(np.array(whole_matrix(rows.tolist()))))
        if self.facing or self.occlusion:
            projector_position(self.world_matrix)

    @cached_property
    def world_matrix(self) -> FloatArray:
        """(4, 4) float64: the matrix for the aspect of the picture."""
        if callable(self.matrix):
            return self.matrix(aspect=picture_aspect(self.texture))
        return np.asarray(self.matrix, np.float64)
