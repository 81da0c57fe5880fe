"""What can be asked of `simplify`, without loading anything heavy."""

from __future__ import annotations

from typing import Final, Literal, get_args

Quality = Literal["fast", "best"]

QUALITIES: Final[tuple[Quality, ...]] = get_args(Quality)
DEFAULT_QUALITY: Final[Quality] = "fast"

MIN_FACES: Final = 4
"""The faces of a tetrahedron: fewer enclose nothing."""
