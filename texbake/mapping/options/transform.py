"""Choices of what happens to (s, t) after any mapping: warps, and the linear map."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from texbake.errors import OptionError
from texbake.mapping.options.checks import CheckedOptions, check_choice, check_number, check_numbers

if TYPE_CHECKING:
    from numpy.typing import NDArray

WARPS = {"twirl": 90.0, "bulge": 0.5, "power": 2.0}  # with their strengths
FLIPS = ("s", "t", "st")

WarpFunction = Callable[["NDArray[Any]"], "NDArray[Any]"]


@dataclass(frozen=True, kw_only=True)
class TransformOptions(CheckedOptions):
    """What happens to coordinates after they have been mapped, in this order.

    Attributes
    ----------
    warp : str, (str, float) or function, optional
        `twirl` turns points about (1/2, 1/2) the more the nearer they are, by so many degrees at
        the middle; `bulge` magnifies the middle by 1 / (1 - strength), negative to pinch; `power`
        takes s and t to a power. A function gets (n, 2) coordinates and returns as many.
    flip : str, optional
        `s`, `t` or `st`: mirror about 1/2.
    rotate : float
        Degrees counter-clockwise about (1/2, 1/2).
    scale : float or (float, float)
        About (0, 0); 2 repeats the texture twice.
    texel_density : float, optional
        Texels a model unit. The coordinates are scaled, alike in both directions, so that the
        whole has this density on average; an atlas is packed at it, into more tiles where allowed.
    offset : (float, float)
        Added last.
    """

    warp: str | tuple[str, float] | WarpFunction | None = None
    flip: str | None = None
    rotate: float = 0.0
    scale: float | tuple[float, float] = 1.0
    texel_density: float | None = None
    offset: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.warp is not None and not callable(self.warp):
            named = (self.warp, 1.0) if isinstance(self.warp, str) else self.warp
            if not isinstance(named, Sequence) or len(named) != 2:
                raise OptionError(f"warp: {self.warp!r} is not a name with its strength")
            name, strength = named
            check_choice("warp", name, tuple(WARPS))
            check_number("warp", strength)
            if name == "bulge" and not -1.25 < strength < 1:
                raise OptionError(f"warp: a bulge of {strength} folds over; above -1.25, below 1")
            if name == "power" and not strength > 0:
                raise OptionError(f"warp: a power of {strength} is not above 0")
        if self.flip is not None:
            check_choice("flip", self.flip, FLIPS)
        check_number("rotate", self.rotate)
        check_numbers("scale", self.scales, 2)
        if not all(self.scales):
            raise OptionError(f"scale: {self.scale} leaves nothing; it must not be 0")
        if self.texel_density is not None and not 0 < self.texel_density < math.inf:
            raise OptionError(f"texel_density: {self.texel_density} must be above 0")
        check_numbers("offset", self.offset, 2)

    @property
    def scales(self) -> tuple[float, float]:
        """Factors of s and t."""
        if isinstance(self.scale, (int, float)):
            return float(self.scale), float(self.scale)
        return self.scale
