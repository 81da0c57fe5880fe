"""The images of a high-poly mesh's materials, decoded once, and their values at hits."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.materials import ChannelImage
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands
from texbake.texture.lookup import lookup

Float32Array = npt.NDArray[np.float32]

_BAND = 1 << 15


@dataclass(eq=False)
class ChannelImages:
    """Looks up what channels read of images; decodes each image when it is first needed.

    Attributes
    ----------
    uvs : mapping of int to (T, 2) float64
        Sets of texture coordinates by their numbers.
    uv_faces : (F, 3) int32
        Indices into those of each set.
    threads : int, optional
    """

    uvs: dict[int, FloatArray]
    uv_faces: IntArray
    threads: int | None = None
    _decoded: dict[tuple[str, bool, tuple[int, ...]], Float32Array] = field(default_factory=dict)

    def values(
        self, image: ChannelImage, faces: IntArray, barycentrics: Float32Array, *, is_color: bool
    ) -> Float32Array:
        """(n, components) float32: linear values at points of faces, looked up bilinearly.

        Parameters
        ----------
        image
        faces : (n,) int32
        barycentrics : (n, 2) float32
            Weights of the second and third corner.
        is_color
            Whether an 8-bit image is coded in sRGB.
        """
        pixels = self._pixels(image, is_color)
        places = self._places(image, faces, barycentrics)
        if image.is_nearest:
            sizes = np.array([pixels.shape[1], pixels.shape[0]])
            places = (np.floor(places * sizes) + 0.5) / sizes
        wrap = image.wraps[0]
        if wrap != image.wraps[1]:
            places = _wrapped(places, image.wraps, (pixels.shape[1], pixels.shape[0]))
            wrap = "repeat"
        return lookup(pixels, places, wrap=wrap, threads=self.threads)

    def _pixels(self, image: ChannelImage, is_color: bool) -> Float32Array:
        key = image.name, is_color, image.components
        if key not in self._decoded:
            self._decoded[key] = decoded_image(image, is_color=is_color)
        return self._decoded[key]

    def _places(
        self, image: ChannelImage, faces: IntArray, barycentrics: Float32Array
    ) -> FloatArray:
        """(n, 2) float64: texture coordinates in an image."""
        places = np.empty((len(faces), 2))
        placing = np.array(image.placing)
        uvs, corners = self.uvs[image.uv_set], self.uv_faces

        def work(start: int, stop: int) -> None:
            band = slice(start, stop)
            core.place_in_image(
                faces[band], barycentrics[band], uvs, corners, placing, places[band]
            )

        run_bands(work, len(faces), band=_BAND, threads=self.threads)
        return places


def decoded_image(image: ChannelImage, *, is_color: bool) -> Float32Array:
    """(H, W, components) float32: the components of an image that a channel reads, linear.

    A gray image has its gray in red, green and blue; one without alpha is opaque.
    """
    from texbake.texture.image import decode_image

    pixels = decode_image(image.data, image.name, color=is_color).pixels
    n = pixels.shape[2]
    alpha = n - 1 if n in (2, 4) else None
    columns = []
    for component in image.components:
        index: int | None = component if n >= 3 else 0
        if component == 3:
            index = alpha
        if index is None:
            columns.append(np.ones(pixels.shape[:2], np.float32))
        else:
            columns.append(pixels[:, :, index])
    if image.components == tuple(range(n)):
        return np.ascontiguousarray(pixels)
    return np.ascontiguousarray(np.stack(columns, axis=2))


def _wrapped(places: FloatArray, wraps: tuple[str, str], sizes: tuple[int, int]) -> FloatArray:
    """Places in the unit square, for an image that wraps differently along u and v."""
    wrapped = places.copy()
    for axis, (wrap, size) in enumerate(zip(wraps, sizes, strict=True)):
        if wrap == "mirror":
            wrapped[:, axis] = 1.0 - np.abs(1.0 - np.mod(wrapped[:, axis], 2.0))
        if wrap != "repeat":
            # Half a texel from the edges, where the outermost texels alone count.
            np.clip(wrapped[:, axis], 0.5 / size, 1.0 - 0.5 / size, out=wrapped[:, axis])
    return wrapped
