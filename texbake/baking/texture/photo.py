"""A photograph with what says where it shows a mesh, and lookups in its pixels."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.baking.texture.camera import PhotoCamera
from texbake.baking.texture.photo_sources import Views
from texbake.errors import OptionError
from texbake.files import PathLike
from texbake.mapping.options.checks import Matrix
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.texture.image import Image, read_image
from texbake.texture.mipmaps import mip_chain
from texbake.texture.sample import sample


@dataclass(frozen=True, kw_only=True, eq=False)
class Photo:
    """A photograph, and where it was taken from or where it shows each face.

    Attributes
    ----------
    image : path, Image or (H, W, C) float32
        An array holds linear colors, gray or red, green and blue. The second channel of two or the
        fourth of four is an opacity, which weighs them; a pixel that is not finite has none.
    camera : PhotoCamera or 4 x 4 numbers, optional
        The projector; a matrix as `texbake unwrap --method projector --matrix` takes it.
    mapped : Mesh, optional
        Instead of a camera: the baked mesh's faces, in their order, with texture coordinates that
        are places in the photograph. What lies outside the unit square is not in it.
    name : str, optional
        What messages call it; None: the name of its file.
    """

    image: PathLike | Image | npt.NDArray[np.float32]
    camera: PhotoCamera | Matrix | None = None
    mapped: Mesh | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        if (self.camera is None) == (self.mapped is None):
            raise OptionError("photo: give each a camera or a mesh with its coordinates, not both")


class Picture:
    """The pixels of a photograph, filtered, with their opacity.

    Attributes
    ----------
    name : str
    width, height : int
        In pixels.

    Raises
    ------
    FileError
        The photograph cannot be read.
    OptionError
        An array is not an image.
    """

    def __init__(self, photo: Photo, number: int, *, threads: int | None = None) -> None:
        if isinstance(photo.image, str | os.PathLike):
            image = read_image(photo.image, color=True, threads=threads)
        elif isinstance(photo.image, Image):
            image = photo.image
        else:
            image = Image(np.asarray(photo.image, np.float32), name=f"photograph {number + 1}")
        self.name = photo.name or Path(image.name).name
        pixels = image.pixels
        if pixels.ndim != 3 or pixels.size == 0 or pixels.shape[2] > 4:
            raise OptionError(f"{self.name}: the shape {pixels.shape} is not (height, width, 1-4)")
        self.height, self.width = pixels.shape[:2]
        self._threads = threads
        self._chain = mip_chain(_weighed(pixels), kind="color", wrap="clamp", threads=threads)

    def weighted(self, views: Views) -> FloatArray:
        """(m, 4) float64: colors times their weights, and those weights, of opacity as well."""
        found = sample(
            self._chain,
            views.coordinates,
            views.derivatives,
            filter="ewa",
            wrap="clamp",
            threads=self._threads,
        )
        return found * views.weights[:, None]


def _weighed(pixels: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(H, W, 4) float32: colors times opacity, and opacity."""
    n_colors = 1 if pixels.shape[2] < 3 else 3
    weighed = np.ones((*pixels.shape[:2], 4), np.float32)
    weighed[..., :3] = pixels[..., :n_colors]
    if pixels.shape[2] > n_colors:
        weighed[..., 3] = np.clip(pixels[..., n_colors], 0.0, 1.0)
        weighed[..., :3] *= weighed[..., 3:]
    weighed[~np.isfinite(weighed).all(axis=2)] = 0.0
    return weighed
