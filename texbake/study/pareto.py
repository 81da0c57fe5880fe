"""Which settings are worth their time: the Pareto front, and where it stops paying.

Based on: Pareto's order: a point is on the front if none is both no slower and no worse. How much a
step along it pays is its exponent p, error ~ seconds^-p: with p = 1 twice the time halves the
error, with p = 1/2 four times the time does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

# A step pays if four times the time at least halves the error.
PAYS = 0.5


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of the points (seconds, error) that none beats, by rising time and falling error.

    Of equal points the first is taken; points that are not finite never are.

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
    """Exponent p of the step from one point of a front to a later one; infinite if it is free.

    Examples
    --------
    >>> payoff((1.0, 8.0), (4.0, 4.0))
    0.5
    """
    if b[1] <= 0.0 or b[0] <= a[0]:
        return math.inf
    return math.log(a[1] / b[1]) / math.log(b[0] / a[0])


def knee(points: Sequence[tuple[float, float]], front: Sequence[int]) -> int | None:
    """Index of the point of a front beyond which no step pays; None for an empty front.

    Each step is taken that pays `PAYS`, over points between that would not have.
    """
    if not front:
        return None
    here = front[0]
    for there in front[1:]:
        if payoff(points[here], points[there]) >= PAYS:
            here = there
    return here
