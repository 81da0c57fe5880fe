"""Look up one-, two- and three-dimensional textures with linear interpolation.

A volume is a stack of images: slice k holds the values at (s, t, r) for r from k / depth to
(k + 1) / depth. Its rows run from top to bottom, as in any image, while t points up. Kernel, which
names the sources: `core/texture_lookup.c`.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.errors import OptionError, quoted, require_known
from texbake.mesh.mesh import AnyArray, Float32Array, FloatArray
from texbake.parallel import run_bands

# As in `core/texture_lookup.h`.
REPEAT, CLAMP, MIRROR, BORDER = range(4)
_CODES = {"repeat": REPEAT, "mirror": MIRROR, "clamp": CLAMP, "border": BORDER}
WRAPS = tuple(_CODES)

# Lookups per band: a few milliseconds of work.
_IMAGE_BAND = 1 << 18


def wrap_code(wrap: str) -> int:
    """Return the number of a wrap mode in kernels."""
    require_known("wrap", wrap, _CODES)
    return _CODES[wrap]


# One mode for both directions of an image, or those along u and along v.
Wrap = str | tuple[str, str]


def wrap_codes(wrap: Wrap) -> int:
    """Return the number of the wrap modes of an image in kernels; raises as `wrap_code` does."""
    along_u, along_v = wrap_pair(wrap)
    return wrap_code(along_u) | wrap_code(along_v) << 2


def wrap_pair(wrap: Wrap) -> tuple[str, str]:
    """Return the wrap modes along u and along v.

    >>> wrap_pair("repeat"), wrap_pair(("mirror", "clamp"))
    (('repeat', 'repeat'), ('mirror', 'clamp'))
    """
    along_u, along_v = (wrap, wrap) if isinstance(wrap, str) else wrap
    return along_u, along_v


def border_values(border: npt.ArrayLike | None, n_channels: int) -> Float32Array:
    """(C,) float32 values outside an image with a border, one per channel."""
    out = np.empty(n_channels, np.float32)
    try:
        out[:] = 0.0 if border is None else border
    except ValueError as error:
        raise OptionError(
            f"border: {quoted(border)} is not one number or {n_channels}, one for each channel"
        ) from error
    return out


def row_of_v(v: FloatArray, height: float) -> FloatArray:
    """Row from the top edge of a v from the bottom edge; its own inverse for `height` 1."""
    return (1.0 - v) * height


def texel_coordinates(uvs: FloatArray, width: int, height: int) -> FloatArray:
    """Continuous x and y (..., 2), down from the top edge, of uvs; texel centers are at halves."""
    uvs = np.asarray(uvs, dtype=np.float64)
    with np.errstate(over="ignore"):  # infinity lies outside every image
        return np.stack([uvs[..., 0] * width, row_of_v(uvs[..., 1], height)], axis=-1)


def require_image(image: AnyArray) -> Float32Array:
    """(H, W, C) float32, contiguous; `OptionError` for another shape."""
    image = np.require(image, np.float32, ["C", "A"])
    if image.ndim != 3 or image.size == 0:
        raise OptionError(f"image: the shape {image.shape} is not (height, width, channels)")
    return image


def lookup(
    image: AnyArray,
    uvs: AnyArray,
    *,
    wrap: Wrap = "repeat",
    border: npt.ArrayLike | None = None,
    threads: int | None = None,
) -> Float32Array:
    """Sample (H, W, C), linear, row 0 at the top, bilinearly at uvs (..., 2)."""
    code = wrap_codes(wrap)
    image = require_image(image)
    uvs = np.asarray(uvs, dtype=np.float64)
    flat = np.require(uvs.reshape(-1, 2), requirements=["C", "A"])
    outside = border_values(border, image.shape[2])
    out = np.empty((len(flat), image.shape[2]), np.float32)
    work = partial(core.sample_bilinear, image, flat, code, outside, out)
    run_bands(work, len(flat), band=_IMAGE_BAND, threads=threads)
    return out.reshape(*uvs.shape[:-1], image.shape[2])


# Values per band: a few milliseconds of work.
_RAMP_BAND = 1 << 18


def ramp_lookup(stops: AnyArray, values: AnyArray, *, threads: int | None = None) -> Float32Array:
    """(n, C) colors at values (n,) of a ramp of linear stops (k, C) at 0, 1 / (k - 1), ..., 1."""
    stops = np.require(stops, np.float32, ["C", "A"])
    if stops.ndim != 2 or stops.size == 0:
        raise OptionError(f"stops: the shape {stops.shape} is not (stops, channels)")
    values = np.require(values, np.float32, ["C", "A"])
    if values.ndim != 1:
        raise OptionError(f"values: the shape {values.shape} is not (n,)")
    out = np.empty((len(values), stops.shape[1]), np.float32)
    work = partial(core.sample_ramp, stops, values, out)
    run_bands(work, len(values), band=_RAMP_BAND, threads=threads)
    return out


VOLUME_FILTERS = ("nearest", "trilinear")

# Lookups per band: a few milliseconds of work.
_VOLUME_BAND = 1 << 17


def volume_lookup(
    volume: AnyArray,
    points: AnyArray,
    *,
    wrap: str = "repeat",
    filter: str = "trilinear",  # noqa: A002  # what the field calls it
    border: npt.ArrayLike | None = None,
    threads: int | None = None,
) -> Float32Array:
    """Sample (D, H, W, C) at points (n, 3); a constant stays exact where no border is read."""
    code = wrap_code(wrap)
    require_known("filter", filter, VOLUME_FILTERS)
    volume = np.require(volume, np.float32, ["C", "A"])
    if volume.ndim != 4 or volume.size == 0:
        raise OptionError(
            f"volume: the shape {volume.shape} is not (depth, height, width, channels)"
        )
    points = np.require(points, np.float64, ["C", "A"])
    if points.ndim != 2 or points.shape[1] != 3:
        raise OptionError(f"points: the shape {points.shape} is not (n, 3)")
    outside = border_values(border, volume.shape[3])
    out = np.empty((len(points), volume.shape[3]), np.float32)
    nearest = filter == "nearest"
    work = partial(core.sample_volume, volume, points, nearest, code, outside, out)
    run_bands(work, len(points), band=_VOLUME_BAND, threads=threads)
    return out
