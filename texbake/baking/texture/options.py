"""Every choice of a texture bake, with its default: once for the API and the command line."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from texbake.baking.options import BakeOptions
from texbake.errors import OptionError
from texbake.mapping.options.atlas import AtlasOptions
from texbake.mapping.options.texture import TextureOptions
from texbake.texture.procedures.options import checked_parameters

Rgb = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class TextureBakeOptions(TextureOptions):
    """What every texture bake does where the caller does not say otherwise.

    Attributes
    ----------
    samples : int
        Samples a texel, averaged: 1, 4, 16 or 64.
    padding : int
        Texels around each chart filled from the nearest texel of the chart.
    fill : str
        What fills the rest, and texels of charts without a color of their own: `push-pull`, a
        smooth continuation of what lies around them in the texture, or `none`, black.
    threads : int, optional
        None: every processor.
    """

    samples: int = 4
    padding: int = AtlasOptions.padding
    fill: str = "push-pull"
    threads: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.for_bake  # checks them

    @property
    def for_bake(self) -> BakeOptions:
        """These choices as those of a bake, which has them as well."""
        return BakeOptions(
            size=self.size,
            samples=self.samples,
            padding=self.padding,
            fill=self.fill,
            threads=self.threads,
        )


@dataclass(frozen=True, kw_only=True)
class SolidOptions(TextureBakeOptions):
    """What `bake_solid` does where the caller does not say otherwise.

    Attributes
    ----------
    procedure : str
        One of `texbake.texture.procedures.options.PROCEDURE_NAMES`.
    parameters : mapping
        What the procedure takes beyond its point; defaults stand for what is left out.
    scale : float or (x, y, z), optional
        Positions of the mesh are multiplied by it. None: as much as makes the longest side of its
        bounding box 2 long, so that every model has as much detail as a sphere of radius 1.
    colors : tuple of (r, g, b), optional
        Linear colors of a ramp from value 0 to value 1, evenly spaced. None: the procedure's own.
    """

    procedure: str = "marble"
    parameters: Mapping[str, Any] = field(default_factory=dict)
    scale: float | tuple[float, float, float] | None = None
    colors: tuple[Rgb, ...] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_parameters(self.procedure, self.parameters)
        scale = self.scale if isinstance(self.scale, tuple) else (self.scale or 1.0,) * 3
        if self.scale == 0.0 or len(scale) != 3 or not all(map(math.isfinite, scale)):
            raise OptionError(f"scale: {self.scale} is neither a number but 0 nor three numbers")
        if self.colors is not None and not (
            self.colors
            and all(len(color) == 3 and all(map(math.isfinite, color)) for color in self.colors)
        ):
            raise OptionError("colors: a ramp needs at least one color of three finite numbers")


@dataclass(frozen=True, kw_only=True)
class PhotoOptions(TextureBakeOptions):
    """What `bake_photos` does where the caller does not say otherwise.

    Attributes
    ----------
    max_angle : float
        Degrees between the surface's normal and the direction to a projector from which on its
        photograph counts nothing; above 0 and at most 90.
    falloff : float
        Power of how fast its weight falls from 1, seen straight on, to 0 at `max_angle`; 0: all
        that is seen counts alike.
    feather : float
        Share of the width and height of a photograph over which its weight falls to 0 towards its
        border; 0 to 0.5.
    occlusion : bool
        Leave out what other parts of the mesh hide from a projector.
    margin : float
        Pixels of a photograph about the outline of what stands before others, within which those
        are taken for hidden too; 0 to 64.
    """

    max_angle: float = 80.0
    falloff: float = 2.0
    feather: float = 0.05
    occlusion: bool = True
    margin: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.max_angle <= 90.0:
            raise OptionError(f"max-angle: {self.max_angle} degrees are not above 0 and at most 90")
        if not 0.0 <= self.falloff <= 64.0:
            raise OptionError(f"falloff: {self.falloff} is out of range; it must be 0 to 64")
        if not 0.0 <= self.feather <= 0.5:
            raise OptionError(f"feather: {self.feather} is out of range; it must be 0 to 0.5")
        if not 0.0 <= self.margin <= 64.0:
            raise OptionError(f"margin: {self.margin} pixels are out of range; it must be 0 to 64")
