"""Convert height maps to normal maps and back.

Heights to normals: the slopes of the height field give the vectors (-dh/dx, -dh/dy, 1), normalized.
An image that does not tile is extended by the parabola through its last three texels, so that
heights of constant curvature have exact normals up to the border.

Normals to heights: find the surface whose slopes fit those of the normal map best. Both methods are
a least-squares fit that one division in the frequency domain solves. Frankot and Chellappa fit the
derivative, i w times a wave exp(i w x), to the slopes p. Poisson fits the steps h(x + 1) - h(x) to
(p(x) + p(x + 1)) / 2. A map that does not tile is first mirrored at its right and lower border,
which gives the Poisson equation its natural (Neumann) boundary and makes the transform a cosine
transform.

Based on: Blinn, "Simulation of wrinkled surfaces", 1978; Scharr, "Optimale Operatoren in der
digitalen Bildverarbeitung", 2000, for the weights 3 10 3; Frankot, Chellappa, "A method for
enforcing integrability in shape from shading algorithms", IEEE PAMI 10(4), 1988; Simchony,
Chellappa, Shao, "Direct analytical methods for solving Poisson equations in computer vision
problems", IEEE PAMI 12(5), 1990. Departs from the last in that steps fit the mean of the slopes at
both ends, so that a paraboloid comes back exactly.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.errors import FileFormatError, OptionError, quoted
from texbake.mesh.mesh import AnyArray, Float32Array, FloatArray
from texbake.metadata import CONVENTION, DISPLACEMENT_SCALE, SPACE
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.texture.encoding import decode_normals
from texbake.texture.image import Image
from texbake.texture.options import DEFAULT_SCALE, HeightToNormalOptions, NormalToHeightOptions

_BAND = 1 << 18  # how many numbers a thread transforms at a time

# Weights, in sixteenths, of the three texels that a derivative averages across its direction.
_ACROSS = {"central": (0, 16, 0), "sobel": (4, 8, 4), "scharr": (3, 10, 3)}


def height_to_normal(
    heights: Image | AnyArray, options: HeightToNormalOptions | None = None
) -> Float32Array:
    """Compute the tangent-space normals of a height field.

    Parameters
    ----------
    heights : Image, or (H, W) or (H, W, 1) float
        Row 0 at the top. An `Image` gives its first channel, with the scale in its metadata.
    options
        None for `HeightToNormalOptions()`.

    Returns
    -------
    (H, W, 3) float32
        Unit vectors, x to the right, y up; (0, 0, 1) next to heights that are not finite.

    Raises
    ------
    OptionError
        The shape of the array is not one of these.
    FileFormatError
        The scale in the image's metadata is not a number.

    Examples
    --------
    >>> ramp = np.tile(np.arange(4.0), (4, 1))
    >>> options = HeightToNormalOptions(scale=1.0, width=4.0, wrap="clamp")
    >>> bool(np.allclose(height_to_normal(ramp, options)[0, 0], (-(0.5**0.5), 0.0, 0.5**0.5)))
    True
    """
    options = options or HeightToNormalOptions()
    scale = height_scale(heights, options)
    field = _height_field(heights.pixels[..., :1] if isinstance(heights, Image) else heights)
    # Heights in units of a texel, so that slopes are differences.
    field = field * (scale * field.shape[1] / options.width)
    with np.errstate(invalid="ignore", over="ignore"):
        extended = _extended(_extended(field, options.wrap).T, options.wrap).T
        along_x = _difference(extended, options.derivative)
        up_y = -_difference(extended.T, options.derivative).T
        normals = np.stack([-along_x, -up_y, np.ones_like(field)], axis=-1)
        normals /= np.sqrt(pm.vecdot(normals, normals))[..., None]
    # Not finite, or too steep to square.
    normals[~np.isfinite(normals).all(axis=-1)] = (0.0, 0.0, 1.0)
    return normals.astype(np.float32)


def height_scale(heights: Image | AnyArray, options: HeightToNormalOptions) -> float:
    """Return the height of a change of 1, from the options, the image's metadata or the default."""
    if options.scale is not None:
        return options.scale
    if not isinstance(heights, Image):
        return DEFAULT_SCALE
    scale = heights.metadata.get(DISPLACEMENT_SCALE, DEFAULT_SCALE)
    if not isinstance(scale, int | float) or not math.isfinite(scale):
        raise FileFormatError(
            f"{heights.name}: its {DISPLACEMENT_SCALE} {quoted(scale)} is not a finite number; "
            "give `scale`"
        )
    return float(scale)


