"""Bounds on errors (`0.5deg,0.01%` for maps, `2/255` for pictures), and what samples achieved.

The error of a picture is counted in steps of the sRGB-coded picture. Colors are coded as a file
holds them, from 0 to 1, and clipped, so that light brighter than white is no error. The error of a
pixel is that of its worst channel. Without a background the color counts as over black, and the
opacity is a channel of its own.

Some texels or pixels are sampled again, to see whether the estimated errors can be trusted. They
are drawn at random, but the same ones each time. Their second samples are several times as many as
most of them had, and lie elsewhere. The mean over these has an error of its own.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from texbake.errors import OptionError, quoted
from texbake.mesh.mesh import AnyArray
from texbake.records import dataclass

# 8-bit normals are off by up to 0.39 degrees; errors of heights show as slopes.
DEFAULT_MAX_ERROR = "0.5deg,0.01%"
# Codings of the maps whose errors can be bounded.
BOUNDED_CODINGS = ("normal", "height", "vector")
CODES = 255  # steps from black to white in which the errors of pictures are counted


def _chord(angle: float) -> float:
    from texbake.core.portable_math import sin  # imported here, because options load no NumPy

    return 2.0 * sin(min(angle, math.pi) / 2.0)


@dataclass(frozen=True)
class ErrorBounds:
    """How far the values of texels may be off; None where they are not bounded."""

    angle: float | None = None  # bound of normals, in radians
    length: float | None = None  # bound of heights and displacement vectors, in model units
    # The same, as a share of the diagonal of the low-poly mesh's bounding box.
    share: float | None = None

    def of_map(self, coding: str, diagonal: float) -> float | None:
        """Return the bound of a map: a chord of unit normals, a length in model units, or None."""
        if coding == "normal":
            return None if self.angle is None else _chord(self.angle)
        if coding not in BOUNDED_CODINGS:
            return None
        return self.length if self.share is None else self.share * diagonal

    def scaled(self, factor: float) -> ErrorBounds:
        """Return bounds that are `factor` times as wide; an angle is at most 180 degrees."""
        angle, *lengths = (
            None if part is None else factor * part
            for part in (self.angle, self.length, self.share)
        )
        return ErrorBounds(None if angle is None else min(angle, math.pi), *lengths)

    def __str__(self) -> str:
        words = []
        if self.angle is not None:
            words.append(f"{math.degrees(self.angle):.4g}deg")
        if self.length is not None:
            words.append(f"{self.length:.4g}")
        if self.share is not None:
            words.append(f"{100.0 * self.share:.4g}%")
        return ",".join(words)


def parse_bounds(text: str) -> ErrorBounds:
    """Read bounds such as `0.5deg` for normals, `0.001` or `0.01%` for heights, or `0.5deg,0.01%`.

    >>> parse_bounds("0.01%").of_map("height", 2.0)
    0.0002
    >>> str(parse_bounds("0.5deg, 0.001"))
    '0.5deg,0.001'
    """
    parts: dict[str, float] = {}
    for word in str(text).split(","):
        kind, unit, factor = "length", "", 1.0
        if word.strip().endswith("deg"):
            kind, unit, factor = "angle", "deg", math.pi / 180.0
        elif word.strip().endswith("%"):
            kind, unit, factor = "share", "%", 0.01
        value = _positive(word.strip().removesuffix(unit))
        if value is None:
            raise OptionError(
                f"max_error: {quoted(word.strip())} is not an error; give an angle for normals "
                "such as 0.5deg, a length for heights such as 0.001 or 0.01% of the diagonal, or "
                "both separated by a comma"
            )
        if kind in parts or (kind != "angle" and parts.keys() & {"length", "share"}):
            raise OptionError(f"max_error: {quoted(text)} has two bounds of one kind; give one")
        parts[kind] = value * factor
    return ErrorBounds(**parts)


def _positive(word: str) -> float | None:
    try:
        number = float(word)
    except ValueError:
        return None
    return number if 0.0 < number < math.inf else None


def parse_picture_bound(value: str | float) -> float:
    """Read a bound such as `2/255` or `0.01`, where black to white is 1.

    >>> parse_picture_bound("51/255"), parse_picture_bound(0.01)
    (0.2, 0.01)
    """
    above, slash, below = str(value).partition("/")
    try:
        error = float(above) / (float(below) if slash else 1.0)
    except (ValueError, ZeroDivisionError):
        error = 0.0
    if not 0.0 < error < 1.0:
        raise OptionError(
            f"max_error: {quoted(value)} is not an error of a picture; give a share of white such "
            "as 2/255 or 0.01"
        )
    return error


def format_codes(error: float) -> str:
    """Write an error of a picture as a fraction of 255 steps.

    >>> format_codes(0.01), format_codes(1 / 255)
    ('2.55/255', '1/255')
    """
    return f"{CODES * error:.3g}/{CODES}"


CHECKED_SHARE = 0.01  # of the texels or pixels that have data
MOST_CHECKED = 2000  # standard error of a share of so many: 0.2 % at 1 %, 1.1 % at 50 %
_SEED = 5
_PERCENTILES = (50, 99, 100)
_REPORTED_PERCENT = 1.0  # fewer texels or pixels above the bound are not warned of


def check_random() -> np.random.Generator:
    """Return the random numbers of a check."""
    return np.random.default_rng(_SEED)


def n_to_check(n: int) -> int:
    """Return how many out of `n` texels or pixels are sampled again."""
    return min(int(np.ceil(CHECKED_SHARE * n)), MOST_CHECKED)


@dataclass(frozen=True)
class ErrorSummary:
    """Errors of one map, or of a picture."""

    name: str  # name of the map
    unit: str  # unit of the errors
    bound: float | None  # what the errors were to be within; None if they were not bounded
    # Percentages of all texels or pixels, and the estimated error that they do not exceed.
    estimated: dict[int, float]
    # The same for those that were sampled again, by the difference to these other samples.
    measured: dict[int, float]
    measured_within_percent: float  # how many of the latter are within the bound

    def row(self, n_checked: int, element: str) -> tuple[str, str]:
        """Return a label and the figures, for a person."""
        within = ""
        if self.bound is not None:
            within = f", {self.measured_within_percent:.2f} % of them within {self.bound:.4g}"
        return (
            f"error of {self.name}",
            f"estimated {_format_percentiles(self.estimated)} {self.unit}, "
            f"checked on {n_checked:,} {element}s {_format_percentiles(self.measured)}{within}",
        )


def percentiles_of(errors: AnyArray, factor: float = 1.0) -> dict[int, float]:
    """Return percentages, and the errors, times a factor, that they do not exceed; {} for none."""
    if not len(errors):
        return {}
    values = factor * np.percentile(errors, _PERCENTILES)
    return {percent: float(v) for percent, v in zip(_PERCENTILES, values, strict=True)}


def percent_within(errors: AnyArray, bound: float | None) -> float:
    """Return how many errors are within a bound; 100 if there is no error or no bound."""
    if bound is None or not len(errors):
        return 100.0
    return 100.0 * int(np.count_nonzero(errors <= bound)) / len(errors)


@dataclass(frozen=True, kw_only=True)
class SamplingReport:
    """What adaptive samples achieved; percentages are of the texels or pixels that have data."""

    # as given, or the default; None where a time budget left no time for any bound
    max_error: str | None
    # number of samples in a texel or pixel, and the percentage of them that have it
    sample_percents: dict[int, float]
    within_percent: float  # how many have an estimated error within every bound
    n_checked: int  # how many were sampled again, and with how many other samples each
    samples_of_check: int
    errors: tuple[ErrorSummary, ...]  # of each map that has a bound, or of the picture

    # What is sampled, and the most samples that one of it gets.
    element: ClassVar[str]
    most_samples: ClassVar[int]

    @property
    def warnings(self) -> list[str]:
        """One, if the most samples were too few for many texels or pixels."""
        if self.max_error is None or self.within_percent >= 100.0 - _REPORTED_PERCENT:
            return []
        return [
            f"{100.0 - self.within_percent:.2f} % of the {self.element}s are estimated to be off "
            f"by more than {self.max_error} with {self.most_samples} samples; raise the size, or "
            "accept a greater error"
        ]

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, for a person."""
        return [item.row(self.n_checked, self.element) for item in self.errors]


def format_percents(percents: dict[int, float]) -> str:
    """Write percents as `1: 93.0 %, 4: 7.0 %`."""
    return ", ".join(f"{n}: {percent:.1f} %" for n, percent in percents.items())


def _format_percentiles(percentiles: dict[int, float]) -> str:
    if not percentiles:
        return "nothing"
    return " / ".join(f"{value:.3g}" for value in percentiles.values()) + " (median, p99, greatest)"
