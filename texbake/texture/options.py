"""Every option of writing mip levels and of packing textures, with its default."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from texbake.mapping.options.texture import MAX_SIZE, Size
from texbake.schema import CheckedOptions, Option

MIP_KINDS = ("color", "data", "normal")
MIP_WRAPS = ("repeat", "mirror", "clamp")
MIP_FILTERS = ("box", "kaiser")
EDGES = ("clamp", "repeat")


@dataclass(frozen=True, kw_only=True)
class MipOptions(CheckedOptions):
    """How the mip levels of an image are made."""

    kind: Annotated[
        str,
        Option(
            "Average sRGB colors in linear light (color), values as they are (data), or unit "
            "vectors (normal).",
            choices=MIP_KINDS,
        ),
    ] = "color"
    wrap: Annotated[
        str,
        Option("Repeat, mirror or clamp the image beyond its borders.", choices=MIP_WRAPS),
    ] = "repeat"
    filter: Annotated[
        str,
        Option(
            "Average the area of a texel (box), or keep distant detail sharper with a windowed "
            "sinc (kaiser).",
            choices=MIP_FILTERS,
        ),
    ] = "box"


@dataclass(frozen=True, kw_only=True)
class PackOptions(CheckedOptions):
    """How `pack_textures` puts several images into one."""

    size: Annotated[
        Size | None,
        Option(
            "If the images do not fit, all are scaled down by one factor. Width and height of the "
            "packed image.",
            metavar="PX|WxH",
            low=1,
            high=MAX_SIZE,
            unit="texels",
            default="the least powers of two that hold all images at full size",
        ),
    ] = None
    padding: Annotated[
        int,
        Option(
            "Width of the padding around each image.",
            metavar="PX",
            low=0,
            high=MAX_SIZE // 2 - 1,
            unit="texels",
        ),
    ] = 4
    edges: Annotated[
        str,
        Option(
            "Fill the padding with the nearest texels (clamp), or with the opposite side of an "
            "image that tiles (repeat).",
            choices=EDGES,
        ),
    ] = "clamp"

    @property
    def sides(self) -> tuple[int, int] | None:
        """Width and height, or None."""
        return (self.size, self.size) if isinstance(self.size, int) else self.size
