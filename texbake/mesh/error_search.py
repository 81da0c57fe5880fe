"""The fewest faces whose surface stays within a distance of the surface that they come from.

The distance of a simplified surface falls about as its number of faces grows, so the next number to
try is read off the line through two tries, in logarithms. It does not fall at every step: the
number found fits, and one a little smaller does not, but there may be smaller ones that fit again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from texbake.core import portable_math as pm

_CLOSE = 1.02  # factor between a number of faces that fits and one that does not, to stop at
_TRIES = 16
_STEP = 4.0  # factor from one try to the next while nothing is known on that side
_MIDDLE = (0.15, 0.85)  # part of the range, in logarithms, in which the next try lies


class Trial(NamedTuple):
    """How many faces were left, and how far their surface lies off: infinite for no surface."""

    n_faces: int
    error: float


def search_fewest(
    attempt: Callable[[int], Trial], limit: float, n_least: int, n_most: int, n_first: int
) -> int:
    """Try numbers of faces, and return the least that stays within a limit.

    Examples
    --------
    >>> search_fewest(lambda n: Trial(n, 5.0 / n), 0.01, 4, 10_000, 1000) in range(500, 511)
    True
    """
    low, high = Trial(n_least - 1, math.inf), Trial(n_most, 0.0)
    n = n_first
    for _ in range(_TRIES):
        n = min(max(n, low.n_faces + 1), high.n_faces - 1)
        if n <= low.n_faces or high.n_faces <= _CLOSE * low.n_faces:
            break
        n_left, error = attempt(n)
        if error > limit:
            low = Trial(min(max(n, n_left), high.n_faces - 1), error)
        else:
            high = Trial(n, error)
            if n_left > _CLOSE * n:
                break
        n = _between(low, high, limit)
    return high.n_faces


def _between(low: Trial, high: Trial, limit: float) -> int:
    """What to try between a number of faces that does not fit and one that does."""
    ratio = high.n_faces / max(low.n_faces, 1)
    share = 0.5
    if high.error > 0.0 and low.error < math.inf:
        share = pm.log(low.error / limit) / pm.log(low.error / high.error)
        share = min(max(share, _MIDDLE[0]), _MIDDLE[1])
    elif ratio > _STEP**2:
        share = pm.log(_STEP) / pm.log(ratio)
        share = share if high.error == 0.0 else 1.0 - share
    return round(max(low.n_faces, 1) * pm.exp(share * pm.log(ratio)))
