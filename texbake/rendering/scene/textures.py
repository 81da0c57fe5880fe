"""What a slot of a material can hold: a constant, an image or a procedure.

A slot is written as one of these in a scene file and given as one of them in Python. Nothing here
reads a file or computes a texel; that happens when the plan of a picture asks for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from texbake.errors import OptionError
from texbake.files import PathLike

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from texbake.texture.image import Image

FILTERS = ("nearest", "bilinear", "bicubic", "trilinear", "ewa", "supersampled")
WRAPS = ("repeat", "mirror", "clamp", "border")
# Filters that need to know how far apart the coordinates of neighboring pixels are.
FILTERS_WITH_FOOTPRINT = ("trilinear", "ewa", "supersampled")
# Filters that read smaller levels of an image.
FILTERS_WITH_LEVELS = ("trilinear", "ewa")
SPACES = ("object", "world", "uv")

Rgb = tuple[float, float, float]
Constant = float | Rgb


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageTexture:
    """An image, looked up at texture coordinates.

    Attributes
    ----------
    image : path, Image or (H, W, C) float32
        An array holds linear values (of a normal map: unit vectors; of heights: model units).
    filter : str
        `nearest`, `bilinear`, `bicubic`, `trilinear`, `ewa`, or the slow reference, `supersampled`.
    wrap : str, optional
        `repeat`, `mirror`, `clamp` or `border`; None: repeat where coordinates leave the unit
        square, else clamp.
    border : tuple of float
        Values outside the unit square with `border`; as many as the image has channels, or one.
    scale, offset : (u, v)
        Coordinates are multiplied by `scale`, turned and then moved by `offset`.
    rotate : float
        Degrees, counter-clockwise about (0, 0).
    channel : int, optional
        The one channel to use; None: the first of a slot of one number, or the first three.
    factor : float or (r, g, b)
        What is looked up is multiplied by it.
    color : bool, optional
        Whether integer codes are sRGB; None: as the slot has it.
    """

    image: PathLike | Image | npt.NDArray[np.float32]
    filter: str = "trilinear"
    wrap: str | None = None
    border: tuple[float, ...] = (0.0,)
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    rotate: float = 0.0
    channel: int | None = None
    factor: Constant = 1.0
    color: bool | None = None

    def __post_init__(self) -> None:
        if self.filter not in FILTERS:
            raise OptionError(f"filter: {self.filter!r} is not one of {', '.join(FILTERS)}")
        if self.wrap is not None and self.wrap not in WRAPS:
            raise OptionError(f"wrap: {self.wrap!r} is not one of {', '.join(WRAPS)}")
        if self.channel is not None and self.channel < 0:
            raise OptionError(f"channel: {self.channel} is below 0; the first is 0")
        for name in "border", "scale", "offset", "rotate", "factor":
            _check_finite(name, getattr(self, name))


@dataclass(frozen=True, kw_only=True, eq=False)
class ProcedureTexture:
    """Values computed at a point: a pattern over (u, v) or a solid one over (x, y, z).

    Attributes
    ----------
    procedure : str
        One of `texbake.texture.procedures.PROCEDURES`: checker, stripes, noise, fractal,
        turbulence, marble, wood, granite, worley.
    parameters : mapping
        What the procedure takes beyond its point, `seed` among it.
    space : str
        Where its point lies: `object`, `world` or `uv` (r = 0).
    scale : float or (x, y, z)
        The point is multiplied by it.
    colors : tuple of (r, g, b), optional
        A ramp, evenly spaced from value 0 to value 1, interpolated (a 1D texture); None: the value
        itself, or the procedure's own colors.
    filtered : bool
        Whether what is finer than a pixel is faded out.
    factor : float or (r, g, b)
        The result is multiplied by it.
    """

    procedure: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    space: str = "object"
    scale: float | tuple[float, float, float] = 1.0
    colors: tuple[Rgb, ...] | None = None
    filtered: bool = True
    factor: Constant = 1.0

    def __post_init__(self) -> None:
        if self.space not in SPACES:
            raise OptionError(f"space: {self.space!r} is not one of {', '.join(SPACES)}")
        for name in "scale", "factor":
            _check_finite(name, getattr(self, name))
        if self.colors is not None and not self.colors:
            raise OptionError("colors: a ramp needs at least one color")
        for color in self.colors or ():
            _check_finite("colors", color)


def _check_finite(name: str, value: float | Iterable[float]) -> None:
    numbers = value if isinstance(value, Iterable) else (value,)
    if not all(map(math.isfinite, numbers)):
        raise OptionError(f"{name}: {value} is not finite")


Texture = ImageTexture | ProcedureTexture
Slot = Constant | Texture
