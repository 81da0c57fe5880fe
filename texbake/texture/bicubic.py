"""Bicubic lookup: a smooth curve through the texels, for images that are magnified.

Catmull-Rom was chosen over the B-spline because it interpolates: at its center a texel has its own
value, as with the bilinear filter, so that changing the filter neither blurs the image nor moves
its level; and it reproduces polynomials up to the second degree. Its price is that beside a hard
edge it overshoots the texels, by at most 9/32 of their range in two dimensions: values that must
not leave a range have to be cut off by who uses them. First derivatives are continuous.

Based on: Catmull and Rom, "A Class of Local Interpolating Splines", 1974; Keys, "Cubic Convolution
Interpolation for Digital Image Processing", 1981 (a = -1/2).
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel
from texbake.texture.lookup import reduced, row_of_v, texel_at


@kernel
def _weights(along):  # type: ignore[no-untyped-def]
    """Weights of the texels before, at, after and beyond, by how far a place lies past the second.

    The second, which is 1 less the others, is left out.
    """
    before = 0.5 * along * (along * (2.0 - along) - 1.0)
    after = 0.5 * along * (along * (4.0 - 3.0 * along) + 1.0)
    beyond = 0.5 * along * along * (along - 1.0)
    return np.float32(before), np.float32(after), np.float32(beyond)


@kernel
def _curve(a, b, c, d, weights):  # type: ignore[no-untyped-def]
    before, after, beyond = weights
    return b + (before * (a - b) + after * (c - b) + beyond * (d - b))


@kernel
def bicubic_kernel(texels, offsets, sizes, uvs, wrap, border, out, start, stop):  # type: ignore[no-untyped-def]
    """Fill rows `start` to `stop` of `out` from the finest level."""
    n_channels = texels.shape[1]
    height, width = sizes[0]
    indices = np.empty((4, 4), np.int64)
    rows = np.empty(4, np.float32)
    values = np.empty(4, np.float32)
    for i in range(start, stop):
        x = reduced(uvs[i, 0], wrap) * width - 0.5
        y = row_of_v(reduced(uvs[i, 1], wrap), height) - 0.5
        left, top = int(np.floor(x)) - 1, int(np.floor(y)) - 1
        for row in range(4):
            for column in range(4):
                index = texel_at(left + column, top + row, width, height, wrap)
                indices[row, column] = index
        across, down = _weights(x - np.floor(x)), _weights(y - np.floor(y))
        for channel in range(n_channels):
            for row in range(4):
                for column in range(4):
                    index = indices[row, column]
                    values[column] = texels[index, channel] if index >= 0 else border[channel]
                rows[row] = _curve(values[0], values[1], values[2], values[3], across)
            out[i, channel] = _curve(rows[0], rows[1], rows[2], rows[3], down)
