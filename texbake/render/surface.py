"""What triangles are made of: their normals, texture coordinates and maps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray, IntArray

FloatImage = npt.NDArray[np.float32]

# How far out of the unit square a coordinate may be by the rounding of float32 files.
_ROUNDING = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """What shading needs to know of the triangles; their order is that of the visibility buffer.

    Attributes
    ----------
    normals : (N, 3) float64
        Shading normals in world space.
    normal_faces : (F, 3) int32
        Index into `normals` of each corner.
    base_color : (r, g, b) linear
        Where there is no albedo.
    uvs : (T, 2) float64, optional
        Needed by the maps.
    uv_faces : (F, 3) int32, optional
        Index into `uvs` of each corner.
    normal_map : (H, W, 3) float32, optional
        Decoded normals; +Y up in tangent space.
    tangents : (F, 3, 4) float32, optional
        Corner tangents, w the bitangent sign; with them `normal_map` is in tangent space, without
        them in world space.
    albedo : (H, W, 3) float32, optional
        Linear.
    """

    normals: FloatArray
    normal_faces: IntArray
    base_color: tuple[float, float, float]
    uvs: FloatArray | None = None
    uv_faces: IntArray | None = None
    normal_map: FloatImage | None = None
    tangents: FloatImage | None = None
    albedo: FloatImage | None = None


def wrap_of(uvs: FloatArray | None) -> str:
    """How maps go on outside the unit square: "repeat" where coordinates leave it, else "clamp".

    Clamping keeps the opposite borders of a map from mixing within half a texel of them.
    """
    if uvs is None or len(uvs) == 0:
        return "clamp"
    inside = float(uvs.min()) >= -_ROUNDING and float(uvs.max()) <= 1.0 + _ROUNDING
    return "clamp" if inside else "repeat"


def read_only(array: npt.NDArray[Any], dtype: type) -> npt.NDArray[Any]:
    """Return an array as the kernels take all that they only read: contiguous, of one type.

    numba compiles a kernel again for arrays that may be written to.
    """
    view = np.require(array, dtype, "C").view()
    view.flags.writeable = False
    return view
