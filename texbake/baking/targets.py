"""What a user can ask of a bake in place of a setting: an error, or a time."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texbake.errors import OptionError

# An 8-bit code of a normal is off by up to 0.39 degrees; heights are seen by their slope.
DEFAULT_MAX_ERROR = "0.5deg,0.01%"
# Codings of the maps whose errors can be bounded.
BOUNDED_CODINGS = ("normal", "height", "vector")


@dataclass(frozen=True)
class ErrorBounds:
    """How far the values of texels may be off; None where a map's values may be off by anything.

    Attributes
    ----------
    angle : float, optional
        Of normals, in radians.
    length : float, optional
        Of heights and displacement vectors, in model units.
    share : float, optional
        The same, as a share of the diagonal of the light mesh's bounding box.
    """

    angle: float | None = None
    length: float | None = None
    share: float | None = None

    def of_map(self, coding: str, diagonal: float) -> float | None:
        """Bound of a map's values: a chord of unit normals, a length in model units, or None."""
        if coding == "normal":
            return None if self.angle is None else 2.0 * math.sin(min(self.angle, math.pi) / 2.0)
        if coding not in BOUNDED_CODINGS:
            return None
        return self.length if self.share is None else self.share * diagonal

    def scaled(self, factor: float) -> ErrorBounds:
        """Bounds as many times as wide."""
        parts = (self.angle, self.length, self.share)
        return ErrorBounds(*(None if part is None else factor * part for part in parts))

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
    """Bounds of a word such as `0.5deg`, of normals, `0.001` or `0.01%`, of heights, or of both.

    Raises
    ------
    OptionError
        A part is no positive number, or two of them say the same.

    Examples
    --------
    >>> parse_bounds("0.01%").of_map("height", 2.0)
    0.0002
    >>> str(parse_bounds("0.5deg, 0.001"))
    '0.5deg,0.001'
    """
    found: dict[str, float] = {}
    for word in str(text).split(","):
        kind, unit, factor = "length", "", 1.0
        if word.strip().endswith("deg"):
            kind, unit, factor = "angle", "deg", math.pi / 180.0
        elif word.strip().endswith("%"):
            kind, unit, factor = "share", "%", 0.01
        value = _positive(word.strip().removesuffix(unit))
        if value is None:
            raise OptionError(
                f"max-error: {word.strip()!r} is no error; give an angle of normals such as "
                "0.5deg, a length of heights such as 0.001 or 0.01% of the diagonal, or both "
                "with a comma"
            )
        if kind in found or (kind != "angle" and found.keys() & {"length", "share"}):
            raise OptionError(f"max-error: {text!r} says two bounds of one kind; give one")
        found[kind] = value * factor
    return ErrorBounds(**found)


def _positive(word: str) -> float | None:
    try:
        number = float(word)
    except ValueError:
        return None
    return number if 0.0 < number < math.inf else None
