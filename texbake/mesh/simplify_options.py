"""Options of `simplify`, without loading anything heavy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final, Literal, get_args

from texbake.mesh.orientation_options import DEFAULT_ORIENTATION, ORIENTATION_OPTION
from texbake.schema import CheckedOptions, Option

Quality = Literal["fast", "best"]

QUALITIES: Final[tuple[Quality, ...]] = get_args(Quality)
DEFAULT_QUALITY: Final[Quality] = "fast"

MIN_FACES: Final = 4
"""The faces of a tetrahedron: fewer enclose nothing."""


@dataclass(frozen=True, kw_only=True)
class SimplifyOptions(CheckedOptions):
    """How far and how well a mesh is simplified."""

    n_faces: Annotated[
        int,
        Option("Number of triangles to reach.", metavar="N", low=MIN_FACES, flag="--faces"),
    ]
    quality: Annotated[
        str,
        Option(
            "Simplify quickly (fast), or more slowly and closer to the surface (best).",
            choices=QUALITIES,
        ),
    ] = DEFAULT_QUALITY
    orientation: Annotated[str, ORIENTATION_OPTION] = DEFAULT_ORIENTATION
