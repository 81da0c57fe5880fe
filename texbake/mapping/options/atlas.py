"""Choices of an atlas: how its charts are made, and how they are packed."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texbake.errors import OptionError
from texbake.mapping.options.shared import TextureOptions
from texbake.schema import option

QUALITIES = ("fast", "good", "best")
CHART_CUTTERS = ("texbake", "xatlas")
MAX_TILES = 100  # UDIM 1001 to 1100


DEFAULT_PADDING = 4
# The padding that survives three mip levels, and its greatest share of the side of a chart.
MOST_PADDING, _SHARE = 8, 1 / 16
PADDING_DEFAULT = f"{MOST_PADDING}, or less if there are many charts"


def fitting_padding(size: tuple[int, int], n_charts: int) -> int:
    """Return the padding that takes at most a sixteenth of the side of an average chart, 1 to 8.

    >>> fitting_padding((1024, 1024), 40), fitting_padding((1024, 1024), 863)
    (8, 2)
    """
    side = math.sqrt(size[0] * size[1] / max(n_charts, 1))
    return max(1, min(MOST_PADDING, int(_SHARE * side)))


@dataclass(frozen=True, kw_only=True)
class AtlasOptions(TextureOptions):
    """How charts are made and packed.

    `fast` divides the mesh into parts that are flattened and packed as they are. `good` splits
    parts until they have little stretch, and joins them again where that costs none. `best` allows
    charts more stretch, so that there are fewer, and tries more packings.

    With `padding`, no texel lies within that distance of two charts, and none that a chart touches
    lies within it of the border: a bake may pad each chart by as much. None uses
    `fitting_padding`. With several `tiles`, tile 1001 is the unit square, 1002 the one to its
    right, 1011 the one above.
    """

    padding: int | None = option(
        DEFAULT_PADDING,
        "Room left around each chart for the padding of a bake.",
        metavar="PX",
        low=0,
        unit="texels",
    )
    quality: str = option(
        "good",
        "Trade time for quality: fast for large scans, good for charts with little stretch, "
        "best for fewer charts and tighter packing.",
        choices=QUALITIES,
    )
    max_stretch: float | None = option(
        None,
        "Cut charts until none has more L2 stretch than this, such as 1.1.",
        metavar="L2",
        above=1,
        default="no limit",
    )
    seams_at_hard_edges: bool = option(
        False, "Cut charts at hard edges, where the normals of the mesh jump."
    )
    seam_angle: float | None = option(
        None,
        "Cut charts at edges where faces meet at more than this angle.",
        metavar="DEG",
        above=0,
        below=180,
        unit="degrees",
        default="wherever the stretch calls for it",
    )
    charts: str = option(
        "texbake",
        "What cuts charts: texbake, or the library xatlas in separate processes.",
        choices=CHART_CUTTERS,
    )
    timeout: float | None = option(
        None,
        "Seconds after which xatlas is stopped on a part, which is then cut by its normals.",
        metavar="SECONDS",
        above=0,
        unit="seconds",
        default="60 s and 10 ms per face",
    )
    tiles: int = option(
        1,
        "Number of UDIM tiles that the charts are spread over.",
        metavar="N",
        low=1,
        high=MAX_TILES,
    )
    by_group: bool = option(
        False, "Give each group of faces its own tiles, all with the same texel density."
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if 2 * (self.padding or 0) >= min(self.width_px, self.height_px):
            raise OptionError(
                f"padding: {self.padding} texels at both borders leave no room in "
                f"{self.width_px} x {self.height_px}; use less padding or a larger size"
            )
        if self.timeout is not None and self.charts != "xatlas":
            raise OptionError("timeout: it is for xatlas; leave it out, or use charts xatlas")
