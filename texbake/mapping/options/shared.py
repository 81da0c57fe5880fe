"""What several option classes share: the size of a texture, vectors, and checks of ranges."""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Real

from texbake.errors import OptionError
from texbake.records import dataclass
from texbake.schema import CheckedOptions, Size, option

Vector = tuple[float, float, float]
Matrix = tuple[tuple[float, float, float, float], ...]


def check_numbers(name: str, values: object, n_values: int) -> None:
    """Raise `OptionError` unless the value is a sequence of this many finite numbers."""
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


MAX_SIZE = 16384  # texels per side: 2^14, so that what a bake counts in stays within its integers


@dataclass(frozen=True, kw_only=True)
class TextureOptions(CheckedOptions):
    """How large a texture is."""

    size: Size = option(
        1024,
        "Width and height of the texture in texels; one number means both.",
        metavar="PX|WxH",
        low=1,
        high=MAX_SIZE,
        unit="texels",
    )

    @property
    def width_px(self) -> int:
        """Texels in a row."""
        return self.size if isinstance(self.size, int) else self.size[0]

    @property
    def height_px(self) -> int:
        """Number of rows."""
        return self.size if isinstance(self.size, int) else self.size[1]
