"""Kernels of noise: lattice cells, gradient noise, sums of octaves, cells about scattered points.

`point_coordinates` and the kernels after it, up to `contrast_kept`, read the points and pixel
widths of `points.ProcedurePoints`. `noise_at` and `octave_sum` are made to be called from other
kernels. The formulas and their sources are in `noise`.

Based on: Apodaca and Gritz, "Advanced RenderMan", 2000, chapter 11, for fading detail to its mean
by the width of the filter.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel

PERIOD = 256

# Neighbors of this magnitude in float64 are 2^-2 apart: what lies further out has no place within
# a cell any more. Times every frequency that can be asked for it stays finite.
_FARTHEST = 2.0**50


@kernel
def bounded(coordinate):  # type: ignore[no-untyped-def]
    """Return the coordinate, or 0 where it is not finite or too far out to lie within a cell."""
    # False also for what is not a number.
    return coordinate if abs(coordinate) <= _FARTHEST else 0.0


@kernel
def lattice_cell(coordinate):  # type: ignore[no-untyped-def]
    """Index of the cell modulo 256, and how far into the cell the coordinate lies, in [0, 1).

    For any finite coordinate: the remainder is taken before it becomes an integer.
    """
    floor = np.floor(coordinate)
    return int(floor - PERIOD * np.floor(floor / PERIOD)) & 255, coordinate - floor


# Pixels wider than this are as wide as this; every pattern has reached its mean long before.
_WIDEST = 2.0**50

# Of a cell: noise is kept whole in pixels up to a fourth of a cell and gone where a pixel is as
# wide as a cell. Noise averaged over a square keeps 0.96 and 0.62 of its contrast there; the rest
# is what would alias, since a cell is about one period and two pixels a period are the limit.
_KEPT_BELOW = 0.25
_GONE_ABOVE = 1.0


@kernel
def point_coordinates(points, i):  # type: ignore[no-untyped-def]
    """Three finite coordinates of a point; see `lattice.bounded`."""
    z = bounded(points[i, 2]) if points.shape[1] > 2 else 0.0
    return bounded(points[i, 0]), bounded(points[i, 1]), z


@kernel
def width_along(widths, i, axis):  # type: ignore[no-untyped-def]
    """Width of a pixel along an axis; 0 where nothing is filtered or it is not a number."""
    if len(widths) == 0 or (widths.shape[1] > 1 and axis >= widths.shape[1]):
        return 0.0
    width = np.float64(widths[i, axis if widths.shape[1] > 1 else 0])
    return min(width, _WIDEST) if width > 0.0 else 0.0


@kernel
def widest(widths, i):  # type: ignore[no-untyped-def]
    """Largest width of a pixel along any axis."""
    return max(width_along(widths, i, 0), width_along(widths, i, 1), width_along(widths, i, 2))


@kernel
def span_along(widths, i, direction):  # type: ignore[no-untyped-def]
    """How far a pixel reaches along a direction, a unit vector."""
    if widths.shape[1] == 1:
        return width_along(widths, i, 0)
    span = 0.0
    for axis in range(3):
        span += abs(direction[axis]) * width_along(widths, i, axis)
    return span


@kernel
def contrast_kept(cells):  # type: ignore[no-untyped-def]
    """Share of its contrast that noise keeps in a pixel so many cells wide, from 1 down to 0."""
    t = (cells - _KEPT_BELOW) / (_GONE_ABOVE - _KEPT_BELOW)
    t = min(max(t, 0.0), 1.0)
    return 1.0 - t * t * (3.0 - 2.0 * t)


@kernel
def noise_at(permutation, gradients, quintic, x, y, z):  # type: ignore[no-untyped-def]
    """Signed noise at a point with finite coordinates."""
    i, u = lattice_cell(x)
    j, v = lattice_cell(y)
    k, t = lattice_cell(z)
    # w(t - 1) = 1 - w(t), so that the sum over corners is one interpolation after another.
    to_right, to_back, to_top = _risen(u, quintic), _risen(v, quintic), _risen(t, quintic)
    right, back, top = (i + 1) & 255, j + 1, k + 1
    below, above = permutation[k], permutation[top]
    front_below, back_below = permutation[j + below], permutation[(back & 255) + below]
    front_above, back_above = permutation[j + above], permutation[(back & 255) + above]
    low = _along_edge(
        permutation, gradients, i + front_below, right + front_below, to_right, u, v, t
    )
    far = _along_edge(
        permutation, gradients, i + back_below, right + back_below, to_right, u, v - 1.0, t
    )
    low += to_back * (far - low)
    t -= 1.0
    high = _along_edge(
        permutation, gradients, i + front_above, right + front_above, to_right, u, v, t
    )
    far = _along_edge(
        permutation, gradients, i + back_above, right + back_above, to_right, u, v - 1.0, t
    )
    high += to_back * (far - high)
    return low + to_top * (high - low)


@kernel
def _along_edge(permutation, gradients, left, right, to_right, u, v, t):  # type: ignore[no-untyped-def]
    """Slopes of the two corners of an edge along x, interpolated."""
    left, right = permutation[left], permutation[right]
    at_left = gradients[left, 0] * u + gradients[left, 1] * v + gradients[left, 2] * t
    at_right = gradients[right, 0] * (u - 1.0) + gradients[right, 1] * v + gradients[right, 2] * t
    return at_left + to_right * (at_right - at_left)


@kernel
def _risen(t, quintic):  # type: ignore[no-untyped-def]
    """Return 1 - w(t) for t in [0, 1]."""
    if quintic:
        return t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
    return t * t * (3.0 - 2.0 * t)


@kernel
def noise_kernel(points, widths, permutation, slopes, quintic, bound, out, start, stop):  # type: ignore[no-untyped-def]
    """Gradient noise, scaled to [0, 1]."""
    for i in range(start, stop):
        x, y, z = point_coordinates(points, i)
        kept = contrast_kept(widest(widths, i))
        value = 0.0
        if kept > 0.0:
            value = kept * noise_at(permutation, slopes, quintic, x, y, z)
        out[i, 0] = 0.5 + 0.5 * value / bound


# Cells that each octave of a fractal sum is moved along x, y and z beyond the one before it.
OCTAVE_SHIFT = (37, 17, 59)


@kernel
def octave_sum(permutation, slopes, quintic, octaves, ratios, mean, x, y, z, width):  # type: ignore[no-untyped-def]
    """Sum of octaves at a point, and the share of their squared amplitudes that faded.

    Parameters
    ----------
    permutation, slopes, quintic
        As `noise_at` takes them.
    octaves : int
    ratios : (float, float)
        Lacunarity and gain.
    mean : float
        What an octave of |noise| fades to; below 0: of the noise itself, which fades to 0.
    x, y, z : float
        Finite.
    width : float
        Of the pixel; 0: nothing fades.

    Returns
    -------
    (float, float)
        The sum; and over all octaves the sum of amplitude^2 (1 - kept^2).
    """
    lacunarity, gain = ratios
    scale = 1.0
    amplitude = 1.0
    total = 0.0
    lost = 0.0
    for octave in range(octaves):
        shift = octave if mean < 0.0 else 0
        kept = contrast_kept(width * scale) if width > 0.0 else 1.0
        value = 0.0
        if kept > 0.0:
            value = noise_at(
                permutation, slopes, quintic,
                x * scale + shift * OCTAVE_SHIFT[0],
                y * scale + shift * OCTAVE_SHIFT[1],
                z * scale + shift * OCTAVE_SHIFT[2],
            )  # fmt: skip
        if mean >= 0.0:
            value = mean + kept * (abs(value) - mean)
        else:
            value *= kept
        total += amplitude * value
        lost += amplitude * amplitude * (1.0 - kept * kept)
        scale *= lacunarity
        amplitude *= gain
    return total, lost


@kernel
def octave_sums_kernel(  # type: ignore[no-untyped-def]
    points, widths, permutation, slopes, quintic, octaves, ratios, mean, sums, start, stop
):
    """Signed sums of octaves."""
    for i in range(start, stop):
        x, y, z = point_coordinates(points, i)
        sums[i], _ = octave_sum(
            permutation, slopes, quintic, octaves, ratios, mean, x, y, z, widest(widths, i)
        )


@kernel
def octave_values_kernel(  # type: ignore[no-untyped-def]
    points, widths, permutation, slopes, quintic, octaves, ratios, mean, offset, scale, out,
    start, stop,
):  # fmt: skip
    """Sums of octaves, scaled and clamped to [0, 1]."""
    for i in range(start, stop):
        x, y, z = point_coordinates(points, i)
        total, _ = octave_sum(
            permutation, slopes, quintic, octaves, ratios, mean, x, y, z, widest(widths, i)
        )
        out[i, 0] = min(max(offset + scale * total, 0.0), 1.0)


F1 = 0
F2_MINUS_F1 = 1


@kernel
def _nearest_two(permutation, places, jitter, n_dimensions, x, y, z):  # type: ignore[no-untyped-def]
    """Squared distances to the nearest and the second nearest point."""
    i, u = lattice_cell(x)
    j, v = lattice_cell(y)
    k, t = lattice_cell(z)
    nearest = np.inf
    second = np.inf
    reach = 0
    while True:
        reach_z = reach if n_dimensions == 3 else 0
        for dk in range(-reach_z, reach_z + 1):
            gap_k = _gap(t, dk) if n_dimensions == 3 else 0.0
            hash_k = permutation[(k + dk) & 255] if n_dimensions == 3 else 0
            for dj in range(-reach, reach + 1):
                gap_jk = gap_k + _gap(v, dj)
                # Inside the ring all cells have been searched before.
                inside = max(abs(dj), abs(dk)) < reach
                hash_j = permutation[((j + dj) & 255) + hash_k]
                for di in range(-reach, reach + 1, 2 * reach if inside else 1):
                    if gap_jk + _gap(u, di) >= second:
                        continue
                    index = permutation[((i + di) & 255) + hash_j]
                    off_x = di + 0.5 + jitter * (places[index, 0] - 0.5) - u
                    off_y = dj + 0.5 + jitter * (places[index, 1] - 0.5) - v
                    squared = off_x * off_x + off_y * off_y
                    if n_dimensions == 3:
                        off_z = dk + 0.5 + jitter * (places[index, 2] - 0.5) - t
                        squared += off_z * off_z
                    second = min(second, max(nearest, squared))
                    nearest = min(nearest, squared)
        if second <= reach * reach:  # what lies further out is at least that far away
            return nearest, second
        reach += 1


@kernel
def _gap(within, step):  # type: ignore[no-untyped-def]
    """Square of how far the cell `step` cells away is along one axis."""
    if step == 0:
        return 0.0
    gap = step - within if step > 0 else within - step - 1.0
    return gap * gap


@kernel
def worley_kernel(  # type: ignore[no-untyped-def]
    points, widths, permutation, places, jitter, n_dimensions, feature, mean, out, start, stop
):
    """F1 or F2 - F1, clamped to 1."""
    for i in range(start, stop):
        x, y, z = point_coordinates(points, i)
        kept = contrast_kept(widest(widths, i))
        value = 0.0
        if kept > 0.0:
            nearest, second = _nearest_two(permutation, places, jitter, n_dimensions, x, y, z)
            value = np.sqrt(nearest)
            if feature == F2_MINUS_F1:
                value = np.sqrt(second) - value
        out[i, 0] = mean + kept * (min(value, 1.0) - mean)
