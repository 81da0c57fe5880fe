"""Checks that the options of mappings share: words of a few, and tuples of finite numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Real

from texbake.errors import OptionError

Vector = tuple[float, float, float]
Matrix = tuple[tuple[float, float, float, float], ...]


class CheckedOptions:
    """Base of options that check themselves; here the chain of checks ends."""

    def __post_init__(self) -> None:
        """Check nothing."""


def check_choice(name: str, value: object, choices: Sequence[str]) -> None:
    """Raise `OptionError` unless the value is one of the words."""
    if value not in choices:
        raise OptionError(f"{name}: {value} is not one of {', '.join(choices)}")


def check_number(name: str, value: object) -> None:
    """Raise `OptionError` unless the value is a finite number."""
    if not (isinstance(value, Real) and math.isfinite(value)):
        raise OptionError(f"{name}: {value!r} is not a finite number")


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


def check_interval(name: str, values: object) -> None:
    """Raise `OptionError` unless the value is two finite numbers whose difference is usable."""
    check_numbers(name, values, 2)
    assert isinstance(values, Sequence)
    length = abs(values[1] - values[0])
    # Below one rounding of its ends, a range has no points between them to tell apart.
    if not (length > 2.0**-52 * max(map(abs, values)) and 1e-300 < length < math.inf):
        raise OptionError(f"{name}: {values!r} is an empty range; give two numbers that differ")
