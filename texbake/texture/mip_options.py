"""Options of writing the mip levels of an image."""

from __future__ import annotations

from dataclasses import dataclass

from texbake.errors import OptionError

MIP_KINDS = ("color", "data", "normal")
MIP_WRAPS = ("repeat", "mirror", "clamp")
MIP_FILTERS = ("box", "kaiser")


@dataclass(frozen=True, kw_only=True)
class MipOptions:
    """Options of writing the mip levels of an image.

    Attributes
    ----------
    kind : str
        `color`: integer codes are sRGB and are averaged in linear light. `data`: codes are averaged
        as they are. `normal`: as unit vectors.
    wrap : str
        What lies beyond the borders, for a filter that reaches there: `repeat`, `mirror` or
        `clamp`.
    filter : str
        `box`, the mean over the area of a texel, or `kaiser`, a windowed sinc, which keeps distant
        detail sharper.
    """

    kind: str = "color"
    wrap: str = "repeat"
    filter: str = "box"

    def __post_init__(self) -> None:
        for name, value, known in (
            ("kind", self.kind, MIP_KINDS),
            ("wrap", self.wrap, MIP_WRAPS),
            ("filter", self.filter, MIP_FILTERS),
        ):
            if value not in known:
                raise OptionError(
                    f"{name}: {value!r} is not known; it is one of {', '.join(known)}"
                )
