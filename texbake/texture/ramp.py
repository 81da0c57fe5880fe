"""One-dimensional textures: colors along a line.

The stops of a ramp are evenly spaced, the first at 0 and the last at 1, and values between them are
interpolated. That differs from an image of one row, whose texels have their centers half a texel
away from the edges.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.kernels import kernel
from texbake.parallel import run_bands
from texbake.texture.lookup import BORDER, OUTSIDE, border_values, folded, wrap_code

# Values a band: some milliseconds of work.
_BAND = 1 << 18


@kernel
def _ramp_kernel(stops, values, wrap, border, out, start, stop):  # type: ignore[no-untyped-def]
    last, n_channels = len(stops) - 1, stops.shape[1]
    for i in range(start, stop):
        place = folded(np.float64(values[i]), wrap)
        first = OUTSIDE
        if wrap != BORDER or (place >= 0.0 and place <= 1.0):
            place *= last
            first = max(min(int(place), last - 1), 0)
        second = min(first + 1, last)
        along = np.float32(place - first)
        for channel in range(n_channels):
            if first == OUTSIDE:
                out[i, channel] = border[channel]
            else:
                value = stops[first, channel]
                out[i, channel] = value + along * (stops[second, channel] - value)


def ramp_lookup(
    stops: npt.NDArray[Any],
    values: npt.NDArray[Any],
    *,
    wrap: str = "clamp",
    border: npt.ArrayLike | None = None,
    threads: int | None = None,
) -> npt.NDArray[np.float32]:
    """Colors of a ramp, interpolated between its stops.

    Parameters
    ----------
    stops : (k, C) float32
        Linear colors at 0, 1 / (k - 1), ..., 1; a single one is the color of every value.
    values : (n,) float32
        Places on the ramp; one that is not a number counts as 0, and so does an infinite one that
        repeats or is mirrored.
    wrap
        What lies outside [0, 1]: "clamp", "repeat", which jumps from the last stop to the first,
        "mirror" or "border".
    border : float or (C,), optional
        Values of the border; 0 if not given.
    threads
        None for every processor.

    Returns
    -------
    (n, C) float32

    Raises
    ------
    OptionError
        There is no stop, an array has another shape, or `wrap` is something else.

    Examples
    --------
    >>> stops = np.array([[0.0], [1.0], [5.0]])
    >>> ramp_lookup(stops, np.array([0.25, 0.75, 2.0])).ravel().tolist()
    [0.5, 3.0, 5.0]
    """
    code = wrap_code(wrap)
    stops = np.require(stops, np.float32, "C")
    if stops.ndim != 2 or stops.size == 0:
        raise OptionError(f"stops: the shape {stops.shape} is not (stops, channels)")
    values = np.require(values, np.float32, "C")
    if values.ndim != 1:
        raise OptionError(f"values: the shape {values.shape} is not (n,)")
    stops, values = stops.view(), values.view()
    stops.flags.writeable = values.flags.writeable = False  # one signature for the kernel
    outside = border_values(border, stops.shape[1])
    out = np.empty((len(values), stops.shape[1]), np.float32)

    def work(start: int, stop: int) -> None:
        _ramp_kernel(stops, values, code, outside, out, start, stop)

    run_bands(work, len(values), band=_BAND, threads=threads)
    return out