def _height_field(values: AnyArray) -> FloatArray:
    """Return an array (H, W) or (H, W, 1) as float64 (H, W)."""
    field = np.asarray(values, np.float64)
    field = field[..., 0] if field.ndim == 3 and field.shape[2] == 1 else field
    if field.ndim != 2 or field.size == 0:
        raise OptionError(f"heights: the shape {np.shape(values)} is not (height, width)")
    return field


def _extended(field: FloatArray, wrap: str) -> FloatArray:
    """Add a row above and one below."""
    if wrap == "repeat":
        return np.concatenate([field[-1:], field, field[:1]])
    return np.concatenate([_row_before(field), field, _row_before(field[::-1])])


def _row_before(field: FloatArray) -> FloatArray:
    """Extrapolate the row before the first (1, W), by the parabola or line through the next."""
    if len(field) >= 3:
        return 3.0 * field[:1] - 3.0 * field[1:2] + field[2:3]
    return 2.0 * field[:1] - field[1:2] if len(field) == 2 else field


def _difference(extended: FloatArray, derivative: str) -> FloatArray:
    """Return the slope along rows, for texels of width 1; one texel less on each side."""
    across = extended[1:-1]
    before, here, after = (weight / 16.0 for weight in _ACROSS[derivative])
    if before:  # skip zero weights, because 0 times infinity is NaN
        across = before * extended[:-2] + here * across + after * extended[2:]
    return (across[:, 2:] - across[:, :-2]) / 2.0


# Steeper or overhanging surfaces count as this steep: a z of 1 in 100 is 1.5 codes of 8 bits, below
# which a slope is nothing but rounding.
_LEAST_Z = 0.01


@dataclass(frozen=True, eq=False)
class HeightField:
    """Heights of a normal map, and how well they fit it."""

    # (H, W) float32: in the unit of the options' width. Their mean is 0, because normals do not
    # determine it.
    heights: Float32Array
    # number of normals too steep for a height field, or not finite, which count as flat
    n_steep: int
    # root mean square difference between the slopes of the heights, as the method computes them,
    # and those of the normals; 0 if the normals are those of a surface
    rms_slope_error: float


def normal_to_height(
    normals: Image | AnyArray, options: NormalToHeightOptions | None = None
) -> HeightField:
    """Compute the heights of a tangent-space normal map.

    Parameters
    ----------
    normals : Image or (H, W, 3) float
        An array holds vectors of any length, x to the right, y up. An `Image` is decoded with the
        convention in the options or in its metadata.
    options
        None for `NormalToHeightOptions()`.

    Raises
    ------
    OptionError
        The shape of the array is not (H, W, 3).
    FileFormatError
        According to the image's metadata, its normals are not in tangent space.

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


def _decoded(image: Image, convention: str | None) -> Float32Array:
    space = image.metadata.get(SPACE, "tangent")
    if space != "tangent":
        raise FileFormatError(
            f"{image.name}: its normals are in {space} space; heights need a map in tangent space"
        )
    if image.pixels.shape[2] < 3:
        raise OptionError(f"{image.name}: the shape {image.pixels.shape} is not that of normals")
    convention = convention or str(image.metadata.get(CONVENTION, "opengl"))
    return decode_normals(image.pixels, convention=convention)


def _slopes(normals: AnyArray) -> tuple[tuple[FloatArray, FloatArray], int]:
    """Return the slopes to the right and down, and the number of normals without one."""
    vectors = normals.astype(np.float64)
    flat = ~np.isfinite(vectors).all(axis=2)
    vectors[flat] = (0.0, 0.0, 1.0)
    with np.errstate(over="ignore"):
        lengths = np.sqrt(pm.vecdot(vectors, vectors))
    vectors[lengths == 0.0] = (0.0, 0.0, 1.0)
    lengths[lengths == 0.0] = 1.0
    vectors /= lengths[..., None]
    steep = vectors[..., 2] < _LEAST_Z
    z = np.maximum(vectors[..., 2], _LEAST_Z)
    return (-vectors[..., 0] / z, vectors[..., 1] / z), int(np.count_nonzero(steep | flat))


def _mirrored(right: FloatArray, down: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the slopes of the surface with its mirror images on the right and below."""
    right = np.concatenate([right, -right[:, ::-1]], axis=1)
    down = np.concatenate([down, down[:, ::-1]], axis=1)
    return np.concatenate([right, right[::-1]]), np.concatenate([down, -down[::-1]])


