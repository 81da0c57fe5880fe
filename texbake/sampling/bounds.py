"""Bounds on errors as a user writes them: `0.5deg,0.01%` for maps, `2/255` for pictures.

The error of a picture is counted in steps of the sRGB-coded picture. Colors are coded as a file
holds them, from 0 to 1, and clipped, so that light brighter than white is no error. The error of a
pixel is that of its worst channel. Without a background the color counts as over black, and the
opacity is a channel of its own.
"""

from __future__ import annotations

import math

from texbake.errors import OptionError, quoted
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
