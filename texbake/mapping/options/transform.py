"""Choices of what happens to (s, t) after any mapping: warps, and the linear map."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from texbake.errors import OptionError, quoted
from texbake.schema import CheckedOptions, Option

if TYPE_CHECKING:
    from numpy.typing import NDArray

WARPS = {"twirl": 90.0, "bulge": 0.5, "power": 2.0}  # with their strengths
FLIPS = ("s", "t", "st")

WarpFunction = Callable[["NDArray[Any]"], "NDArray[Any]"]


@dataclass(frozen=True, kw_only=True)
class TransformOptions(CheckedOptions):
    """What happens to coordinates after they have been mapped, in this order.

    The warp `twirl` turns points about (1/2, 1/2), by this many degrees at the middle and less
    farther out. `bulge` magnifies the middle by 1 / (1 - strength); a negative strength pinches it.
    `power` takes s and t to a power. From Python a warp may also be a function, which gets (n, 2)
    coordinates and returns as many.
    """

    warp: Annotated[
        str | tuple[str, float] | WarpFunction | None,
        Option(
            "Bend the coordinates. The default strengths are: "
            + ", ".join(f"{name} {strength:g}" for name, strength in WARPS.items())
            + ".",
            choices=tuple(WARPS),
            metavar=f"{'|'.join(WARPS)}[:STRENGTH]",
        ),
    ] = None
    flip: Annotated[str | None, Option("Mirror s, t or both about 1/2.", choices=FLIPS)] = None
    rotate: Annotated[
        float,
        Option("Turn counterclockwise about (1/2, 1/2).", metavar="DEG", unit="degrees"),
    ] = 0.0
    scale: Annotated[
        float | tuple[float, float],
        Option("Multiply by this about (0, 0); 2 repeats the texture twice.", metavar="S[,T]"),
    ] = 1.0
    texel_density: Annotated[
        float | None,
        Option(
            "Scale the coordinates so that the mesh has this many texels per model unit on "
            "average.",
            metavar="PX",
            above=0,
            unit="texels per model unit",
            default="as the mapping gives it",
        ),
    ] = None
    offset: Annotated[
        tuple[float, float], Option("Add this at the end, to move the coordinates.", metavar="S,T")
    ] = (
        0.0,
        0.0,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.warp is not None and not callable(self.warp):
            _check_warp((self.warp, 1.0) if isinstance(self.warp, str) else self.warp)
        if not all(self.scales):
            raise OptionError(f"scale: {self.scale} leaves nothing; it must not be 0")

    @property
    def scales(self) -> tuple[float, float]:
        """Factors of s and t."""
        if isinstance(self.scale, (int, float)):
            return float(self.scale), float(self.scale)
        return self.scale


def _check_warp(warp: object) -> None:
    if not isinstance(warp, Sequence) or len(warp) != 2:
        raise OptionError(f"warp: {quoted(warp)} is not a name with its strength")
    name, strength = warp
    if name not in WARPS:
        raise OptionError(f"warp: {name} is not one of {', '.join(WARPS)}")
    if not (isinstance(strength, int | float) and math.isfinite(strength)):
        raise OptionError(f"warp: {quoted(strength)} is not a finite number")
    if name == "bulge" and not -1.25 < strength < 1:
        raise OptionError(f"warp: a bulge of {strength} folds over; use above -1.25 and below 1")
    if name == "power" and not strength > 0:
        raise OptionError(f"warp: a power of {strength} is not above 0")
