"""Padding: extend maps beyond the borders of charts, so that filtering never reads the background.

Padding is a dilation: a texel outside all charts takes the value of the nearest texel that a chart
owns, up to a given number of texels away. All maps of a bake share one search for the nearest
owners. Push-pull can fill the rest of the image smoothly, so that no mip level shows the
background. Kernel, which names the sources: `core/padding.c`.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.errors import OptionError, quoted
from texbake.mesh.interchange import plain_array
from texbake.mesh.mesh import AnyArray, BoolArray, Float32Array, IntArray
from texbake.parallel import run_bands
from texbake.records import dataclass

# "No owner within reach" as an offset in texels, as in `core/padding.c`.
NO_OWNER = 16384

# Columns per band of the first pass, and rows per band of the second.
_COLUMN_BAND = 256
_ROW_BAND = 128


@dataclass(frozen=True)
class NearestOwners:
    """The texels from which padding takes its values."""

    # (H, W) int32; flat index (row * W + column) of the nearest owner within the padding, -1 if
    # there is none. A texel that a chart owns has its own index.
    indices: IntArray
    # Number of texels outside all charts that lie within the padding of two charts or more.
    n_meeting: int


def nearest_owner(
    chart_ids: IntArray, padding: int, *, threads: int | None = None
) -> NearestOwners:
    """Nearest owner of each texel (H, W), up to `padding` away; the time grows with `padding`."""
    if not 0 <= padding < NO_OWNER:
        raise OptionError(f"padding: {padding} is not between 0 and {NO_OWNER - 1} texels")
    charts = np.require(chart_ids, np.int32, ["C", "A"])
    height, width = charts.shape
    if charts.size >= 1 << 31:
        raise OptionError(f"size: {width} x {height} is more texels than 32 bits can number")
    # The greatest possible distance.
    reach = min(padding, height + width)
    nearest = np.empty((height, width), np.int16)
    other = np.empty((height, width), np.int16)
    indices = np.empty((height, width), np.int32)
    meeting = np.empty(height, np.int64)
    search_columns = partial(core.search_columns, charts, reach, nearest, other, indices)
    search_rows = partial(core.search_rows, charts, reach, nearest, other, indices, meeting)
    run_bands(search_columns, width, band=_COLUMN_BAND, threads=threads)
    run_bands(search_rows, height, band=_ROW_BAND, threads=threads)
    return NearestOwners(indices, int(meeting.sum()))


# Rows per band: a few milliseconds of work.
_FILL_BAND = 128
_WHOLE = 2**53  # float64 holds all integers up to this one
_PARTS = 3  # float32 numbers whose sum is a float64 number


def push_pull(values: AnyArray, mask: BoolArray, *, threads: int | None = None) -> Float32Array:
    """Fill texels (H, W, C) outside `mask` smoothly; inside, they stay bit-equal."""
    level = np.array(values, np.float32)
    valid = np.require(mask, np.bool_, ["C", "A"])
    levels = [(level, valid)]
    while max(level.shape[:2]) > 1:
        level, valid = _pushed(level, valid, threads)
        levels.append((level, valid))
    if not valid.any():
        return levels[0][0]
    for (level, valid), (coarse, _) in zip(levels[-2::-1], levels[:0:-1], strict=True):
        _pull(level, valid, coarse, threads)
    return levels[0][0]


def fill(
    texels: npt.ArrayLike,
    mask: npt.ArrayLike,
    *,
    padding: int | None = None,
    threads: int | None = None,
) -> AnyArray:
    """Fill the texels of an image that have no data from the texels that have data.

    Parameters
    ----------
    texels : (H, W) or (H, W, C) numbers
        The values to fill; those outside the mask are not read.
    mask : (H, W)
        Nonzero for texels with data, which keep their values.
    padding
        None fills every texel, smoothly (push-pull). With a number, each texel within this distance
        of data gets the value of the nearest texel with data (dilation); others keep theirs.

    Returns
    -------
    array
        Filled values, of the shape and type of `texels`; integers are rounded. If the mask is
        empty, `texels` as they are.

    Raises
    ------
    OptionError
        The shapes do not fit, the padding is out of range, or integers beyond 2**53 would have to
        be averaged.

    Examples
    --------
    >>> fill([[1.0, 0.0, 0.0, 3.0]], [[1, 0, 0, 1]], padding=1).tolist()
    [[1.0, 1.0, 3.0, 3.0]]
    """
    values = np.ascontiguousarray(plain_array(texels, "texels"))
    known = np.ascontiguousarray(plain_array(mask, "mask")) != 0
    if values.ndim not in (2, 3) or values.size == 0:
        raise OptionError(
            f"texels: their shape is {values.shape}; give numbers (H, W) or (H, W, C)"
        )
    if known.shape != values.shape[:2]:
        raise OptionError(
            f"mask: its shape is {known.shape}, that of the texels {values.shape[:2]}"
        )
    if padding is not None:
        if not hasattr(padding, "__index__"):
            raise OptionError(f"padding: {quoted(padding)} is not a whole number of texels")
        charts = np.where(known, np.int32(0), np.int32(-1))
        sources = nearest_owner(charts, padding, threads=threads).indices
        flat = values.reshape(known.size, -1)
        own = np.arange(known.size).reshape(known.shape)
        return flat[np.where(sources < 0, own, sources)].reshape(values.shape)
    if not known.any():
        return values.copy()
    images = np.where(
        known[..., np.newaxis], values.reshape(*known.shape, -1), values.dtype.type(0)
    )
    filled = _smooth(images, known, threads)
    if values.dtype.kind != "f":
        filled = np.clip(np.rint(filled), images[known].min(), images[known].max())
    return np.where(known[..., np.newaxis], images, filled.astype(values.dtype)).reshape(
        values.shape
    )


def _smooth(values: AnyArray, mask: BoolArray, threads: int | None) -> AnyArray:
    """Return what `push_pull` does; numbers that float32 cannot hold are filled in parts."""
    if np.can_cast(values.dtype, np.float32):
        return push_pull(values, mask, threads=threads)
    if values.dtype.kind != "f" and not (
        int(values.min()) >= -_WHOLE and int(values.max()) <= _WHOLE
    ):
        raise OptionError("texels: there are integers beyond 2**53; use padding, or floats")
    wide = values.astype(np.float64)
    largest = np.abs(wide).max(initial=0.0, where=np.isfinite(wide))
    exponent = int(np.frexp(largest)[1])
    rest, filled = np.ldexp(wide, -exponent), np.zeros(wide.shape)
    for _ in range(_PARTS):
        part = rest.astype(np.float32)
        filled += push_pull(part, mask, threads=threads)
        with np.errstate(invalid="ignore"):  # infinity becomes NaN, so all parts leave it out
            rest -= part
    return np.ldexp(filled, exponent)


def _pushed(
    values: Float32Array, mask: BoolArray, threads: int | None
) -> tuple[Float32Array, BoolArray]:
    """Return the next coarser level, of half the size rounded up, and the mask of valid texels."""
    height, width = (values.shape[0] + 1) // 2, (values.shape[1] + 1) // 2
    coarse = np.empty((height, width, values.shape[2]), np.float32)
    coarse_mask = np.empty((height, width), np.bool_)
    work = partial(core.push_texels, values, mask, coarse, coarse_mask)
    run_bands(work, height, band=_FILL_BAND, threads=threads)
    return coarse, coarse_mask


def _pull(values: Float32Array, mask: BoolArray, coarse: Float32Array, threads: int | None) -> None:
    """Fill `values` in place, outside `mask`, from the next coarser level."""
    work = partial(core.pull_texels, values, mask, coarse)
    run_bands(work, len(values), band=_FILL_BAND, threads=threads)
