"""Choices of an atlas: how its charts are made, and how they are packed."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texbake.errors import OptionError
from texbake.mapping.options.checks import check_choice
from texbake.mapping.options.texture import TextureOptions

QUALITIES = ("fast", "good", "best")
MAX_TILES = 100  # UDIM 1001 to 1100


@dataclass(frozen=True, kw_only=True)
class AtlasOptions(TextureOptions):
    """How charts are made and packed.

    Attributes
    ----------
    padding : int
        Texels that a bake may pad each chart by: no texel lies within `padding` of two charts, and
        none that a chart touches within `padding` of the border.
    quality : str
        `fast`: the mesh is divided into parts that are laid flat and packed as they are. `good`:
        parts are halved until they are hardly stretched, and joined again where that costs none.
        `best`: charts may stretch more, so that there are fewer, and more packings are tried.
    max_stretch : float, optional
        Most L2 stretch that a chart may have, above 1; charts above it are cut further. None: no
        such bound.
    timeout : float, optional
        Seconds after which xatlas, which cuts what cannot be laid flat, is given up on a part; that
        is cut by its normals then. None: a minute and 10 ms a face.
    tiles : int
        Textures that the charts are spread over, side by side as UDIM tiles: 1001 is the unit
        square, 1002 the one to its right, 1011 the one above.
    by_group : bool
        Give each group of faces tiles of its own; no chart crosses from group to group, and all
        have the same texel density.
    """

    padding: int = 4
    quality: str = "good"
    max_stretch: float | None = None
    timeout: float | None = None
    tiles: int = 1
    by_group: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        check_choice("quality", self.quality, QUALITIES)
        if self.padding < 0:
            raise OptionError(f"padding: {self.padding} is negative; it must be 0 or more texels")
        if 2 * self.padding >= min(self.width_px, self.height_px):
            raise OptionError(
                f"padding: {self.padding} texels at both borders leave nothing of "
                f"{self.width_px} x {self.height_px}; take less padding or a larger size"
            )
        if self.max_stretch is not None and not 1 < self.max_stretch < math.inf:
            raise OptionError(f"max_stretch: {self.max_stretch} must be above 1, such as 1.1")
        if self.timeout is not None and not (self.timeout > 0 and math.isfinite(self.timeout)):
            raise OptionError(f"timeout: {self.timeout} is no length of time; it must be above 0")
        if not isinstance(self.tiles, int) or not 1 <= self.tiles <= MAX_TILES:
            raise OptionError(f"tiles: {self.tiles} is out of range; it must be 1 to {MAX_TILES}")
