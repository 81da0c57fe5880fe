"""What became of the texels of a picture in texture order."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TexelReport:
    """What became of the texels of a picture in texture order.

    Attributes
    ----------
    texels : int
        Texels whose center lies in a triangle.
    hidden : int
        Those that face away or lie behind another surface.
    outside : int
        Those beside the picture or behind the camera.
    pixels : int
        Pixels whose middle shows a textured surface.
    gaps : int
        Those of them that no texel reached.
    double_writes : int
        Pixels that more than one texel reached.
    """

    texels: int
    hidden: int
    outside: int
    pixels: int
    gaps: int
    double_writes: int

    def table(self) -> list[tuple[str, str]]:
        """Return rows of a label and a value."""
        share = f" ({100.0 * self.gaps / self.pixels:.1f} %)" if self.pixels else ""
        return [
            ("texels", f"{self.texels:,}, {self.hidden:,} hidden, {self.outside:,} outside"),
            ("textured pixels", f"{self.pixels:,}"),
            ("gaps", f"{self.gaps:,}{share}"),
            ("written more than once", f"{self.double_writes:,}"),
        ]