def _integrated(slopes: tuple[FloatArray, FloatArray], method: str) -> tuple[FloatArray, float]:
    """Return heights that tile, in units of a texel, and the root mean square of the residual.

    Both slopes are transformed together as one complex image, and so are both residuals. The arrays
    hold real and imaginary parts.
    """
    height, width = slopes[0].shape
    columns = _transfers(width, method)
    rows = _transfers(height, method)
    spectrum = _fourier(*slopes)
    heights = np.empty((2, height, width))
    residuals = np.empty((2, height, width))
    for row in range(height):
        z, mirrored = spectrum[:, row], np.roll(spectrum[:, -row, ::-1], 1, axis=1)
        right = 0.5 * (z[0] + mirrored[0]), 0.5 * (z[1] - mirrored[1])
        down = 0.5 * (z[1] + mirrored[1]), 0.5 * (mirrored[0] - z[0])
        (step_x, mean_x), (step_y, mean_y) = columns, rows[:, :, row]
        p, q = _product(mean_x, right), _product(mean_y, down)
        a, b = _product(_conjugate(step_x), p), _product(_conjugate(step_y), q)
        squares = np.square(step_x).sum(axis=0) + np.square(step_y).sum()
        squares[squares == 0.0] = 1.0  # true only of the mean, which becomes 0
        heights[:, row] = found = (a[0] + b[0]) / squares, (a[1] + b[1]) / squares
        off_x, off_y = (
            _product(step, found) - np.array(wanted) for step, wanted in ((step_x, p), (step_y, q))
        )
        residuals[:, row] = off_x[0] - off_y[1], off_x[1] + off_y[0]
    square = float(np.square(_fourier(*residuals, inverse=True)).mean())
    return _fourier(*heights, inverse=True)[0], math.sqrt(2.0 * square)


def _fourier(real: FloatArray, imaginary: FloatArray, *, inverse: bool = False) -> FloatArray:
    """(2, H, W): the discrete Fourier transform of a complex image; kernel `core/fourier.c`."""
    parts = np.stack([real, imaginary])
    for _ in "rows", "columns":
        n, length = parts.shape[1:]

        def work(start: int, stop: int, parts: FloatArray = parts) -> None:
            core.fourier_transform_rows(parts[0], parts[1], inverse, start, stop)

        run_bands(work, n, band=max(1, _BAND // length))
        parts = np.ascontiguousarray(parts.transpose(0, 2, 1))
    return parts / real.size if inverse else parts


def _product(a: FloatArray, b: FloatArray | tuple[FloatArray, FloatArray]) -> FloatArray:
    """Products of complex numbers, as real and imaginary parts."""
    return np.array([a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]])


def _conjugate(a: FloatArray) -> FloatArray:
    return np.array([a[0], -a[1]])


def _transfers(n: int, method: str) -> FloatArray:
    """(2, 2, n): factors of waves for differences of heights and means of slopes, along one axis.

    For Frankot and Chellappa, steps are derivatives and means are 1. With an even number of
    samples, their fastest wave alternates between +1 and -1 and has slope 0 at every sample.
    """
    numbers = np.arange(n)
    waves = 2.0 * np.pi * np.where(2 * numbers < n, numbers, numbers - n) / n
    if method == "poisson":
        cos, sin = pm.cos(waves), pm.sin(waves)
        step, mean = np.array([cos - 1.0, sin]), np.array([(cos + 1.0) / 2.0, sin / 2.0])
    else:
        step = np.array([np.zeros(n), waves])
        mean = np.array([np.ones(n), np.zeros(n)])
    if n % 2 == 0:
        (mean if method == "poisson" else step)[:, n // 2] = 0.0
    return np.array([step, mean])
