"""Options of writing the mip levels of an image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from texbake.schema import CheckedOptions, Option

MIP_KINDS = ("color", "data", "normal")
MIP_WRAPS = ("repeat", "mirror", "clamp")
MIP_FILTERS = ("box", "kaiser")


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
