"""Options of `repair` and `transform`, and those that several verbs share; without NumPy."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, Final

from texbake.errors import OptionError, quoted
from texbake.schema import CheckedOptions, Option

ORIENTATIONS: Final = ("auto", "keep")
DEFAULT_ORIENTATION: Final = "auto"

ORIENTATION_OPTION = Option(
    "Flip parts of the high-poly mesh that face inwards (auto), or leave all as they are (keep).",
    choices=ORIENTATIONS,
)

JOIN_OBJECTS_OPTION = Option(
    "Treat all objects as one surface. By default, objects that touch stay separate and keep their "
    "names."
)

NORMALS: Final = ("smooth", "angle", "uv", "keep")
DEFAULT_ANGLE: Final = 60.0

NORMALS_OPTION = Option(
    "Normals of the mesh: smooth everywhere; hard where faces meet at more than an angle; hard "
    "where texture coordinates are split (uv); or those of the file (keep).",
    choices=NORMALS,
)
ANGLE_OPTION = Option(
    "Angle between faces above which an edge is hard, for normals by angle.",
    metavar="DEG",
    above=0,
    below=180,
    unit="degrees",
)
LOW_NORMALS_OPTION = replace(
    NORMALS_OPTION,
    help="Normals of the low-poly mesh: hard at the sharp edges of the high-poly mesh, which also "
    "cut charts, and smooth elsewhere (auto); smooth everywhere; hard where faces meet at more "
    "than an angle, which also cuts charts; hard at borders of charts (uv); or those of the "
    "high-poly mesh (keep).",
    choices=("auto", *NORMALS),
)


def check_angle(normals: str, angle: float) -> None:
    """Raise `OptionError` if an angle is given that no normals depend on."""
    if angle != DEFAULT_ANGLE and normals != "angle":
        raise OptionError(f"angle: normals {normals} do not use it; leave it out, or set `normals`")


MOST_SUBDIVISIONS: Final = 8

# Meters in a unit of length.
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
UPS = ("y", "z")


@dataclass(frozen=True, kw_only=True)
class RepairOptions(CheckedOptions):
    """Which repairs `repair` makes.

    If new texture coordinates are made later, `simplify` mostly comes closer to the surface
    without the seams of the old ones.
    """

    merge: Annotated[bool, Option("Join vertices at one position.", flag="--merge/--no-merge")] = (
        True
    )
    degenerate: Annotated[
        bool, Option("Remove faces without area.", flag="--degenerate/--no-degenerate")
    ] = True
    duplicates: Annotated[
        bool, Option("Remove faces that repeat another.", flag="--duplicates/--no-duplicates")
    ] = True
    winding: Annotated[
        bool,
        Option(
            "Flip faces so that neighbors agree and closed parts face outwards.",
            flag="--winding/--no-winding",
        ),
    ] = True
    coordinates: Annotated[
        bool, Option("Keep texture coordinates.", flag="--coordinates/--no-coordinates")
    ] = True
    join_objects: Annotated[bool, JOIN_OBJECTS_OPTION] = False
    normals: Annotated[str, NORMALS_OPTION] = "keep"
    angle: Annotated[float, ANGLE_OPTION] = DEFAULT_ANGLE

    def __post_init__(self) -> None:
        super().__post_init__()
        check_angle(self.normals, self.angle)


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
    flip: Annotated[bool, Option("Flip all faces, and their normals with them.")] = False
    subdivide: Annotated[
        int,
        Option(
            "Levels of Catmull-Clark subdivision; the mesh loses its normals.",
            low=0,
            high=MOST_SUBDIVISIONS,
        ),
    ] = 0
    normals: Annotated[str, NORMALS_OPTION] = "keep"
    angle: Annotated[float, ANGLE_OPTION] = DEFAULT_ANGLE

    def __post_init__(self) -> None:
        super().__post_init__()
        check_angle(self.normals, self.angle)


def length_of(name: str, what: str, value: str | float, diagonal: float) -> float:
    """Return the length that an option gives, in the units of the diagonal.

    `value`: such as `0.02`, or `1%` of the diagonal.

    Examples
    --------
    >>> length_of("close", "a width", "2%", 50.0)
    1.0
    """
    word = str(value).strip()
    try:
        number = float(word.removesuffix("%"))
    except ValueError:
        number = math.nan
    if not 0.0 <= number < math.inf:
        raise OptionError(
            f"{name}: {quoted(value)} is not {what}; give a length such as 0.02, or a share of the "
            "diagonal such as 1%"
        )
    return 0.01 * number * diagonal if word.endswith("%") else number
