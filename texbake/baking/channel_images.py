"""The images of a high-poly mesh's materials, decoded once, and their values at hits."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from texbake.baking.hits import Hits
from texbake.core import core
from texbake.mesh.materials import ChannelImage, Placing
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands
from texbake.texture.lookup import lookup

Float32Array = npt.NDArray[np.float32]

_BAND = 1 << 15


@dataclass(eq=False)
class MaterialPoints:
    """Points of faces that have one material, and where they lie in its images."""

    rows: npt.NDArray[np.intp] | slice  # which of all points they are
    faces: IntArray  # (n,) int32
    barycentrics: Float32Array  # (n, 2) float32; weights of the second and third corner
    # By the set of texture coordinates and the placing: several channels share one.
    _places: dict[tuple[int, Placing], FloatArray] = field(default_factory=dict)

    def places(
        self, image: ChannelImage, uvs: FloatArray, uv_faces: IntArray, threads: int | None
    ) -> FloatArray:
        """(n, 2) float64: texture coordinates in an image."""
        key = image.uv_set, image.placing
        if key not in self._places:
            self._places[key] = places = np.empty((len(self.faces), 2))
            placing = np.array(image.placing)

            def work(start: int, stop: int) -> None:
                band = slice(start, stop)
                faces, barycentrics = self.faces[band], self.barycentrics[band]
                core.place_in_image(faces, barycentrics, uvs, uv_faces, placing, places[band])

            run_bands(work, len(self.faces), band=_BAND, threads=threads)
        return self._places[key]


def points_by_material(hits: Hits, face_materials: IntArray, n: int) -> list[MaterialPoints]:
    """Divide the points hit by the materials of their faces, numbered from 0 to n."""
    if n == 1:
        return [MaterialPoints(slice(None), hits.high_faces, hits.high_barycentrics)]
    ids = face_materials[hits.high_faces]
    found = []
    for i in range(n):
        rows = np.flatnonzero(ids == i)
        found.append(MaterialPoints(rows, hits.high_faces[rows], hits.high_barycentrics[rows]))
    return found


@dataclass(eq=False)
class ChannelImages:
    """Looks up values that channels take from images; decodes each image when first needed."""

    uvs: dict[int, FloatArray]  # each (T, 2) float64; sets of texture coordinates by their numbers
    uv_faces: IntArray  # (F, 3) int32; indices into those of each set
    threads: int | None = None
    _decoded: dict[tuple[str, bool, tuple[int, ...]], Float32Array] = field(default_factory=dict)

    def values(
        self, image: ChannelImage, points: MaterialPoints, *, is_color: bool
    ) -> Float32Array:
        """(n, components) float32: linear values at points, looked up bilinearly.

        `is_color`: whether an 8-bit image is coded in sRGB.
        """
        pixels = self._pixels(image, is_color)
        places = points.places(image, self.uvs[image.uv_set], self.uv_faces, self.threads)
        if image.is_nearest:
            sizes = np.array([pixels.shape[1], pixels.shape[0]])
            with np.errstate(over="ignore"):  # infinity is outside every image
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
