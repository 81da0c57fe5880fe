"""Kernels: the nearest texel that a chart owns, for every texel around the charts.

Distances are Euclidean, between texel centers. Among owners at the same distance, the one with the
fewest columns between wins, then the left one, then the upper one.

Based on: Felzenszwalb and Huttenlocher, "Distance Transforms of Sampled Functions", 2012, and
Meijster, Roerdink and Hesselink, "A General Algorithm for Computing Distance Transforms in Linear
Time", 2000, for columns first and rows second. Departs from them in two ways. Rows are searched in
a window of the width of the padding, which vectorizes and so is faster for the paddings in use. And
columns keep a second owner, the nearest of any other chart, which is enough to find every texel
that lies within the padding of two charts.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel

# Texels of a row that the second pass searches together; those that are all owned it skips.
_SEGMENT = 128

# "No owner within reach", as an offset in texels; so the greatest padding is one less.
NO_OWNER = 16384

# Its square and more: no sum of two squared distances within reach comes near it.
_FAR = 1 << 30


@kernel
def column_kernel(charts, reach, nearest, other, owners, start, stop):  # type: ignore[no-untyped-def]
    """Vertical offsets, down, to the nearest owner and to the nearest of another chart.

    Columns `start` to `stop`; `NO_OWNER` where there is none within the padding. `owners` gets the
    chart of the nearest owner. One sweep down finds the owners above, one up those below.
    """
    height = charts.shape[0]
    width = stop - start
    far = np.int32(2 * NO_OWNER)
    # Rows of the last owner met and of the last one of another chart than that, and its chart.
    last = np.full(width, -far, np.int32)
    before = np.full(width, -far, np.int32)
    chart = np.full(width, -1, np.int32)
    for row in range(height):
        _meet(charts[row, start:stop], np.int32(row), last, before, chart)
        for x in range(width):
            offset = np.int32(last[x] - row)
            offset_2 = np.int32(before[x] - row)
            nearest[row, start + x] = offset if offset >= -reach else NO_OWNER
            other[row, start + x] = offset_2 if offset_2 >= -reach else NO_OWNER
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
                    other[row, column] = down_2 if down_2 <= reach else NO_OWNER
                elif not same and up >= 0:
                    other[row, column] = -up


@kernel
def _meet(row_charts, row, last, before, chart):  # type: ignore[no-untyped-def]
    """Take one more row of charts into the state of a sweep over columns."""
    for x in range(len(row_charts)):
        met = row_charts[x]
        owned = met >= 0
        before[x] = last[x] if owned and met != chart[x] else before[x]
        last[x] = row if owned else last[x]
        chart[x] = met if owned else chart[x]


@kernel
def _all_owned(charts, row, left, right):  # type: ignore[no-untyped-def]
    while left < right and charts[row, left] >= 0:
        left += 1
    return left == right


@kernel
def row_kernel(charts, reach, nearest, other, indices, meeting, start, stop):  # type: ignore[no-untyped-def]
    """Nearest owners in rows `start` to `stop`, and how many texels of each lie near two charts.

    `indices` initially holds the charts of the columns' nearest owners.
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
            squares[reach + x] = offset * offset if offset != NO_OWNER else _FAR
            other_squares[reach + x] = offset_2 * offset_2 if offset_2 != NO_OWNER else _FAR
        count = 0
        for left in range(0, width, _SEGMENT):
            right = min(left + _SEGMENT, width)
            if _all_owned(charts, row, left, right):
                for x in range(left, right):
                    indices[row, x] = row * width + x
                continue
            window = slice(left, right + 2 * reach)
            _search_window(squares[window], reach, right - left, best, shift)
            for x in range(left, right):
                dx = shift[x - left]
                column = x + dx
                found = dx != NO_OWNER
                indices[row, x] = (row + nearest[row, column]) * width + column if found else -1
            count += _count_meeting(
                owners[window], squares[window], other_squares[window], reach, right - left, shift
            )
        meeting[row] = count


@kernel
def _search_window(squares, reach, n, best, shift):  # type: ignore[no-untyped-def]
    """Columns to the nearest owner for each of n texels; `NO_OWNER` where it is too far away.

    `squares` begins `reach` texels, the width of the padding, before the first of them.
    """
    best[:] = np.int32(reach * reach + 1)
    shift[:] = np.int32(NO_OWNER)
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


@kernel
def _count_meeting(owners, squares, other_squares, reach, n, shift):  # type: ignore[no-untyped-def]
    """Of n texels, how many have no owner but lie within the padding of two charts."""
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
        chart[x] = owners[reach + x + shift[x]] if shift[x] != NO_OWNER else -1
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
