"""Every choice of a check, with its default, written once for the API and the command line."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texbake.baking.options import BakeOptions
from texbake.errors import OptionError
from texbake.mapping.options.texture import MAX_SIZE, TextureOptions

# The worst first.
SEVERITIES = ("error", "warning", "note")


@dataclass(frozen=True, kw_only=True)
class CheckOptions(TextureOptions):
    """The bake that a check is made for.

    Attributes
    ----------
    size : int or (int, int)
        Texels a side of the maps, or (width, height).
    padding : int
        Texels around each chart that the bake fills.
    min_texel_density : float, optional
        Texels a model unit that every face must get along its most stretched direction. None: a
        quarter of the mean of the mesh.
    threads : int, optional
        None: every processor.
    """

    padding: int = BakeOptions.padding
    min_texel_density: float | None = None
    threads: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (isinstance(self.padding, int) and 0 <= self.padding < MAX_SIZE):
            raise OptionError(
                f"padding: {self.padding} is out of range; it must be 0 to {MAX_SIZE - 1} texels"
            )
        density = self.min_texel_density
        if density is not None and not 0 < density < math.inf:
            raise OptionError(
                f"min_texel_density: {density} is no density; it must be above 0 texels a unit"
            )
        if self.threads is not None and self.threads < 1:
            raise OptionError(f"threads: {self.threads} is too few; it must be at least 1")
