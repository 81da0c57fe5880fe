"""Every option of `transform`, with its default."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from texbake.schema import CheckedOptions, Option

# Meters in a unit of length.
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
UPS = ("y", "z")


@dataclass(frozen=True, kw_only=True)
class TransformOptions(CheckedOptions):
    """How `transform` moves a mesh: it is scaled and turned upright, then rotated, then moved."""

    scale: Annotated[float, Option("Factor of all lengths.", above=0)] = 1.0
    units: Annotated[
        str | None,
        Option(
            "Unit of the lengths of the mesh, which become meters.",
            choices=tuple(UNITS),
            default="lengths stay as they are",
        ),
    ] = None
    up: Annotated[
        str, Option("Axis of the mesh that points up; z is turned to y.", choices=UPS)
    ] = "y"
    rotate: Annotated[
        tuple[float, float, float],
        Option(
            "Angles about the x, y and z axis through the origin, in this order.",
            metavar="X,Y,Z",
            unit="degrees",
        ),
    ] = (0.0, 0.0, 0.0)
    move: Annotated[
        tuple[float, float, float],
        Option("Vector that is added to all positions.", metavar="X,Y,Z", unit="model units"),
    ] = (0.0, 0.0, 0.0)
    flip: Annotated[bool, Option("Turn all faces over, and their normals with them.")] = False
