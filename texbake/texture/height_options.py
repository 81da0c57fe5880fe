"""Every choice of making normals from heights and heights from normals, with its default."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texbake.errors import OptionError

DERIVATIVES = ("central", "sobel", "scharr")
METHODS = ("frankot-chellappa", "poisson")
WRAPS = ("repeat", "clamp")
CONVENTIONS = ("opengl", "directx")
DEFAULT_SCALE = 0.05  # of heights that say nothing of themselves, in widths of the image


@dataclass(frozen=True, kw_only=True)
class HeightToNormalOptions:
    """What `height_to_normal` does where the caller does not say otherwise.

    Attributes
    ----------
    scale : float, optional
        Height that a change of 1 in the values stands for, in the unit of `width`. None: what the
        image says of itself, else `DEFAULT_SCALE`.
    width : float
        How wide the image is; texels are square, so that one is `width` / columns wide and high.
    wrap : str
        Beyond the border: `repeat` (the image tiles) or `clamp` (heights go on as they curve, so
        that derivatives are one-sided there).
    derivative : str
        Differences over 3 x 3 texels: `central` takes two and blurs nothing; `sobel` (1 2 1) and
        `scharr` (3 10 3) also average across their direction, which turns noise down; scharr's
        depend least on the direction of a slope.
    """

    scale: float | None = None
    width: float = 1.0
    wrap: str = "repeat"
    derivative: str = "central"

    def __post_init__(self) -> None:
        if self.scale is not None and not math.isfinite(self.scale):
            raise OptionError(f"scale: {self.scale} is not a finite number")
        _check_width(self.width)
        _check_choice("wrap", self.wrap, WRAPS)
        _check_choice("derivative", self.derivative, DERIVATIVES)


@dataclass(frozen=True, kw_only=True)
class NormalToHeightOptions:
    """What `normal_to_height` does where the caller does not say otherwise.

    Attributes
    ----------
    method : str
        `frankot-chellappa` takes slopes for those of a sum of waves, and so is exact for smooth
        maps that tile; `poisson` takes heights whose steps from texel to texel fit the slopes best,
        and so is exact for what curves evenly.
    wrap : str
        `repeat`: the map tiles, and so do the heights; `clamp`: it ends at its border.
    width : float
        How wide the image is, in the unit that heights come in.
    convention : str, optional
        Green channel of an image: `opengl` (+Y up) or `directx` (+Y down). None: what the image
        says of itself, else `opengl`. Slopes that are left over tell a wrong one.
    """

    method: str = "poisson"
    wrap: str = "repeat"
    width: float = 1.0
    convention: str | None = None

    def __post_init__(self) -> None:
        if self.convention is not None:
            _check_choice("convention", self.convention, CONVENTIONS)
        _check_choice("method", self.method, METHODS)
        _check_choice("wrap", self.wrap, WRAPS)
        _check_width(self.width)


def _check_width(width: float) -> None:
    if not 0.0 < width < math.inf:
        raise OptionError(f"width: {width} is no length; it must be above 0")


def _check_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise OptionError(f"{name}: {value!r} is not one of {', '.join(choices)}")
