"""Durations as people write them: `20s`, `2min`."""

from __future__ import annotations

import math

from texbake.errors import OptionError, quoted

_SECONDS = {"ms": 1e-3, "min": 60.0, "s": 1.0, "h": 3600.0}


def parse_seconds(value: str | float) -> float:
    """Parse `20s`, `500ms`, `2min`, `1h`, or a plain number of seconds.

    Examples
    --------
    >>> parse_seconds("1.5min")
    90.0
    """
    word = str(value).strip()
    unit = next((unit for unit in _SECONDS if word.endswith(unit)), "")
    try:
        number = float(word.removesuffix(unit))
    except ValueError:
        number = math.nan
    if not 0.0 < number < math.inf:
        raise OptionError(
            f"time_budget: {quoted(word)} is not a duration; give one such as 20s or 2min"
        )
    return number * _SECONDS.get(unit, 1.0)
