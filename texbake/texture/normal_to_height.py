"""Normals to heights: the surface whose slopes fit those of a normal map best.

Both methods are a least-squares fit that one division in the frequency domain solves. Frankot and
Chellappa fit the derivative, i w times a wave exp(i w x), to the slopes p. Poisson fits the steps
h(x + 1) - h(x), to (p(x) + p(x + 1)) / 2.

A map that does not tile is mirrored at its right and lower border first, which gives the Poisson
equation its natural boundary (Neumann) and makes the transform a cosine transform.

Based on: Frankot, Chellappa, "A method for enforcing integrability in shape from shading
algorithms", IEEE PAMI 10(4), 1988; Simchony, Chellappa, Shao, "Direct analytical methods for
solving Poisson equations in computer vision problems", IEEE PAMI 12(5), 1990. Departs from it in
that steps fit the mean of the slopes at both ends, so that a paraboloid comes back exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError, OptionError
from texbake.metadata import CONVENTION, SPACE
from texbake.texture.encoding import decode_normals
from texbake.texture.height_options import NormalToHeightOptions
from texbake.texture.image import Image

FloatArray = npt.NDArray[np.float64]

# A surface steeper than this, or overhanging, is taken for one that is so steep: 1 in 100 of z is
# a code and a half of 8 bits, below which a slope is rounding alone.
_LEAST_Z = 0.01


@dataclass(frozen=True, eq=False)
class HeightField:
    """Heights of a normal map, and how well they fit it.

    Attributes
    ----------
    heights : (H, W) float32
        In the unit of the options' width; their mean is 0, since normals do not tell it.
    n_steep : int
        Normals too steep for a height field, or not finite, which counts as flat.
    rms_slope_error : float
        Root of the mean squared difference between the slopes of the heights, as the method takes
        them, and those of the normals: 0 where the normals are those of a surface.
    """

    heights: npt.NDArray[np.float32]
    n_steep: int
    rms_slope_error: float


def normal_to_height(
    normals: Image | npt.NDArray[Any], options: NormalToHeightOptions | None = None
) -> HeightField:
    """Heights of a normal map in tangent space.

    Parameters
    ----------
    normals : Image or (H, W, 3) float
        An array holds vectors of any length, x to the right, y up; an image is decoded as its
        options or its metadata say.
    options
        None for `NormalToHeightOptions()`.

    Raises
    ------
    OptionError
        The shape is not that of normals.
    FileFormatError
        The image says that its normals are not in tangent space, which alone has heights over it.

    Examples
    --------
    >>> flat = np.tile([0.0, 0.0, 1.0], (4, 4, 1))
    >>> normal_to_height(flat).heights.tolist()[0]
    [0.0, 0.0, 0.0, 0.0]
    """
    options = options or NormalToHeightOptions()
    if isinstance(normals, Image):
        normals = _decoded(normals, options.convention)
    normals = np.asarray(normals)
    if normals.ndim != 3 or normals.shape[2] != 3 or normals.size == 0:
        raise OptionError(f"normals: the shape {normals.shape} is not (height, width, 3)")
    slopes, n_steep = _slopes(normals)
    height, width = slopes[0].shape
    if options.wrap == "clamp":
        slopes = _mirrored(*slopes)
    heights, error = _integrated(slopes, options.method)
    heights = heights[:height, :width]
    heights = (heights - heights.mean()) * (options.width / width)
    return HeightField(heights.astype(np.float32), n_steep, error)


def _decoded(image: Image, convention: str | None) -> npt.NDArray[np.float32]:
    space = image.metadata.get(SPACE, "tangent")
    if space != "tangent":
        raise FileFormatError(
            f"{image.name}: its normals are in {space} space; heights need a map in tangent space"
        )
    if image.pixels.shape[2] < 3:
        raise OptionError(f"{image.name}: the shape {image.pixels.shape} is not that of normals")
    convention = convention or str(image.metadata.get(CONVENTION, "opengl"))
    return decode_normals(image.pixels, convention=convention)


def _slopes(normals: npt.NDArray[Any]) -> tuple[tuple[FloatArray, FloatArray], int]:
    """Slopes to the right and down of square texels, and how many normals have none."""
    vectors = normals.astype(np.float64)
    flat = ~np.isfinite(vectors).all(axis=2)
    vectors[flat] = (0.0, 0.0, 1.0)
    with np.errstate(over="ignore"):
        lengths = np.sqrt(np.einsum("ijk,ijk->ij", vectors, vectors))
    vectors[lengths == 0.0] = (0.0, 0.0, 1.0)
    lengths[lengths == 0.0] = 1.0
    vectors /= lengths[..., None]
    steep = vectors[..., 2] < _LEAST_Z
    z = np.maximum(vectors[..., 2], _LEAST_Z)
    return (-vectors[..., 0] / z, vectors[..., 1] / z), int(np.count_nonzero(steep | flat))


def _mirrored(right: FloatArray, down: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Slopes of the surface with its mirror images beside, below and diagonally below it."""
    right = np.concatenate([right, -right[:, ::-1]], axis=1)
    down = np.concatenate([down, down[:, ::-1]], axis=1)
    return np.concatenate([right, right[::-1]]), np.concatenate([down, -down[::-1]])


def _integrated(slopes: tuple[FloatArray, FloatArray], method: str) -> tuple[FloatArray, float]:
    """Heights in texels that tile, and the root mean square of what they leave over."""
    shape = slopes[0].shape
    axes = (1, 0)
    numerator = np.zeros((shape[0], shape[1] // 2 + 1), np.complex128)
    denominator = np.zeros(numerator.shape)
    for axis, slope in zip(axes, slopes, strict=True):
        step, mean = _transfers(shape[axis], axis, method)
        numerator += np.conj(step) * mean * np.fft.rfft2(slope)
        denominator += np.abs(step) ** 2
    denominator[denominator == 0.0] = 1.0  # only of the mean: it becomes 0
    numerator /= denominator
    square = 0.0
    for axis, slope in zip(axes, slopes, strict=True):
        step, mean = _transfers(shape[axis], axis, method)
        left_over = np.fft.irfft2(step * numerator - mean * np.fft.rfft2(slope), s=shape)
        square += float(np.mean(left_over**2))
    return np.fft.irfft2(numerator, s=shape), float(np.sqrt(square))


def _transfers(
    n: int, axis: int, method: str
) -> tuple[npt.NDArray[np.complex128], npt.NDArray[np.complex128]]:
    """What steps of heights and means of slopes multiply waves by, along rows (1) or columns (0).

    Steps are derivatives and means are 1 with Frankot and Chellappa. Their fastest wave of an even
    number of samples, +1 and -1 in turn, has slope 0 at every sample.
    """
    frequencies = 2.0 * np.pi * (np.fft.rfftfreq(n) if axis == 1 else np.fft.fftfreq(n))
    if method == "poisson":
        turns = np.exp(1.0j * frequencies)
        step, mean = turns - 1.0, (turns + 1.0) / 2.0
    else:
        step, mean = 1.0j * frequencies, np.ones(len(frequencies), np.complex128)
    if n % 2 == 0:
        if method == "poisson":
            mean[n // 2] = 0.0
        else:
            step[n // 2] = 0.0
    return (step, mean) if axis == 1 else (step[:, None], mean[:, None])
