"""Kernels of texture filters, each of which fills a run of rows of its result.

============  ============================================  ===================
filter        reads                                         kernel
============  ============================================  ===================
nearest       one texel of the finest level                 nearest_kernel
bilinear      four texels of the finest level               trilinear_kernel
bicubic       sixteen texels of the finest level            bicubic_kernel
trilinear     four texels of each of two levels             trilinear_kernel
supersampled  256 bilinear lookups in the finest level      supersampled_kernel
============  ============================================  ===================

The bilinear and trilinear filters are one kernel: without derivatives, everything is read from the
finest level. Their weights are float32, for speed. `ramp_kernel` and `volume_kernel` read textures
of one and of three dimensions. The anisotropic filter has its own module, `ewa`.

Bicubic filtering uses Catmull-Rom and not the B-spline because Catmull-Rom interpolates: at its
center a texel keeps its own value, as with the bilinear filter, so that changing the filter neither
blurs the image nor shifts its brightness; and polynomials up to the second degree are reproduced.
The price is overshoot beside hard edges, by at most 9/32 of the range of the texels in two
dimensions: callers whose values must stay within a range have to clip them. First derivatives are
continuous.

Supersampling is the slow reference. It reads only the finest level, so that it shares nothing with
the filters that read smaller ones, and gives all lookups the same weight, as a square pixel does.
The lookups form a rank-1 lattice, whose points all differ in both coordinates: the rows of a
regular 16 x 16 grid would fall on the same phase of a regular texture over and over. The multiplier
was chosen among all odd ones for small errors over waves of up to 40 periods per pixel.

Based on: Williams, "Pyramidal Parametrics", 1983, and the OpenGL 4.6 specification, section 8.14,
for mip levels: rho is the longer of the two steps, in texels, that one pixel to the right and one
pixel down make on the texture. Catmull and Rom, "A Class of Local Interpolating Splines", 1974;
Keys, "Cubic Convolution Interpolation for Digital Image Processing", 1981 (a = -1/2). Korobov, "The
Approximate Computation of Multiple Integrals", 1959, for the lattice; Heckbert, "Fundamentals of
Texture Mapping and Image Warping", 1989, for the parallelogram that a pixel covers.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel
from texbake.texture.interpolation import (
    BORDER,
    OUTSIDE,
    bilinear_cell,
    interpolate_cell,
    row_of_v,
    texel_at,
    wrap_index,
    wrap_to_period,
    wrap_to_unit,
)


@kernel
def lookup_kernel(image, uvs, wrap, border, out, start, stop):  # type: ignore[no-untyped-def]
    """Bilinear values of an image without mip levels, with float64 weights."""
    height, width, n_channels = image.shape
    texels = image.reshape((height * width, n_channels))
    for i in range(start, stop):
        u, v = wrap_to_unit(uvs[i, 0], wrap), wrap_to_unit(uvs[i, 1], wrap)
        cell, x, y = bilinear_cell(u, v, width, height, wrap, 0)
        for channel in range(n_channels):
            out[i, channel] = interpolate_cell(texels, cell, x, y, channel, border[channel])


@kernel
def nearest_kernel(texels, offsets, sizes, uvs, wrap, border, out, start, stop):  # type: ignore[no-untyped-def]
    """The texel that holds each coordinate, of the finest level."""
    height, width = sizes[0]
    for i in range(start, stop):
        column, row = _texel_of(
            wrap_to_unit(uvs[i, 0], wrap), wrap_to_unit(uvs[i, 1], wrap), width, height
        )
        index = texel_at(column, row, width, height, wrap)
        for channel in range(texels.shape[1]):
            out[i, channel] = texels[index, channel] if index >= 0 else border[channel]


@kernel
def _texel_of(u, v, width, height):  # type: ignore[no-untyped-def]
    """Column and row that hold a coordinate; a texel holds its left and its lower edge."""
    column = int(np.floor(min(max(u * width, -1.0), float(width))))
    row = int(np.ceil(min(max(row_of_v(v, height), 0.0), height + 1.0))) - 1
    return column, row


@kernel
def levels_kernel(derivatives, width, height, out, start, stop):  # type: ignore[no-untyped-def]
    """Mip level of each pixel; see `footprint_level`."""
    for i in range(start, stop):
        out[i] = footprint_level(derivatives[i], width, height)


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
        u = wrap_to_unit(uvs[i, 0], wrap)
        v = wrap_to_unit(uvs[i, 1], wrap)
        level = np.float32(0.0)
        if filtered:
            level = footprint_level(derivatives[i], width_f, height_f)
            level = min(level, last) if level > 0.0 else np.float32(0.0)
        fine = int(level)
        blend = level - np.float32(fine)
        cell, x, y = bilinear_cell(u, v, sizes[fine, 1], sizes[fine, 0], wrap, offsets[fine])
        x, y = np.float32(x), np.float32(y)
        if colors:
            red, green, blue = _mixed_colors(texels, cell, x, y)
            if blend > 0.0:
                fine += 1
                cell, x, y = bilinear_cell(
                    u, v, sizes[fine, 1], sizes[fine, 0], wrap, offsets[fine]
                )
                far = _mixed_colors(texels, cell, np.float32(x), np.float32(y))
                red += blend * (far[0] - red)
                green += blend * (far[1] - green)
                blue += blend * (far[2] - blue)
            out[i, 0], out[i, 1], out[i, 2] = red, green, blue
            continue
        if blend == 0.0:
            for channel in range(n_channels):
                out[i, channel] = interpolate_cell(texels, cell, x, y, channel, border[channel])
            continue
        coarse, across, down = bilinear_cell(
            u, v, sizes[fine + 1, 1], sizes[fine + 1, 0], wrap, offsets[fine + 1]
        )
        across, down = np.float32(across), np.float32(down)
        for channel in range(n_channels):
            outside = border[channel]
            near = interpolate_cell(texels, cell, x, y, channel, outside)
            far = interpolate_cell(texels, coarse, across, down, channel, outside)
            out[i, channel] = near + blend * (far - near)


@kernel
def _catmull_rom_weights(along):  # type: ignore[no-untyped-def]
    """Weights of the texels before, at, after and beyond, by how far a place lies past the second.

    The second, which is 1 less the others, is left out.
    """
    before = 0.5 * along * (along * (2.0 - along) - 1.0)
    after = 0.5 * along * (along * (4.0 - 3.0 * along) + 1.0)
    beyond = 0.5 * along * along * (along - 1.0)
    return np.float32(before), np.float32(after), np.float32(beyond)


@kernel
def _catmull_rom(a, b, c, d, weights):  # type: ignore[no-untyped-def]
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
        x = wrap_to_period(uvs[i, 0], wrap) * width - 0.5
        y = row_of_v(wrap_to_period(uvs[i, 1], wrap), height) - 0.5
        left, top = int(np.floor(x)) - 1, int(np.floor(y)) - 1
        for row in range(4):
            for column in range(4):
                index = texel_at(left + column, top + row, width, height, wrap)
                indices[row, column] = index
        across, down = _catmull_rom_weights(x - np.floor(x)), _catmull_rom_weights(y - np.floor(y))
        for channel in range(n_channels):
            for row in range(4):
                for column in range(4):
                    index = indices[row, column]
                    values[column] = texels[index, channel] if index >= 0 else border[channel]
                rows[row] = _catmull_rom(values[0], values[1], values[2], values[3], across)
            out[i, channel] = _catmull_rom(rows[0], rows[1], rows[2], rows[3], down)


_N_SAMPLES = 256
_MULTIPLIER = 111
_LATTICE_STEPS = np.arange(_N_SAMPLES) + 0.5

# (256, 2) points of [-1/2, 1/2]², as many to either side of the middle, and as far.
SUPERSAMPLES = (
    np.stack([_LATTICE_STEPS, _MULTIPLIER * _LATTICE_STEPS % _N_SAMPLES], axis=1) / _N_SAMPLES - 0.5
)
SUPERSAMPLES.flags.writeable = False


@kernel
def supersampled_kernel(  # type: ignore[no-untyped-def]
    texels, offsets, sizes, uvs, derivatives, samples, wrap, border, out, start, stop
):  # fmt: skip
    """Fill rows `start` to `stop` of `out`."""
    n_channels = texels.shape[1]
    height, width = sizes[0]
    sums = np.empty(n_channels)
    for i in range(start, stop):
        for channel in range(n_channels):
            sums[channel] = 0.0
        for k in range(len(samples)):
            right, down = samples[k]
            u = uvs[i, 0] + right * derivatives[i, 0] + down * derivatives[i, 2]
            v = uvs[i, 1] + right * derivatives[i, 1] + down * derivatives[i, 3]
            cell, x, y = bilinear_cell(
                wrap_to_unit(u, wrap), wrap_to_unit(v, wrap), width, height, wrap, offsets[0]
            )
            for channel in range(n_channels):
                sums[channel] += interpolate_cell(texels, cell, x, y, channel, border[channel])
        for channel in range(n_channels):
            out[i, channel] = sums[channel] / len(samples)


@kernel
def ramp_kernel(stops, values, wrap, border, out, start, stop):  # type: ignore[no-untyped-def]
    """Colors between the stops of a ramp."""
    last, n_channels = len(stops) - 1, stops.shape[1]
    for i in range(start, stop):
        place = wrap_to_unit(np.float64(values[i]), wrap)
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


@kernel
def _volume_texel(column, row, layer, sizes, wrap):  # type: ignore[no-untyped-def]
    """Index of the texel that stands anywhere; OUTSIDE for the border."""
    depth, height, width = sizes
    layer = wrap_index(layer, depth, wrap)
    index = texel_at(column, row, width, height, wrap)
    return layer * height * width + index if layer >= 0 and index >= 0 else OUTSIDE


@kernel
def _slice_cell(left, top, layer, sizes, wrap):  # type: ignore[no-untyped-def]
    """Four texels of a slice, as `between` takes them."""
    return (
        _volume_texel(left, top, layer, sizes, wrap),
        _volume_texel(left + 1, top, layer, sizes, wrap),
        _volume_texel(left, top + 1, layer, sizes, wrap),
        _volume_texel(left + 1, top + 1, layer, sizes, wrap),
    )


@kernel
def volume_kernel(volume, points, nearest, wrap, border, out, start, stop):  # type: ignore[no-untyped-def]
    """Nearest or trilinear values of a volume."""
    depth, height, width, n_channels = volume.shape
    sizes = depth, height, width
    texels = volume.reshape((depth * height * width, n_channels))
    for i in range(start, stop):
        x = wrap_to_period(points[i, 0], wrap) * width
        y = row_of_v(wrap_to_period(points[i, 1], wrap), height)
        z = wrap_to_period(points[i, 2], wrap) * depth
        if nearest:
            # A texel holds its left, its lower and its front side, as in an image.
            index = _volume_texel(
                int(np.floor(x)), int(np.ceil(y)) - 1, int(np.floor(z)), sizes, wrap
            )
            for channel in range(n_channels):
                out[i, channel] = texels[index, channel] if index >= 0 else border[channel]
            continue
        left, top, front = int(np.floor(x - 0.5)), int(np.floor(y - 0.5)), int(np.floor(z - 0.5))
        along_x = np.float32(x - 0.5 - left)
        along_y = np.float32(y - 0.5 - top)
        along_z = np.float32(z - 0.5 - front)
        cell = _slice_cell(left, top, front, sizes, wrap)
        behind = _slice_cell(left, top, front + 1, sizes, wrap)
        for channel in range(n_channels):
            near = interpolate_cell(texels, cell, along_x, along_y, channel, border[channel])
            far = interpolate_cell(texels, behind, along_x, along_y, channel, border[channel])
            out[i, channel] = near + along_z * (far - near)
