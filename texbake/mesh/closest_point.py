"""The point of a triangle closest to another point, for kernels; vectors are tuples of three.

Based on: Christer Ericson, "Real-Time Collision Detection", 2005, section 5.1.5.

Departs from Ericson, whose products of products lose all their digits on slivers: weights come from
the height over the first edge, and a triangle without area to speak of is taken as its three edges.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel

# The square of the sine of the angle at its first corner under which a triangle is taken as its
# three edges: its height is then a hundred roundings of its length, or less.
_SLIVER_SINE_SQUARED = 1e-28


@kernel
def point_at(values, row):  # type: ignore[no-untyped-def]
    """A row of an (n, 3) array."""
    return values[row, 0], values[row, 1], values[row, 2]


@kernel
def minus(a, b):  # type: ignore[no-untyped-def]
    """Difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def dot(a, b):  # type: ignore[no-untyped-def]
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def weighted(a, b, v, w):  # type: ignore[no-untyped-def]
    """Sum of v times a and w times b."""
    return v * a[0] + w * b[0], v * a[1] + w * b[1], v * a[2] + w * b[2]


@kernel
def _along(numerator, denominator):  # type: ignore[no-untyped-def]
    """Where on an edge, from 0 to 1; 0 on an edge without length."""
    return min(max(numerator / denominator, 0.0), 1.0) if denominator > 0.0 else 0.0


@kernel
def closest_on_triangle(ab, ac, ap):  # type: ignore[no-untyped-def]
    """Weights of b and c at the point closest to p, and its squared distance.

    Takes the edges from a to b and to c, and the vector from a to p. The weights are in [0, 1] and
    so is their sum, to rounding; that of a is what they leave of 1.
    """
    ab_ab, ab_ac, ac_ac = dot(ab, ab), dot(ab, ac), dot(ac, ac)
    ab_ap, ac_ap = dot(ab, ap), dot(ac, ap)
    v, w, sliver = 0.0, 0.0, True
    if ab_ab > 0.0:
        height = minus(ac, weighted(ab, ab, ab_ac / ab_ab, 0.0))
        # Twice, because on a needle the first leaves rounding that is not small beside the height.
        height = minus(height, weighted(ab, ab, dot(ab, height) / ab_ab, 0.0))
        height_squared = dot(height, height)
        if height_squared > _SLIVER_SINE_SQUARED * ac_ac:
            sliver = False
            w = dot(height, ap) / height_squared
            v = (ab_ap - w * ab_ac) / ab_ab
            if v > 0.0 and w > 0.0 and v + w < 1.0:
                offset = minus(ap, weighted(ab, ac, v, w))
                return v, w, dot(offset, offset)
    # The closest point lies on an edge that p is beyond.
    best, best_v, best_w = np.inf, 0.0, 0.0
    for edge in range(3):
        if edge == 0 and (sliver or w <= 0.0):
            edge_v, edge_w = _along(ab_ap, ab_ab), 0.0
        elif edge == 1 and (sliver or v <= 0.0):
            edge_v, edge_w = 0.0, _along(ac_ap, ac_ac)
        elif edge == 2 and (sliver or v + w >= 1.0):
            bc = minus(ac, ab)
            edge_w = _along(dot(bc, minus(ap, ab)), dot(bc, bc))
            edge_v = 1.0 - edge_w
        else:
            continue
        offset = minus(ap, weighted(ab, ac, edge_v, edge_w))
        squared = dot(offset, offset)
        if squared < best:
            best, best_v, best_w = squared, edge_v, edge_w
    return best_v, best_w, best
