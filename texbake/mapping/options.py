"""Every choice of an unwrap, with its default, written once for the API and the command line."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texbake.errors import OptionError

METHODS = ("atlas",)
MAX_SIZE = 16384  # texels a side: 2^14, so that what a bake counts in stays within its integers


@dataclass(frozen=True, kw_only=True)
class TextureOptions:
    """How large a texture is; what unwraps for one and what bakes one agree on it.

    Attributes
    ----------
    size : int or (int, int)
        Texels a side, or (width, height).
    """

    size: int | tuple[int, int] = 1024

    def __post_init__(self) -> None:
        sides = self.size if isinstance(self.size, tuple) else (self.size, self.size)
        if len(sides) != 2 or not all(isinstance(side, int) for side in sides):
            raise OptionError(f"size: {self.size!r} is neither a number nor (width, height)")
        for length in sides:
            if not 1 <= length <= MAX_SIZE:
                raise OptionError(f"size: {length} is out of range; it must be 1 to {MAX_SIZE}")

    @property
    def width(self) -> int:
        """Texels in a row."""
        return self.size if isinstance(self.size, int) else self.size[0]

    @property
    def height(self) -> int:
        """Number of rows."""
        return self.size if isinstance(self.size, int) else self.size[1]


@dataclass(frozen=True, kw_only=True)
class UnwrapOptions(TextureOptions):
    """What `unwrap` does where the caller does not say otherwise.

    Attributes
    ----------
    method : str
        `atlas`: charts cut by xatlas, packed into one square or rectangle.
    size : int or (int, int)
        Texels a side of the texture that the coordinates are for, or (width, height).
    padding : int
        Texels that a bake may pad each chart by: no texel lies within `padding` of two charts, and
        none that a chart touches within `padding` of the border.
    timeout : float, optional
        Seconds after which the cutting of charts is given up. None: a minute and as long again as
        a mesh of that many faces should ever need.
    """

    method: str = "atlas"
    padding: int = 4
    timeout: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.method not in METHODS:
            raise OptionError(f"method: {self.method} is not one of {', '.join(METHODS)}")
        if self.padding < 0:
            raise OptionError(f"padding: {self.padding} is negative; it must be 0 or more texels")
        if 2 * self.padding >= min(self.width, self.height):
            raise OptionError(
                f"padding: {self.padding} texels at both borders leave nothing of "
                f"{self.width} x {self.height}; take less padding or a larger size"
            )
        if self.timeout is not None and not (self.timeout > 0 and math.isfinite(self.timeout)):
            raise OptionError(f"timeout: {self.timeout} is no length of time; it must be above 0")
