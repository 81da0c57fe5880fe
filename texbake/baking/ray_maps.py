"""Images over the light mesh that change its rays: which way they go, and how far out they start.

A skew mask blends the direction of each ray between that of the bake (0: smooth, so that there are
no gaps, but detail beside a hard edge is seen askew) and the normal of the face (1: straight, with
gaps at hard edges). An offset map scales how far out a ray starts: 1 leaves the front distance, or
that of the cage, as it is; 0 starts on the light surface.

Both are looked up bilinearly at the texture coordinates of a sample, and go on beyond their edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.texture.lookup import lookup

Float32Array = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class RayMaps:
    """What `RayField` reads for each sample.

    Attributes
    ----------
    skew, offset : (H, W, 1) float32, optional
        0 for the direction of the bake to 1 for that of the face; and a factor of the front
        distance, 0 or more.
    """

    skew: Float32Array | None = None
    offset: Float32Array | None = None

    @classmethod
    def of(
        cls, skew_mask: npt.ArrayLike | None = None, offset_map: npt.ArrayLike | None = None
    ) -> RayMaps | None:
        """Check two images, (H, W) or (H, W, C), of which the first channel counts.

        Returns None where there is neither.

        Raises
        ------
        OptionError
            One is no image, or has values that are out of range.
        """
        if skew_mask is None and offset_map is None:
            return None
        return cls(
            _first_channel("skew-mask", skew_mask, 1.0),
            _first_channel("offset-map", offset_map, np.inf),
        )

    def check(self, rays: str) -> None:
        """Raise `OptionError` where a mask would blend rays of faces with themselves."""
        if self.skew is not None and rays == "face":
            raise OptionError(
                "skew-mask, rays: rays of faces are straight already; give rays smooth or vertex"
            )

    def skew_at(self, uvs: FloatArray, threads: int | None) -> Float32Array:
        """(n,) float32: what to blend by at (n, 2) texture coordinates; 0 without a mask."""
        return _looked_up(self.skew, uvs, 0.0, threads)

    def offset_at(self, uvs: FloatArray, threads: int | None) -> Float32Array:
        """(n,) float32: what to scale by at (n, 2) texture coordinates; 1 without a map."""
        return _looked_up(self.offset, uvs, 1.0, threads)


def _first_channel(name: str, image: npt.ArrayLike | None, most: float) -> Float32Array | None:
    if image is None:
        return None
    pixels = np.asarray(image, dtype=np.float32)
    if pixels.ndim == 2:
        pixels = pixels[:, :, np.newaxis]
    if pixels.ndim != 3 or pixels.size == 0:
        raise OptionError(f"{name}: the shape {pixels.shape} is not (height, width)")
    pixels = np.ascontiguousarray(pixels[:, :, :1])
    if not np.isfinite(pixels).all() or pixels.min() < 0.0 or pixels.max() > most:
        allowed = "0 to 1" if most == 1.0 else "0 or more"
        raise OptionError(
            f"{name}: its values go from {pixels.min():g} to {pixels.max():g}; "
            f"they must be {allowed}"
        )
    return pixels


def _looked_up(
    image: Float32Array | None, uvs: FloatArray, without: float, threads: int | None
) -> Float32Array:
    if image is None:
        return np.full(len(uvs), without, dtype=np.float32)
    return lookup(image, uvs, wrap="clamp", threads=threads)[:, 0]


def sample_uvs(corner_uvs: FloatArray, faces: IntArray, barycentrics: FloatArray) -> FloatArray:
    """(n, 2) texture coordinates of samples, from (F, 3, 2) of the corners of all faces."""
    corners = corner_uvs[faces]
    b, c = barycentrics[:, :1], barycentrics[:, 1:]
    return np.asarray((1.0 - b - c) * corners[:, 0] + b * corners[:, 1] + c * corners[:, 2])


@kernel
def reshape_kernel(faces, barycentrics, surface, changes, straight, back, rays):  # type: ignore[no-untyped-def]
    """Turn rays towards those of the faces and move their starts, in place.

    Where a ray is neither turned nor moved, its numbers stay as they are, bit for bit, because its
    start is computed as it was before.
    """
    positions, corners = surface
    skew, offset = changes
    origins, directions, lengths, fronts = rays
    blend = np.empty(3)
    for i in range(len(faces)):
        weight = float(skew[i])
        if weight > 0.0:
            square = 0.0
            for axis in range(3):
                blend[axis] = (1.0 - weight) * directions[i, axis] + weight * straight[i, axis]
                square += blend[axis] * blend[axis]
            # What is blended to nothing, or wholly, goes as the face says.
            length = np.sqrt(square) if weight < 1.0 else 0.0
            for axis in range(3):
                directions[i, axis] = blend[axis] / length if length > 0.0 else straight[i, axis]
        fronts[i] *= float(offset[i])
        if lengths[i] > 0.0:
            lengths[i] = fronts[i] + back
        p, q, r = corners[faces[i]]
        b, c = barycentrics[i, 0], barycentrics[i, 1]
        a = 1.0 - b - c
        for axis in range(3):
            point = a * positions[p, axis] + b * positions[q, axis] + c * positions[r, axis]
            origins[i, axis] = point - fronts[i] * directions[i, axis]
