"""How large a texture is; what unwraps for one and what bakes one agree on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from texbake.schema import CheckedOptions, Option

MAX_SIZE = 16384  # texels per side: 2^14, so that what a bake counts in stays within its integers

Size = int | tuple[int, int]


@dataclass(frozen=True, kw_only=True)
class TextureOptions(CheckedOptions):
    """How large a texture is."""

    size: Annotated[
        Size,
        Option(
            "Width and height of the texture in texels; one number means both.",
            metavar="PX|WxH",
            low=1,
            high=MAX_SIZE,
            unit="texels",
        ),
    ] = 1024

    @property
    def width_px(self) -> int:
        """Texels in a row."""
        return self.size if isinstance(self.size, int) else self.size[0]

    @property
    def height_px(self) -> int:
        """Number of rows."""
        return self.size if isinstance(self.size, int) else self.size[1]
