"""Every choice of packing textures, with its default."""

from __future__ import annotations

from dataclasses import dataclass

from texbake.errors import OptionError
from texbake.mapping.options.texture import MAX_SIZE

EDGES = ("clamp", "repeat")


@dataclass(frozen=True, kw_only=True)
class PackOptions:
    """What `pack_textures` does where the caller does not say otherwise.

    Attributes
    ----------
    size : int or (int, int), optional
        Texels a side, or (width, height); images that do not fit are made smaller, all by the same
        factor. None: the least area of sides that are powers of two into which all fit as they are.
    padding : int
        Texels around each image that go on as `edges` says, 0 or more.
    edges : str
        `clamp`: padding repeats the nearest texel; `repeat`: an image goes on at its other side,
        for one that tiles.
    """

    size: int | tuple[int, int] | None = None
    padding: int = 4
    edges: str = "clamp"

    def __post_init__(self) -> None:
        if self.edges not in EDGES:
            raise OptionError(f"edges: {self.edges!r} is not one of {', '.join(EDGES)}")
        if not isinstance(self.padding, int) or not 0 <= self.padding < MAX_SIZE // 2:
            raise OptionError(f"padding: {self.padding} is out of range; it must be 0 or more")
        for side in self.sides or ():
            if not isinstance(side, int) or not 1 <= side <= MAX_SIZE:
                raise OptionError(f"size: {side} is out of range; it must be 1 to {MAX_SIZE}")

    @property
    def sides(self) -> tuple[int, int] | None:
        """Width and height, or None."""
        return (self.size, self.size) if isinstance(self.size, int) else self.size
