"""Format figures for readers: numbers with three digits, times and sizes with their units."""

from __future__ import annotations

import math

from texbake.core import portable_math as pm


def number(x: float) -> str:
    """Format a number with three digits, without an exponent unless it is very small or large.

    Examples
    --------
    >>> [number(x) for x in (0.0, 0.123456, 12.3456, 1234.6, 0.0000123, float("nan"))]
    ['0', '0.123', '12.3', '1,235', '1.2e-05', '–']
    """
    if not math.isfinite(x):
        return "–"
    if x == 0.0:
        return "0"
    size = abs(x)
    if size < 1e-4:
        return f"{x:.1e}"
    if size >= 1000.0:
        return f"{x:,.0f}"
    digits = max(2 - math.floor(pm.log10(size)), 0)
    text = f"{x:.{digits}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def duration(seconds: float) -> str:
    """Format a time with a suitable unit: `1.2 ms`, `3.4 s`, `13.5 min`, `2.1 h`."""
    if seconds < 1.0:
        return f"{number(1000.0 * seconds)} ms"
    if seconds < 120.0:
        return f"{number(seconds)} s"
    return f"{number(seconds / 60.0)} min" if seconds < 7200.0 else f"{number(seconds / 3600.0)} h"


def memory(n_bytes: int | None) -> str:
    """Format a number of bytes in MB or GB."""
    if n_bytes is None:
        return "–"
    return f"{number(n_bytes / 1e9)} GB" if n_bytes >= 1e9 else f"{number(n_bytes / 1e6)} MB"
