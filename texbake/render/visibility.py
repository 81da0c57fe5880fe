"""The visibility buffer: which triangle each sample sees, and where on it.

Based on: Olano and Greer, "Triangle scan conversion using 2D homogeneous coordinates", Graphics
Hardware 1997: the weights come from the corners in clip space, so that they are correct in
perspective and need no clipped triangle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands
from texbake.render.clip import to_clip

# Rows of samples a band.
_BAND = 16


@dataclass(frozen=True, eq=False)
class Visibility:
    """What each sample of a screen sees; row 0 at the top.

    Attributes
    ----------
    face_ids : (h, w) int32
        Index of the nearest triangle; -1 where there is none.
    barycentrics : (h, w, 2) float32
        Weights of its second and third corner, correct in perspective, neither below 0 nor above 1
        together; the first has the rest.
    depths : (h, w) float32
        Reversed depth z / w, greater is nearer; 0 where there is no triangle.
    back_facing : (h, w) bool
        The triangle is seen from behind.
    """

    face_ids: IntArray
    barycentrics: npt.NDArray[np.float32]
    depths: npt.NDArray[np.float32]
    back_facing: npt.NDArray[np.bool_]


@kernel
def _barycentrics_kernel(positions, faces, matrix, face_ids, weights, back_facing, start, stop):  # type: ignore[no-untyped-def]
    height, width = face_ids.shape
    a, b, c = np.empty(4), np.empty(4), np.empty(4)
    for row in range(start, stop):
        y = 1.0 - (2.0 * row + 1.0) / height
        for column in range(width):
            face = face_ids[row, column]
            if face < 0:
                continue
            x = (2.0 * column + 1.0) / width - 1.0
            to_clip(matrix, positions[faces[face, 0]], a)
            to_clip(matrix, positions[faces[face, 1]], b)
            to_clip(matrix, positions[faces[face, 2]], c)
            # Corners about the sample. Nothing is divided by w, so it may have any sign.
            ax, ay = a[0] - x * a[3], a[1] - y * a[3]
            bx, by = b[0] - x * b[3], b[1] - y * b[3]
            cx, cy = c[0] - x * c[3], c[1] - y * c[3]
            weight0 = bx * cy - cx * by
            weight1 = cx * ay - ax * cy
            weight2 = ax * by - bx * ay
            back = weight0 + weight1 + weight2 < 0.0
            back_facing[row, column] = back
            if back:
                weight0, weight1, weight2 = -weight0, -weight1, -weight2
            # Snapping moves edges by up to half a grid step: a sample may lie just outside.
            weight0, weight1, weight2 = max(weight0, 0.0), max(weight1, 0.0), max(weight2, 0.0)
            total = weight0 + weight1 + weight2
            if 0.0 < total < np.inf:
                weights[row, column, 0] = weight1 / total
                weights[row, column, 1] = weight2 / total


def barycentrics(
    positions: FloatArray,
    faces: IntArray,
    clip_from_world: FloatArray,
    face_ids: IntArray,
    *,
    threads: int | None = None,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.bool_]]:
    """Weights of the corners of the triangle at each sample, and whether it is seen from behind.

    Parameters
    ----------
    positions : (V, 3) float64
    faces : (F, 3) int32
    clip_from_world : (4, 4) float64
    face_ids : (h, w) int32
        -1 for none.
    threads
        None for every processor.

    Returns
    -------
    weights : (h, w, 2) float32
        As in `Visibility`; 0 where there is no triangle, or one without area in clip space.
    back_facing : (h, w) bool
    """
    weights = np.zeros((*face_ids.shape, 2), np.float32)
    back_facing = np.zeros(face_ids.shape, np.bool_)

    def work(start: int, stop: int) -> None:
        _barycentrics_kernel(
            positions, faces, clip_from_world, face_ids, weights, back_facing, start, stop
        )

    run_bands(work, len(face_ids), band=_BAND, threads=threads)
    return weights, back_facing
