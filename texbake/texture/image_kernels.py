"""Kernels that pass over a whole image: integer codes, padding, smaller levels.

The Python functions that call them are in `encoding`, `padding` and `mipmaps`, with the sources of
the algorithms.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel


@kernel
def quantize_kernel(values, factors, offsets, noise, top, codes, start, stop):  # type: ignore[no-untyped-def]
    """Integer codes `value * factor + offset`, rounded; |value| <= noise counts as 0."""
    n_channels = values.shape[1]
    for i in range(start, stop):
        for channel in range(n_channels):
            value = np.float64(values[i, channel])
            if abs(value) <= noise:
                value = np.float64(0.0)
            code = value * factors[channel] + offsets[channel] + 0.5
            # Also NaN becomes 0.
            codes[i, channel] = np.uint16(min(code, top)) if code > 0.0 else np.uint16(0)


@kernel
def mip_kernel(values, rows, row_weights, columns, column_weights, out, start, stop):  # type: ignore[no-untyped-def]
    """Rows of a smaller level, from the taps of its rows and its columns."""
    n_channels = out.shape[2]
    n_values = values.shape[1]
    line = np.empty(n_values, np.float32)
    for row in range(start, stop):
        # Differences from one of the texels, so that a constant stays exactly what it is.
        base = rows[row, 0]
        for k in range(n_values):
            line[k] = values[base, k]
        for tap in range(1, rows.shape[1]):
            weight, other = row_weights[row, tap], rows[row, tap]
            for k in range(n_values):
                line[k] += weight * (values[other, k] - values[base, k])
        for column in range(out.shape[1]):
            first = columns[column, 0] * n_channels
            for channel in range(n_channels):
                value = line[first + channel]
                total = value
                for tap in range(1, columns.shape[1]):
                    place = columns[column, tap] * n_channels + channel
                    total += column_weights[column, tap] * (line[place] - value)
                out[row, column, channel] = total


@kernel
def spread_kernel(values, indices, background, out, start, stop):  # type: ignore[no-untyped-def]
    """Each texel gets the value of its nearest owner, or the background."""
    n_channels = values.shape[1]
    for i in range(start, stop):
        source = indices[i]
        finite = source >= 0
        if source >= 0 and source != i:
            for channel in range(n_channels):
                finite = finite and np.isfinite(values[source, channel])
        for channel in range(n_channels):
            out[i, channel] = values[source, channel] if finite else background[channel]


@kernel
def push_kernel(values, mask, coarse, coarse_mask, start, stop):  # type: ignore[no-untyped-def]
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


@kernel
def pull_kernel(values, mask, coarse, start, stop):  # type: ignore[no-untyped-def]
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
