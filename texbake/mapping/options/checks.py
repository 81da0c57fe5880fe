"""Checks of directions and ranges, and the types of vectors and matrices."""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Real

from texbake.errors import OptionError

Vector = tuple[float, float, float]
Matrix = tuple[tuple[float, float, float, float], ...]


def check_numbers(name: str, values: object, n_values: int) -> None:
    """Raise `OptionError` unless the value is a sequence of so many finite numbers."""
    if (
        isinstance(values, str)
        or not isinstance(values, Sequence)
        or len(values) != n_values
        or not all(isinstance(v, Real) and math.isfinite(v) for v in values)
    ):
        raise OptionError(f"{name}: {values!r} is not {n_values} finite numbers")


def check_direction(name: str, values: object) -> None:
    """Raise `OptionError` unless the value is a vector of three finite numbers, not all 0."""
    check_numbers(name, values, 3)
    assert isinstance(values, Sequence)
    if not any(values):
        raise OptionError(f"{name}: {values!r} has no length; give a direction such as 0,0,1")


def check_interval(name: str, values: Sequence[float]) -> None:
    """Raise `OptionError` unless two finite numbers differ by a usable length."""
    length = abs(values[1] - values[0])
    # Below one rounding of its ends, a range has no points between them to tell apart.
    if not (length > 2.0**-52 * max(map(abs, values)) and 1e-300 < length < math.inf):
        raise OptionError(f"{name}: {values!r} is an empty range; give two numbers that differ")
