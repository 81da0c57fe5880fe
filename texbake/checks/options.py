"""Every option of a check, with its default."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from texbake.baking.options import PADDING_OPTION, THREADS_OPTION, BakeOptions
from texbake.mapping.options.texture import TextureOptions
from texbake.schema import Option

# The worst first.
SEVERITIES = ("error", "warning", "note")


@dataclass(frozen=True, kw_only=True)
class CheckOptions(TextureOptions):
    """The bake that a check is made for."""

    padding: Annotated[int, PADDING_OPTION] = BakeOptions.padding
    min_texel_density: Annotated[
        float | None,
        Option(
            "Texels per model unit that every face must have in its most stretched direction.",
            metavar="D",
            above=0,
            unit="texels per model unit",
            default="a quarter of the mesh's mean",
        ),
    ] = None
    threads: Annotated[int | None, THREADS_OPTION] = None
