"""Options of texture bakes: solid procedures, and photographs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field
from typing import Annotated, Any

from texbake.baking.options import FILLS, PADDING_OPTION, SAMPLES
from texbake.errors import OptionError
from texbake.mapping.options import DEFAULT_PADDING
from texbake.mapping.options.shared import TextureOptions
from texbake.records import dataclass
from texbake.schema import THREADS_OPTION, Option, option
from texbake.texture.procedures.options import PROCEDURE_NAMES, checked_parameters

Rgb = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class TextureBakeOptions(TextureOptions):
    """Options of every texture bake."""

    samples: int = option(4, "Samples per texel, averaged.", choices=SAMPLES)
    padding: Annotated[int, PADDING_OPTION] = DEFAULT_PADDING
    fill: str = option(
        "push-pull",
        "Fill texels without a color of their own smoothly with the colors around them "
        "(push-pull), or leave them black (none).",
        choices=FILLS,
    )
    threads: Annotated[int | None, THREADS_OPTION] = None


@dataclass(frozen=True, kw_only=True)
class SolidOptions(TextureBakeOptions):
    """How `bake_solid` evaluates a procedure over the surface.

    Without a `scale` the longest side of the mesh's bounding box becomes 2 long, so that every
    model has as much detail as a sphere of radius 1; `gradient` and `radial` measure in model
    units. Colors are linear.
    """

    procedure: str = option(
        "marble",
        f"Procedure to evaluate at the points of the mesh: {', '.join(PROCEDURE_NAMES)}.",
        metavar="NAME",
        choices=PROCEDURE_NAMES,
    )
    parameters: Annotated[
        Mapping[str, Any], Option("Parameters of the procedure.", default="the procedure's own")
    ] = field(default_factory=dict)
    scale: float | tuple[float, float, float] | None = option(
        None,
        "Factor that positions are multiplied by.",
        metavar="S[,SY,SZ]",
        default="2 / the longest side of the mesh",
    )
    volume: tuple[str, ...] = option(
        (),
        "A .npy file of a volume to look up instead, or the image of each slice; it fills the "
        "bounding cube of the mesh.",
        metavar="FILE",
        many=True,
    )
    colors: tuple[Rgb, ...] | None = option(
        None,
        "Colors of a ramp from value 0 to value 1, evenly spaced.",
        metavar="#RRGGBB,...",
        default="the procedure's own",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_parameters(self.procedure, self.parameters)
        if self.scale == 0.0:
            raise OptionError("scale: 0 leaves nothing; give another number, or three")
        if self.colors is not None and not (
            self.colors
            and all(len(color) == 3 and all(map(math.isfinite, color)) for color in self.colors)
        ):
            raise OptionError("colors: a ramp needs at least one color of three finite numbers")


@dataclass(frozen=True, kw_only=True)
class PhotoOptions(TextureBakeOptions):
    """How `bake_photos` projects and blends photographs.

    The weight of a photograph falls from 1, where the surface faces the camera, to 0 at
    `max_angle`, by the power `falloff`; a power of 0 weights everything seen alike.
    """

    max_angle: float = option(
        80.0,
        "Angle between normal and view at which the weight of a photograph reaches 0.",
        metavar="DEG",
        above=0,
        high=90,
        unit="degrees",
    )
    falloff: float = option(
        2.0,
        "Power by which the weight of a photograph falls up to that angle.",
        metavar="P",
        low=0,
        high=64,
    )
    feather: float = option(
        0.05,
        "Share of the width and height of a photograph over which its weight falls to 0 at "
        "the border.",
        metavar="SHARE",
        low=0,
        high=0.5,
    )
    occlusion: bool = option(
        True,
        "Leave out what other parts of the mesh hide from the camera.",
        flag="--occlusion/--no-occlusion",
    )
    margin: float = option(
        1.0,
        "Width of the margin around occluders that is left out as well, in pixels.",
        metavar="PX",
        low=0,
        high=64,
        unit="pixels",
    )
