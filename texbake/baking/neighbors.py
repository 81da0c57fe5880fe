"""What lies beside a texel, and how values change there.

Only texels that are covered wholly have their sample at their center and so say how values change;
those of other charts, and those without a value, say nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.baking.coverage import FULL
from texbake.kernels import kernel
from texbake.mesh.mesh import IntArray

BOTH, ONE_SIDE, NEXT, NOTHING = 2, 1, 0, -1  # what lies along an axis; see `along`


@dataclass(frozen=True, eq=False)
class Metric:
    """How differences of values are measured: as multiples of what each map may be off by.

    Attributes
    ----------
    firsts : (maps + 1,) int32
        First channel of each map, and the number of channels.
    scales : (maps,) float64
        One by the bound of each map; 0 where it has none.
    """

    firsts: IntArray
    scales: npt.NDArray[np.float64]

    @property
    def arrays(self) -> tuple[IntArray, npt.NDArray[np.float64]]:
        """What kernels take."""
        return self.firsts, self.scales


@kernel
def is_surrounded(shape, texels, texel):  # type: ignore[no-untyped-def]
    """Whether the texels at all four sides are whole, and of the same chart."""
    height, width = shape
    counts, charts = texels
    chart = charts[texel]
    # A texel at the left or right border has one of another row beside it: that is asked for last.
    return (
        width <= texel < (height - 1) * width
        and counts[texel - 1] + counts[texel + 1] == 2 * FULL
        and counts[texel - width] + counts[texel + width] == 2 * FULL
        and charts[texel - 1] == chart
        and charts[texel + 1] == chart
        and charts[texel - width] == chart
        and charts[texel + width] == chart
        and 0 < np.uint32(texel) % np.uint32(width) < width - 1
    )


@kernel
def along(shape, texels, texel, axis):  # type: ignore[no-untyped-def]
    """Whole texels of the same chart along an axis (0: x, 1: y).

    Returns
    -------
    kind, a, b
        `BOTH`: a before and b after; `ONE_SIDE`: a beside it and b behind that; `NEXT`: a beside
        it, and no more; `NOTHING`.
    """
    height, width = shape
    n_texels = height * width
    counts, charts = texels
    chart = charts[texel]
    stride = 1 if axis == 0 else width
    before, after = texel - stride, texel + stride
    has_before = before >= 0 and charts[before] == chart and counts[before] == FULL
    has_after = after < n_texels and charts[after] == chart and counts[after] == FULL
    if axis == 0 and (has_before or has_after):
        column = texel % width
        has_before = has_before and column > 0
        has_after = has_after and column + 1 < width
    if has_before and has_after:
        return BOTH, before, after
    if not has_before and not has_after:
        return NOTHING, texel, texel
    near = before if has_before else after
    far = 2 * near - texel
    is_there = 0 <= far < n_texels and charts[far] == chart and counts[far] == FULL
    if is_there and (axis == 1 or far // width == texel // width):
        return ONE_SIDE, near, far
    return NEXT, near, near


@kernel
def second_difference(values, texel, kind, a, b, channel):  # type: ignore[no-untyped-def]
    """Second difference of one channel along an axis, or the first where that is all there is."""
    v, va, vb = values[texel, channel], values[a, channel], values[b, channel]
    if kind == BOTH:
        return float(va) + vb - 2.0 * v
    if kind == ONE_SIDE:
        return float(v) + vb - 2.0 * va
    return float(va) - v


@kernel
def _is_whole(texels, texel, chart):  # type: ignore[no-untyped-def]
    counts, charts = texels
    return counts[texel] == FULL and charts[texel] == chart


@kernel
def inner_texel(shape, texels, texel):  # type: ignore[no-untyped-def]
    """Return a whole texel of the same chart beside one that is not, at a side or a corner, or -1.

    One that is whole itself is its own.
    """
    height, width = shape
    chart = texels[1][texel]
    if _is_whole(texels, texel, chart):
        return texel
    row, column = texel // width, texel % width
    for is_corner in range(2):
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                if abs(dy) + abs(dx) != 1 + is_corner:
                    continue
                if 0 <= row + dy < height and 0 <= column + dx < width:
                    other = texel + dy * width + dx
                    if _is_whole(texels, other, chart):
                        return other
    return -1


@kernel
def write_slopes(shape, texels, values, texel, slopes):  # type: ignore[no-untyped-def]
    """Write by how much each channel changes a texel to the right, and one down: (2, C)."""
    for axis in range(2):
        kind, a, b = along(shape, texels, texel, axis)
        for channel in range(values.shape[1]):
            slope = 0.0
            if kind == BOTH:
                slope = 0.5 * (float(values[b, channel]) - values[a, channel])
            elif kind != NOTHING:
                slope = float(values[a, channel]) - values[texel, channel]
                slope = slope if a > texel else -slope
            slopes[axis, channel] = slope


@kernel
def astray(metric, values, place, origin, slopes, dx, dy, k):  # type: ignore[no-untyped-def]
    """How far a value of the k-th map is from going on evenly from another, in bounds."""
    firsts, scales = metric
    square = 0.0
    for channel in range(firsts[k], firsts[k + 1]):
        even = values[origin, channel] + dx * slopes[0, channel] + dy * slopes[1, channel]
        square += (values[place, channel] - even) ** 2
    return scales[k] * np.sqrt(square)
