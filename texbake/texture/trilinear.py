"""Bilinear lookup in an image, and trilinear lookup in the two levels that fit a pixel.

`footprint_level` and the kernels of `texbake.texture.lookup` say where; weights are float32, for
speed. Both filters are one kernel: without derivatives, everything is read from the finest level.

Based on: Williams, "Pyramidal Parametrics", 1983; the OpenGL 4.6 specification, section 8.14, for
the level: rho is the longer of the two steps, in texels, that one pixel to the right and one down
make on the texture.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel
from texbake.texture.lookup import BORDER, between, cell_at, folded


@kernel
def footprint_level(derivatives, width, height):  # type: ignore[no-untyped-def]
    """Level (float32) whose texels are as large as a pixel: log2 of rho, below 0 where it is less.

    Minus infinity where coordinates do not change; what is not a number counts as no change.
    """
    right_u, right_v = derivatives[0] * width, derivatives[1] * height
    down_u, down_v = derivatives[2] * width, derivatives[3] * height
    right = right_u * right_u + right_v * right_v
    down = down_u * down_u + down_v * down_v
    # Comparisons are False for what is not a number.
    squared = right if right > 0.0 else np.float32(0.0)
    squared = down if down > squared else squared
    return np.float32(0.5) * np.log2(squared)


@kernel
def _mixed_colors(texels, cell, x, y):  # type: ignore[no-untyped-def]
    """Three channels between the four texels of a cell inside the image.

    The same numbers as `between` gives, a quarter faster: unsigned indices spare the question
    whether they count from the end.
    """
    a, b, c, d = np.uint64(cell[0]), np.uint64(cell[1]), np.uint64(cell[2]), np.uint64(cell[3])
    first, second, third = np.uint64(0), np.uint64(1), np.uint64(2)
    above0 = texels[a, first] + x * (texels[b, first] - texels[a, first])
    below0 = texels[c, first] + x * (texels[d, first] - texels[c, first])
    above1 = texels[a, second] + x * (texels[b, second] - texels[a, second])
    below1 = texels[c, second] + x * (texels[d, second] - texels[c, second])
    above2 = texels[a, third] + x * (texels[b, third] - texels[a, third])
    below2 = texels[c, third] + x * (texels[d, third] - texels[c, third])
    return (
        above0 + y * (below0 - above0),
        above1 + y * (below1 - above1),
        above2 + y * (below2 - above2),
    )


@kernel
def trilinear_kernel(texels, offsets, sizes, uvs, derivatives, wrap, border, out, start, stop):  # type: ignore[no-untyped-def]
    """Fill rows `start` to `stop` of `out`; without rows of derivatives, from the finest level."""
    n_channels = texels.shape[1]
    last = np.float32(len(offsets) - 1)
    height, width = sizes[0]
    width_f, height_f = np.float32(width), np.float32(height)
    filtered = len(derivatives) > 0
    colors = n_channels == 3 and wrap != BORDER
    for i in range(start, stop):
        u = folded(uvs[i, 0], wrap)
        v = folded(uvs[i, 1], wrap)
        level = np.float32(0.0)
        if filtered:
            level = footprint_level(derivatives[i], width_f, height_f)
            level = min(level, last) if level > 0.0 else np.float32(0.0)
        fine = int(level)
        blend = level - np.float32(fine)
        cell, x, y = cell_at(u, v, sizes[fine, 1], sizes[fine, 0], wrap, offsets[fine])
        x, y = np.float32(x), np.float32(y)
        if colors:
            red, green, blue = _mixed_colors(texels, cell, x, y)
            if blend > 0.0:
                fine += 1
                cell, x, y = cell_at(u, v, sizes[fine, 1], sizes[fine, 0], wrap, offsets[fine])
                far = _mixed_colors(texels, cell, np.float32(x), np.float32(y))
                red += blend * (far[0] - red)
                green += blend * (far[1] - green)
                blue += blend * (far[2] - blue)
            out[i, 0], out[i, 1], out[i, 2] = red, green, blue
            continue
        if blend == 0.0:
            for channel in range(n_channels):
                out[i, channel] = between(texels, cell, x, y, channel, border[channel])
            continue
        coarse, across, down = cell_at(
            u, v, sizes[fine + 1, 1], sizes[fine + 1, 0], wrap, offsets[fine + 1]
        )
        across, down = np.float32(across), np.float32(down)
        for channel in range(n_channels):
            outside = border[channel]
            near = between(texels, cell, x, y, channel, outside)
            far = between(texels, coarse, across, down, channel, outside)
            out[i, channel] = near + blend * (far - near)
