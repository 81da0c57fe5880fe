"""Every option of turning heights into normals and normals into heights, with its default."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from texbake.schema import CheckedOptions, Option

DERIVATIVES = ("central", "sobel", "scharr")
METHODS = ("frankot-chellappa", "poisson")
WRAPS = ("repeat", "clamp")
CONVENTIONS = ("opengl", "directx")
DEFAULT_SCALE = 0.05  # of heights whose file has none, in widths of the image


_WIDTH = Option(
    "Width of the image in the unit of its heights; texels are square.", metavar="W", above=0
)
_WRAP = Option("Treat the image as tiling (repeat), or as ending at its border.", choices=WRAPS)


@dataclass(frozen=True, kw_only=True)
class HeightToNormalOptions(CheckedOptions):
    """How `height_to_normal` measures the slopes of heights.

    With `wrap="clamp"` derivatives at the border are one-sided. Of the 3 x 3 differences, scharr's
    depend least on the direction of a slope.
    """

    scale: Annotated[
        float | None,
        Option(
            "Difference in height between values 0 and 1, in the unit of the width.",
            metavar="S",
            default=f"what the file says, else {DEFAULT_SCALE:g}",
        ),
    ] = None
    width: Annotated[float, _WIDTH] = 1.0
    wrap: Annotated[str, _WRAP] = "repeat"
    derivative: Annotated[
        str,
        Option(
            "Take differences of two texels (central), or average them over three rows against "
            "noise (sobel, scharr).",
            choices=DERIVATIVES,
        ),
    ] = "central"


@dataclass(frozen=True, kw_only=True)
class NormalToHeightOptions(CheckedOptions):
    """How `normal_to_height` integrates slopes.

    `frankot-chellappa` is exact for smooth maps that tile, and `poisson` for surfaces of even
    curvature. Slopes that are left over reveal a wrong convention.
    """

    method: Annotated[
        str,
        Option(
            "Fit the steps from texel to texel (poisson), or a sum of waves that tile "
            "(frankot-chellappa).",
            choices=METHODS,
        ),
    ] = "poisson"
    wrap: Annotated[str, _WRAP] = "repeat"
    width: Annotated[float, _WIDTH] = 1.0
    convention: Annotated[
        str | None,
        Option(
            "Green channel of the normal map: +Y up (opengl) or +Y down (directx).",
            choices=CONVENTIONS,
            default="what the file says, else opengl",
        ),
    ] = None
