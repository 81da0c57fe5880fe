"""Values carried past the border of charts, so that filtering never reads background.

First by dilation: a texel that no chart owns takes the value of the owner nearest to it, up to so
many texels away. One search for the nearest owners serves all maps of a bake. Then, where wanted,
by push-pull, which fills all the rest smoothly, so that no mip level shows background.

Distances are Euclidean, between texel centers. Of owners equally near, the one that the fewest
columns lie between wins, then the left, then the upper.

Based on: Felzenszwalb and Huttenlocher, "Distance Transforms of Sampled Functions", 2012, and
Meijster, Roerdink and Hesselink, "A General Algorithm for Computing Distance Transforms in Linear
Time", 2000, for the columns first and rows second; Gortler et al., "The Lumigraph", 1996, for
push-pull. Departs from the first two in that rows are searched in a window as wide as the padding,
which vectorizes and so is faster for the paddings in use; and in that columns keep a second owner,
the nearest of any other chart, which is enough to find every texel within reach of two charts. Of
the last, weights are 0 or 1 in every level.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from texbake.errors import OptionError
from texbake.parallel import run_bands

# Columns of a band of the first pass, and rows of one of the second and of the other kernels.
_COLUMN_BAND = 256
_ROW_BAND = 32
# Texels of a row that the second pass searches together; those that are all owned it skips.
_SEGMENT = 128
# "No owner within reach", as an offset in texels; so the greatest padding is one less.
_NONE = 16384
# Its square and more: no sum of two squared distances within reach comes near it.
_FAR = 1 << 30

FloatImage = npt.NDArray[np.float32]


@dataclass(frozen=True)
class NearestOwners:
    """Where padding takes its values from.

    Attributes
    ----------
    indices : (H, W) int32
        Flat index (row * W + column) of the nearest owner within the padding; a texel that a chart
        owns has its own index, and one that is out of reach -1.
    n_meeting : int
        Texels that no chart owns, within the padding of two charts or more.
    """

    indices: npt.NDArray[np.int32]
    n_meeting: int


@njit(nogil=True, cache=True)
def _column_kernel(charts, reach, nearest, other, owners, start, stop):  # type: ignore[no-untyped-def]
    """Vertical offsets, down, to the nearest owner and to the nearest of another chart.

    For columns start on; `_NONE` where there is none within reach. `owners` gets the chart of the
    nearest owner. One sweep down finds the owners above, one up those below.
    """
    height = charts.shape[0]
    width = stop - start
    far = np.int32(2 * _NONE)
    # Rows of the last owner met and of the last one of another chart than that, and its chart.
    last = np.full(width, -far, np.int32)
    before = np.full(width, -far, np.int32)
    chart = np.full(width, -1, np.int32)
    for row in range(height):
        _meet(charts[row, start:stop], np.int32(row), last, before, chart)
        for x in range(width):
            offset = np.int32(last[x] - row)
            offset_2 = np.int32(before[x] - row)
            nearest[row, start + x] = offset if offset >= -reach else _NONE
            other[row, start + x] = offset_2 if offset_2 >= -reach else _NONE
            owners[row, start + x] = chart[x] if offset >= -reach else -1
    last[:] = height + far
    before[:] = height + far
    chart[:] = -1
    for row in range(height - 1, -1, -1):
        _meet(charts[row, start:stop], np.int32(row), last, before, chart)
        for x in range(width):
            column = start + x
            down = np.int32(last[x] - row)
            down_2 = np.int32(before[x] - row)
            if down > reach:
                continue
            up = np.int32(-nearest[row, column])  # -_NONE where there is none
            up_2 = np.int32(abs(other[row, column]))
            same = owners[row, column] == chart[x]
            if up >= 0 and up <= down:
                rival = down_2 if same else down
                if rival < up_2 and rival <= reach:
                    other[row, column] = rival
            else:
                rival = up_2 if same or up < 0 else up
                nearest[row, column] = down
                owners[row, column] = chart[x]
                if down_2 < rival:
                    other[row, column] = down_2 if down_2 <= reach else _NONE
                elif not same and up >= 0:
                    other[row, column] = -up


@njit(nogil=True, cache=True)
def _meet(row_charts, row, last, before, chart):  # type: ignore[no-untyped-def]
    """Take one more row of charts into the state of a sweep over columns."""
    for x in range(len(row_charts)):
        met = row_charts[x]
        owned = met >= 0
        before[x] = last[x] if owned and met != chart[x] else before[x]
        last[x] = row if owned else last[x]
        chart[x] = met if owned else chart[x]


@njit(nogil=True, cache=True)
def _row_kernel(charts, reach, nearest, other, indices, meeting, start, stop):  # type: ignore[no-untyped-def]
    """Nearest owners of rows start on, and how many texels of each row two charts reach.

    `indices` comes with the charts of the columns' nearest owners.
    """
    width = charts.shape[1]
    # A row with `reach` empty texels at both ends, so that windows need no bounds.
    owners = np.full(width + 2 * reach, -1, np.int32)
    squares = np.full(width + 2 * reach, _FAR, np.int32)
    other_squares = np.full(width + 2 * reach, _FAR, np.int32)
    best = np.empty(_SEGMENT, np.int32)
    shift = np.empty(_SEGMENT, np.int32)
    for row in range(start, stop):
        for x in range(width):
            offset = np.int32(nearest[row, x])
            offset_2 = np.int32(other[row, x])
            owners[reach + x] = indices[row, x]
            squares[reach + x] = offset * offset if offset != _NONE else _FAR
            other_squares[reach + x] = offset_2 * offset_2 if offset_2 != _NONE else _FAR
        count = 0
        for left in range(0, width, _SEGMENT):
            right = min(left + _SEGMENT, width)
            if charts[row, left:right].min() >= 0:
                for x in range(left, right):
                    indices[row, x] = row * width + x
                continue
            window = slice(left, right + 2 * reach)
            _search_window(squares[window], reach, right - left, best, shift)
            for x in range(left, right):
                dx = shift[x - left]
                column = x + dx
                found = dx != _NONE
                indices[row, x] = (row + nearest[row, column]) * width + column if found else -1
            count += _count_meeting(
                owners[window], squares[window], other_squares[window], reach, right - left, shift
            )
        meeting[row] = count


@njit(nogil=True, cache=True)
def _search_window(squares, reach, n, best, shift):  # type: ignore[no-untyped-def]
    """Columns to the nearest owner for each of n texels, `_NONE` where there is none within reach.

    `squares` begins `reach` texels before the first of them.
    """
    best[:] = np.int32(reach * reach + 1)
    shift[:] = np.int32(_NONE)
    for step in range(2 * reach + 1):
        # 0, -1, 1, -2, 2, ...: what is found first stays among equals.
        dx = np.int32((step + 1) // 2 if step % 2 == 0 else -((step + 1) // 2))
        square = np.int32(dx * dx)
        window = squares[reach + dx : reach + dx + n]
        for x in range(n):
            distance = np.int32(window[x] + square)
            nearer = distance < best[x]
            best[x] = distance if nearer else best[x]
            shift[x] = dx if nearer else shift[x]


@njit(nogil=True, cache=True)
def _count_meeting(owners, squares, other_squares, reach, n, shift):  # type: ignore[no-untyped-def]
    """How many of n texels, not owned, have an owner of another chart than the nearest in reach."""
    low = 1 << 30
    high = -1
    others = _FAR
    for x in range(len(owners)):
        low = min(low, owners[x] if owners[x] >= 0 else low)
        high = max(high, owners[x])
        others = min(others, other_squares[x])
    if low >= high and others == _FAR:  # one chart at most
        return 0
    chart = np.empty(n, np.int32)
    meets = np.zeros(n, np.int32)
    for x in range(n):
        chart[x] = owners[reach + x + shift[x]] if shift[x] != _NONE else -1
    for dx in range(-reach, reach + 1):
        most = np.int32(reach * reach - dx * dx)
        window = squares[reach + dx : reach + dx + n]
        window_2 = other_squares[reach + dx : reach + dx + n]
        window_owners = owners[reach + dx : reach + dx + n]
        for x in range(n):
            distance = window_2[x] if window_owners[x] == chart[x] else window[x]
            meets[x] |= np.int32(distance <= most)
    count = 0
    for x in range(n):
        count += 1 if meets[x] and squares[reach + x] > 0 else 0
    return count


def nearest_owner(
    chart_ids: npt.NDArray[np.int32], padding: int, *, threads: int | None = None
) -> NearestOwners:
    """Nearest owner of each texel, up to `padding` texels away.

    The time grows with the padding: the paddings in use, up to 64 texels, cost less than reading
    the image; one as wide as the image costs as much as trying every column for every texel.

    Parameters
    ----------
    chart_ids : (H, W) int32
        Chart that owns a texel, -1 where none does.
    padding
        Texels; 0 keeps only the owners.

    Returns
    -------
    NearestOwners
        All -1 where no chart owns a texel.

    Raises
    ------
    OptionError
        `padding` is negative or 16384 or more.
    """
    if not 0 <= padding < _NONE:
        raise OptionError(f"padding: {padding} is not between 0 and {_NONE - 1} texels")
    charts = np.require(chart_ids, np.int32, ["C", "W"])
    height, width = charts.shape
    # No distance is greater than this.
    reach = min(padding, height + width)
    nearest = np.empty((height, width), np.int16)
    other = np.empty((height, width), np.int16)
    indices = np.empty((height, width), np.int32)
    meeting = np.empty(height, np.int64)

    def search_columns(start: int, stop: int) -> None:
        _column_kernel(charts, reach, nearest, other, indices, start, stop)

    def search_rows(start: int, stop: int) -> None:
        _row_kernel(charts, reach, nearest, other, indices, meeting, start, stop)

    run_bands(search_columns, width, band=_COLUMN_BAND, threads=threads)
    run_bands(search_rows, height, band=_ROW_BAND, threads=threads)
    return NearestOwners(indices, int(meeting.sum()))


@njit(nogil=True, cache=True)
def _spread_kernel(values, indices, background, out, start, stop):  # type: ignore[no-untyped-def]
    n_channels = values.shape[1]
    for i in range(start, stop):
        source = indices[i]
        finite = source >= 0
        if source >= 0 and source != i:
            for channel in range(n_channels):
                finite = finite and np.isfinite(values[source, channel])
        for channel in range(n_channels):
            out[i, channel] = values[source, channel] if finite else background[channel]


def spread(
    values: npt.NDArray[Any],
    indices: npt.NDArray[np.int32],
    *,
    background: float | npt.ArrayLike = 0.0,
    threads: int | None = None,
) -> FloatImage:
    """Give each texel the value of its nearest owner.

    Parameters
    ----------
    values : (H, W, C) float32
        Read at owners alone.
    indices : (H, W) int32
        `NearestOwners.indices`.
    background
        A number, or one a channel, for texels out of reach, and for those whose nearest owner is
        not finite in all channels. An owner keeps its value whatever it is.

    Returns
    -------
    (H, W, C) float32
    """
    height, width, n_channels = values.shape
    flat = np.require(values, np.float32, ["C", "W"]).reshape(-1, n_channels)
    sources = np.require(indices, np.int32, ["C", "W"]).reshape(-1)
    fill = np.broadcast_to(np.asarray(background, np.float32), n_channels).copy()
    out = np.empty_like(flat)

    def work(start: int, stop: int) -> None:
        _spread_kernel(flat, sources, fill, out, start, stop)

    run_bands(work, len(flat), band=_ROW_BAND * max(width, 1), threads=threads)
    return out.reshape(height, width, n_channels)


@dataclass(frozen=True)
class Padded:
    """A map with its padding.

    Attributes
    ----------
    values : (H, W, C) float32
    is_padding : (H, W) bool
        Texels that no chart owns and that took a value.
    n_meeting : int
        Texels that no chart owns, within the padding of two charts or more.
    """

    values: FloatImage
    is_padding: npt.NDArray[np.bool_]
    n_meeting: int


def pad(
    values: npt.NDArray[Any],
    chart_ids: npt.NDArray[np.int32],
    padding: int,
    *,
    background: float | npt.ArrayLike = 0.0,
    threads: int | None = None,
) -> Padded:
    """Dilate one map: `nearest_owner` and `spread` in one call.

    Examples
    --------
    >>> values = np.array([[[0.0], [7.0], [0.0], [0.0]]])
    >>> padded = pad(values, np.array([[-1, 0, -1, -1]]), 1)
    >>> padded.values[0, :, 0].tolist(), padded.is_padding[0].tolist()
    ([7.0, 7.0, 7.0, 0.0], [True, False, True, False])
    """
    owners = nearest_owner(chart_ids, padding, threads=threads)
    return Padded(
        values=spread(values, owners.indices, background=background, threads=threads),
        is_padding=(owners.indices >= 0) & (np.asarray(chart_ids) < 0),
        n_meeting=owners.n_meeting,
    )


@njit(nogil=True, cache=True)
def _push_kernel(values, mask, coarse, coarse_mask, start, stop):  # type: ignore[no-untyped-def]
    """Means of the valid, finite texels of each 2 x 2 block, for coarse rows start on."""
    height, width, n_channels = values.shape
    totals = np.empty(n_channels, np.float64)
    for row in range(start, stop):
        for column in range(coarse.shape[1]):
            totals[:] = 0.0
            count = 0
            for y in range(2 * row, min(2 * row + 2, height)):
                for x in range(2 * column, min(2 * column + 2, width)):
                    if not mask[y, x]:
                        continue
                    finite = True
                    for channel in range(n_channels):
                        finite = finite and np.isfinite(values[y, x, channel])
                    if finite:
                        count += 1
                        for channel in range(n_channels):
                            totals[channel] += values[y, x, channel]
            for channel in range(n_channels):
                coarse[row, column, channel] = totals[channel] / max(count, 1)
            coarse_mask[row, column] = count > 0


@njit(nogil=True, cache=True)
def _pull_kernel(values, mask, coarse, start, stop):  # type: ignore[no-untyped-def]
    """Fill rows start on, where not valid, with the coarser level, interpolated bilinearly."""
    width, n_channels = values.shape[1:]
    last_row = coarse.shape[0] - 1
    last_column = coarse.shape[1] - 1
    for y in range(start, stop):
        near_row = y // 2
        far_row = min(max(near_row + (1 if y % 2 else -1), 0), last_row)
        for x in range(width):
            if mask[y, x]:
                continue
            near = x // 2
            far = min(max(near + (1 if x % 2 else -1), 0), last_column)
            for channel in range(n_channels):
                # Sixteenths of float32 add up exactly in float64, so a constant stays constant.
                total = 9.0 * coarse[near_row, near, channel]
                total += 3.0 * coarse[near_row, far, channel]
                total += 3.0 * coarse[far_row, near, channel]
                total += 1.0 * coarse[far_row, far, channel]
                values[y, x, channel] = total / 16.0


def push_pull(
    values: npt.NDArray[Any], mask: npt.NDArray[np.bool_], *, threads: int | None = None
) -> FloatImage:
    """Fill everything outside `mask`, smoothly, from what is inside it.

    Parameters
    ----------
    values : (H, W, C) float32
        Any size; it need not be a power of two.
    mask : (H, W) bool
        Texels to keep. One that is not finite in all channels is kept, but fills nothing.

    Returns
    -------
    (H, W, C) float32
        `values`, bit-equal inside `mask`; a new array. Where the mask is empty it is `values`
        everywhere, because there is nothing to fill with.
    """
    level = np.array(values, np.float32)
    valid = np.require(mask, np.bool_, ["C", "W"])
    levels = [(level, valid)]
    while max(level.shape[:2]) > 1:
        level, valid = _pushed(level, valid, threads)
        levels.append((level, valid))
    if not valid.any():
        return levels[0][0]
    for (level, valid), (coarse, _) in zip(levels[-2::-1], levels[:0:-1], strict=True):
        _pull(level, valid, coarse, threads)
    return levels[0][0]


def _pushed(
    values: FloatImage, mask: npt.NDArray[np.bool_], threads: int | None
) -> tuple[FloatImage, npt.NDArray[np.bool_]]:
    """Return the next coarser level, of half the size rounded up, and where it is valid."""
    height, width = (values.shape[0] + 1) // 2, (values.shape[1] + 1) // 2
    coarse = np.empty((height, width, values.shape[2]), np.float32)
    coarse_mask = np.empty((height, width), np.bool_)

    def work(start: int, stop: int) -> None:
        _push_kernel(values, mask, coarse, coarse_mask, start, stop)

    run_bands(work, height, band=_ROW_BAND, threads=threads)
    return coarse, coarse_mask


def _pull(
    values: FloatImage, mask: npt.NDArray[np.bool_], coarse: FloatImage, threads: int | None
) -> None:
    """Fill `values` in place, where not in `mask`, from the next coarser level."""

    def work(start: int, stop: int) -> None:
        _pull_kernel(values, mask, coarse, start, stop)

    run_bands(work, len(values), band=_ROW_BAND, threads=threads)
