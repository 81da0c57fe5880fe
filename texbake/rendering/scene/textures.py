"""The contents of a material's slot: a constant, an image or a procedure.

These classes only describe textures, as in a scene file. Images are read and procedures evaluated
when the plan of a picture needs them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from texbake.errors import OptionError
from texbake.files import PathLike
from texbake.records import dataclass
from texbake.schema import Option, check_fields, option

if TYPE_CHECKING:
    from texbake.mesh.mesh import Float32Array
    from texbake.texture.image import Image

FILTERS = ("nearest", "bilinear", "bicubic", "trilinear", "ewa", "supersampled")
WRAPS = ("repeat", "mirror", "clamp", "border")
# Filters that need the derivatives of texture coordinates per pixel.
FILTERS_WITH_FOOTPRINT = ("trilinear", "ewa", "supersampled")
# Filters that need mip levels.
FILTERS_WITH_LEVELS = ("trilinear", "ewa")
VOLUME_FILTERS = ("trilinear", "nearest")
SPACES = ("object", "world", "uv")

_UV_SET = Option(
    "Name of the texture coordinates, such as TEXCOORD_1 or lightmap; without it, the first set "
    "(TEXCOORD_0)."
)

Rgb = tuple[float, float, float]
Constant = float | Rgb


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageTexture:
    """An image, looked up at texture coordinates."""

    effect: ClassVar[str] = "images"  # effect that reads it
    is_over_uvs: ClassVar[bool] = True  # whether it depends on texture coordinates

    image: Annotated[PathLike | Image | Float32Array, Option("Image file.")]
    filter: str = option("trilinear", "Filter between texels.", choices=FILTERS)
    wrap: str | tuple[str, str] | None = option(
        None,
        "What lies outside the unit square, or along u and along v: by default repeat if "
        "coordinates leave it, else clamp.",
        choices=WRAPS,
    )
    border: tuple[float, ...] = option(
        (0.0,), "Values outside the unit square if wrap is border: one, or one per channel."
    )
    scale: tuple[float, float] = option(
        (1.0, 1.0), "Factor of the texture coordinates; 2 tiles twice."
    )
    offset: tuple[float, float] = option(
        (0.0, 0.0), "Added to the coordinates at the end, to move the texture."
    )
    rotate: float = option(
        0.0, "Angle in degrees by which coordinates are then turned about (0, 0), counterclockwise."
    )
    channel: int | None = option(
        None, "The one channel to use; without it the first, or the first three of a color.", low=0
    )
    factor: Constant = option(1.0, "Number or color that the values are multiplied by.")
    color: bool | None = option(
        None, "Whether integer values are sRGB colors; without it as the slot needs."
    )
    uv_set: Annotated[str | None, _UV_SET] = None
    colors: tuple[Rgb, ...] | None = option(
        None, "Colors of a legend for the first channel, from the low to the high end of range."
    )
    range: tuple[float, float] = option(
        (0.0, 1.0), "Values at the ends of the legend, with colors."
    )

    def __post_init__(self) -> None:
        check_fields(self)
        check_ramp(self.colors)
        if self.range[0] == self.range[1]:
            raise OptionError("range: both ends are equal; give two numbers")
        for word in (self.wrap,) if isinstance(self.wrap, str | None) else self.wrap:
            if word not in (None, *WRAPS):
                raise OptionError(f"wrap: {word} is not one of {', '.join(WRAPS)}")
        for name in "border", "scale", "offset", "factor", "range":
            check_finite(name, getattr(self, name))


@dataclass(frozen=True, kw_only=True, eq=False)
class ProcedureTexture:
    """Values computed at a point: a pattern over (u, v) or a solid one over (x, y, z)."""

    effect: ClassVar[str] = "procedures"

    procedure: Annotated[str, Option("Name of the procedure.")]
    parameters: Annotated[Mapping[str, Any], Option("Parameters of the procedure.")] = field(
        default_factory=dict
    )
    space: str = option(
        "object",
        "Space of the points: of the object, of the world, or texture coordinates (uv).",
        choices=SPACES,
    )
    scale: float | tuple[float, float, float] = option(
        1.0, "Factor that the points are multiplied by."
    )
    colors: tuple[Rgb, ...] | None = option(
        None, "Colors of a ramp from value 0 to value 1, evenly spaced."
    )
    filtered: bool = option(True, "Whether detail finer than a pixel is faded out.")
    factor: Constant = option(1.0, "Number or color that the values are multiplied by.")
    uv_set: Annotated[str | None, _UV_SET] = None

    def __post_init__(self) -> None:
        check_fields(self)
        for name in "scale", "factor":
            check_finite(name, getattr(self, name))
        check_ramp(self.colors)

    @property
    def is_over_uvs(self) -> bool:
        """Whether it depends on texture coordinates, rather than on the point in space."""
        return self.space == "uv"


@dataclass(frozen=True, kw_only=True, eq=False)
class VolumeTexture(ProcedureTexture):
    """Stored values over a cube: a scan, or a stack of images."""

    volume: Annotated[
        PathLike | tuple[PathLike, ...] | Float32Array,
        Option("A .npy file of a volume, or the images of its slices, from back (-z) to front."),
    ]
    procedure: str = option("volume", "Always volume.")
    offset: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0), "Added to the points after scale; the volume then fills the unit cube."
    )
    filter: str = option("trilinear", "Filter between texels.", choices=VOLUME_FILTERS)
    wrap: str = option("clamp", "What lies outside the cube.", choices=WRAPS)
    border: float = option(0.0, "Value outside the cube if wrap is border.")
    range: tuple[float, float] = option((0.0, 1.0), "Values at the ends of the ramp, with colors.")
    filtered: bool = option(False, "Not used.")

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in "offset", "range":
            check_finite(name, getattr(self, name))
        if self.space == "uv":
            raise OptionError("space: a volume needs points in space; give object or world")
        if self.range[0] == self.range[1]:
            raise OptionError("range: both ends are equal; give two numbers")

    @cached_property
    def texels(self) -> Float32Array:
        """(D, H, W, C) values, read when they are first asked for."""
        from texbake.texture.image_files import read_volume

        is_array = hasattr(self.volume, "ndim")
        return self.volume if is_array else read_volume(self.volume)  # type: ignore


def check_ramp(colors: tuple[Rgb, ...] | None) -> None:
    """Raise `OptionError` if a ramp has no color, or one that is not finite."""
    if colors is not None and not colors:
        raise OptionError("colors: a ramp needs at least one color")
    for color in colors or ():
        check_finite("colors", color)


def check_finite(name: str, value: float | Iterable[float]) -> None:
    """Raise `OptionError` if a number, or one of several, is not finite."""
    numbers = value if isinstance(value, Iterable) else (value,)
    if not all(map(math.isfinite, numbers)):
        raise OptionError(f"{name}: {value} is not finite")


Texture = ImageTexture | ProcedureTexture
Slot = Constant | Texture
