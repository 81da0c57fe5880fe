"""How large a texture is; what unwraps for one and what bakes one agree on it."""

from __future__ import annotations

from dataclasses import dataclass

from texbake.errors import OptionError
from texbake.mapping.options.checks import CheckedOptions

MAX_SIZE = 16384  # texels a side: 2^14, so that what a bake counts in stays within its integers


@dataclass(frozen=True, kw_only=True)
class TextureOptions(CheckedOptions):
    """How large a texture is.

    Attributes
    ----------
    size : int or (int, int)
        Texels a side, or (width, height).
    """

    size: int | tuple[int, int] = 1024

    def __post_init__(self) -> None:
        super().__post_init__()
        sides = self.size if isinstance(self.size, tuple) else (self.size, self.size)
        if len(sides) != 2 or not all(isinstance(side, int) for side in sides):
            raise OptionError(f"size: {self.size!r} is neither a number nor (width, height)")
        for length in sides:
            if not 1 <= length <= MAX_SIZE:
                raise OptionError(f"size: {length} is out of range; it must be 1 to {MAX_SIZE}")

    @property
    def width_px(self) -> int:
        """Texels in a row."""
        return self.size if isinstance(self.size, int) else self.size[0]

    @property
    def height_px(self) -> int:
        """Number of rows."""
        return self.size if isinstance(self.size, int) else self.size[1]
