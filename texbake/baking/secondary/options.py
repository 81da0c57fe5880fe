"""Choices of the rays that start on the dense surface, without loading what casts them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texbake.errors import OptionError
from texbake.mapping.options.checks import CheckedOptions

MAX_RAYS = 4096


@dataclass(frozen=True, kw_only=True)
class SecondaryOptions(CheckedOptions):
    """How ambient occlusion, bent normals and thickness look around.

    Attributes
    ----------
    secondary_rays : int
        Rays from each sample, a power of two up to 4096; the noise falls with about the 3/4th power
        of it.
    occluder_distance : float, optional
        How far a surface hides what lies behind it, in model units. None: however far it is.
    thickness_distance : float, optional
        Thickness that is white in integer files, and as far as rays go into the surface, in model
        units. None: white is the greatest of the map, and rays go as far as the dense mesh's
        diagonal.
    """

    secondary_rays: int = 64
    occluder_distance: float | None = None
    thickness_distance: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        n = self.secondary_rays
        if not (isinstance(n, int) and 1 <= n <= MAX_RAYS and n & (n - 1) == 0):
            raise OptionError(
                f"secondary_rays: {n!r} is not a power of two from 1 to {MAX_RAYS}; "
                "take 64, or 256 for less noise"
            )
        for name in "occluder_distance", "thickness_distance":
            distance = getattr(self, name)
            if distance is not None and not (distance > 0 and math.isfinite(distance)):
                raise OptionError(f"{name}: {distance} is no distance; it must be greater than 0")
