"""Options of the rays that start on the high-poly surface: occlusion, bent normals, thickness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from texbake.errors import OptionError, quoted
from texbake.schema import CheckedOptions, Option

MAX_RAYS = 4096


@dataclass(frozen=True, kw_only=True)
class SecondaryOptions(CheckedOptions):
    """How ambient occlusion, bent normals and thickness are sampled.

    Noise falls with about the 3/4th power of the number of rays.
    """

    secondary_rays: Annotated[
        int,
        Option(
            f"Rays per texel for ao, bent-normal and thickness, a power of two up to {MAX_RAYS}. "
            "They are spread over the samples of the texel, at least one for each.",
            metavar="N",
            low=1,
            high=MAX_RAYS,
        ),
    ] = 64
    denoise: Annotated[
        bool,
        Option(
            "Average each texel of ao and thickness with neighbors in its chart that differ by no "
            "more than the noise of their rays, or keep the raw values.",
            flag="--denoise/--no-denoise",
        ),
    ] = True
    occluder_distance: Annotated[
        float | None,
        Option(
            "Distance beyond which surfaces no longer occlude, for ao and bent-normal.",
            metavar="D",
            above=0,
            unit="model units",
            default="unlimited",
        ),
    ] = None
    thickness_distance: Annotated[
        float | None,
        Option(
            "Thickness that becomes white in integer files, and length of the rays that measure "
            "it.",
            metavar="D",
            above=0,
            unit="model units",
            default="the greatest of the map",
        ),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        n = self.secondary_rays
        if n & (n - 1) != 0:
            raise OptionError(
                f"secondary_rays: {quoted(n)} is not a power of two; use 64, or 256 for less noise"
            )
