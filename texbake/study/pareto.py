"""Which settings are worth their time: the Pareto front, and where it stops paying off.

A point is on the front if no other is at least as fast and as accurate. How much a step along the
front pays off is its exponent p in error ~ seconds^-p: with p = 1 twice the time halves the error,
with p = 1/2 four times the time does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from texbake.core import portable_math as pm

# A step pays off if four times the time at least halves the error.
PAYS = 0.5


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Return the indices of the points (seconds, error) that no other beats, fastest first.

    Of equal points the first is taken; points that are not finite are left out.

    Examples
    --------
    >>> pareto_front([(1, 9), (2, 5), (3, 6), (4, 1)])
    [0, 1, 3]
    """
    order = sorted(range(len(points)), key=lambda i: (*points[i], i))
    front: list[int] = []
    for i in order:
        seconds, error = points[i]
        if not (math.isfinite(seconds) and math.isfinite(error)):
            continue
        if not front or error < points[front[-1]][1]:
            front.append(i)
    return front


def payoff(a: tuple[float, float], b: tuple[float, float]) -> float:
    """Return the exponent p of the step from a point of a front to a later one; inf if free.

    Examples
    --------
    >>> payoff((1.0, 8.0), (4.0, 4.0))
    0.5
    """
    if b[1] <= 0.0 or b[0] <= a[0]:
        return math.inf
    return pm.log(a[1] / b[1]) / pm.log(b[0] / a[0])


def knee(points: Sequence[tuple[float, float]], front: Sequence[int]) -> int | None:
    """Return the index of the point of a front beyond which no step pays off; None if empty.

    Each step is taken whose exponent is at least `PAYS`, also over points between that do not pay.
    """
    if not front:
        return None
    here = front[0]
    for there in front[1:]:
        if payoff(points[here], points[there]) >= PAYS:
            here = there
    return here
