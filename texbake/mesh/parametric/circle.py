"""Points of the unit circle at exact fractions of a turn.

The cosine of a float64 near a quarter turn is not 0, and mirrored angles give coordinates that
differ in the last bit. Here each angle is brought into the first eighth of a turn with integers, so
that quarter turns are exact and mirrored points mirror each other bit by bit.
"""

from __future__ import annotations

import numpy as np

from texbake.mesh.mesh import FloatArray


def circle_points(n_points: int) -> FloatArray:
    """Cosine and sine of k / n of a turn, for k from 0 to n - 1.

    Returns
    -------
    (n, 2) float64
        Each coordinate within one unit in its last place, and never -0.

    Examples
    --------
    >>> circle_points(4)
    array([[ 1.,  0.],
           [ 0.,  1.],
           [-1.,  0.],
           [ 0., -1.]])
    """
    eighths = 8 * np.arange(n_points, dtype=np.int64)
    octants, rests = eighths // n_points, eighths % n_points
    parts = np.where(octants % 2 == 1, n_points - rests, rests)
    angles = parts * (np.pi / 4.0) / n_points
    cosines = np.where(parts == n_points, np.sqrt(0.5), np.cos(angles))
    sines = np.where(parts == n_points, np.sqrt(0.5), np.sin(angles))
    # In octants 1, 2, 5 and 6 the point is nearer to the y axis than to the x axis.
    steep = ((octants + 1) // 2) % 2 == 1
    x, y = np.where(steep, sines, cosines), np.where(steep, cosines, sines)
    left = (octants >= 2) & (octants < 6)
    points = np.stack([np.where(left, -x, x), np.where(octants >= 4, -y, y)], axis=-1)
    return points + 0.0  # -0.0 becomes 0.0
