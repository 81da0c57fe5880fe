"""Options of `repair`, `transform`, `simplify` and `remesh`, and those they share; no NumPy."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Final

from texbake.errors import OptionError, quoted
from texbake.records import dataclass
from texbake.schema import CheckedOptions, Option, option, option_of

DEFAULT_ORIENTATION: Final = "auto"

ORIENTATION_OPTION = Option(
    "Flip parts of the high-poly mesh that face inwards (auto), or leave all as they are (keep).",
    choices=("auto", "keep"),
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

    merge: bool = option(True, "Join vertices at one position.", flag="--merge/--no-merge")
    degenerate: bool = option(
        True, "Remove faces without area.", flag="--degenerate/--no-degenerate"
    )
    duplicates: bool = option(
        True, "Remove faces that repeat another.", flag="--duplicates/--no-duplicates"
    )
    winding: bool = option(
        True,
        "Flip faces so that neighbors agree and closed parts face outwards.",
        flag="--winding/--no-winding",
    )
    coordinates: bool = option(
        True, "Keep texture coordinates.", flag="--coordinates/--no-coordinates"
    )
    join_objects: Annotated[bool, JOIN_OBJECTS_OPTION] = False
    normals: Annotated[str, NORMALS_OPTION] = "keep"
    angle: Annotated[float, ANGLE_OPTION] = DEFAULT_ANGLE

    def __post_init__(self) -> None:
        super().__post_init__()
        check_angle(self.normals, self.angle)


@dataclass(frozen=True, kw_only=True)
class TransformOptions(CheckedOptions):
    """How `transform` moves a mesh: it is scaled and turned upright, then rotated, then moved."""

    scale: float = option(1.0, "Factor of all lengths.", above=0)
    units: str | None = option(
        None,
        "Unit of the lengths of the mesh, which become meters.",
        choices=tuple(UNITS),
        default="lengths stay as they are",
    )
    up: str = option("y", "Axis of the mesh that points up; z is turned to y.", choices=UPS)
    rotate: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0),
        "Angles about the x, y and z axis through the origin, in this order.",
        metavar="X,Y,Z",
        unit="degrees",
    )
    move: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0),
        "Vector that is added to all positions.",
        metavar="X,Y,Z",
        unit="model units",
    )
    flip: bool = option(False, "Flip all faces, and their normals with them.")
    subdivide: int = option(
        0,
        "Levels of Catmull-Clark subdivision; the mesh loses its normals.",
        low=0,
        high=MOST_SUBDIVISIONS,
    )
    normals: Annotated[str, NORMALS_OPTION] = "keep"
    angle: Annotated[float, ANGLE_OPTION] = DEFAULT_ANGLE

    def __post_init__(self) -> None:
        super().__post_init__()
        check_angle(self.normals, self.angle)


def length_of(name: str, what: str, value: str | float, diagonal: float) -> float:
    """Return the length that an option gives, in the units of the diagonal.

    `value`: such as `0.02`, or `1%` of the diagonal.

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


QUALITIES: Final = ("fast", "best")

MIN_FACES: Final = 4
"""The faces of a tetrahedron: fewer enclose nothing."""


FACES_OPTION: Final = Option(
    "Number of triangles to reach.",
    metavar="N",
    low=MIN_FACES,
    flag="--faces",
    default="as few as the error allows",
)
ERROR_OPTION: Final = Option(
    "Greatest distance between the two surfaces: 0.02 (model units) or 0.5% (of the diagonal). "
    "With a number of triangles, simplification stops at the one that is reached first.",
    metavar="D",
    default="no limit",
)


HIDDEN_PARTS: Final = (
    "Leave out parts that cannot be seen from outside, such as an engine under a closed hood"
)


def error_limit(error: str | float | None, diagonal: float) -> float | None:
    """Return the greatest distance that an error allows, in the units of the diagonal."""
    return None if error is None else length_of("error", "a distance", error, diagonal)


def check_target(n_faces: int | None, error: str | float | None) -> None:
    """Raise `OptionError` unless a number of faces, an error, or both are given."""
    if n_faces is None and error is None:
        raise OptionError("n_faces, error: neither is given; give one of them, or both")
    error_limit(error, 1.0)


@dataclass(frozen=True, kw_only=True)
class SimplifyOptions(CheckedOptions):
    """How far and how well a mesh is simplified."""

    n_faces: Annotated[int | None, FACES_OPTION] = None
    error: Annotated[str | float | None, ERROR_OPTION] = None
    quality: str = option(
        "fast",
        "Simplify quickly (fast), or more slowly and closer to the surface (best).",
        choices=QUALITIES,
    )
    seams: str = option(
        "auto",
        "Seams of texture coordinates: keep them while the number of triangles can be reached "
        "with them and the surface stays close (auto), keep them and more triangles if need be "
        "(keep), or leave texture coordinates out (drop), which usually brings the result closer "
        "to the surface; unwrap then makes new charts.",
        choices=("auto", "keep", "drop"),
    )
    topology: str = option(
        "keep",
        "If holes, tunnels and parts need more triangles than requested, stop with an error "
        "(keep), or close them with a surface around the mesh, without texture coordinates "
        "(simplify).",
        choices=("keep", "simplify"),
    )
    drop_hidden: bool = option(
        False,
        f"{HIDDEN_PARTS}, and simplify barely visible surfaces more. Transparent materials hide "
        "nothing.",
    )
    orientation: Annotated[str, ORIENTATION_OPTION] = DEFAULT_ORIENTATION
    join_objects: Annotated[bool, JOIN_OBJECTS_OPTION] = False
    normals: Annotated[str, NORMALS_OPTION] = "keep"
    angle: Annotated[float, ANGLE_OPTION] = DEFAULT_ANGLE
    max_memory: str | int | None = option(
        None,
        "Limit on the estimated memory, such as 2G. A binary PLY or STL file that needs more is "
        "read and reduced in pieces, as is one of more than 16,777,216 triangles.",
        metavar="SIZE",
        default="no limit",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_angle(self.normals, self.angle)
        check_target(self.n_faces, self.error)


MIN_RESOLUTION: Final = 8
MAX_RESOLUTION: Final = 1024

ALL, LARGEST = "all", "largest"
AUTO, CLOSED, OPEN = "auto", "closed", "open"

DEFAULT_REMESH: Final = "auto"

REMESH_OPTION = Option(
    "Make the low-poly mesh from a closed surface around the high-poly mesh: always, never, or "
    "only where the high-poly mesh has inner walls or is torn, and is not an open surface (auto).",
    choices=("auto", "always", "never"),
)


@dataclass(frozen=True, kw_only=True)
class RemeshOptions(CheckedOptions):
    """How finely a mesh is wrapped, and which gaps are closed."""

    surface: str = option(
        AUTO,
        "Make a closed surface, with all holes filled (closed); an open surface of one sheet, "
        "which keeps its boundary (open); or the one that fits the mesh (auto).",
        choices=(AUTO, CLOSED, OPEN),
    )

    resolution: int = option(
        256,
        "Voxels along the longest side of the mesh.",
        metavar="N",
        low=MIN_RESOLUTION,
        high=MAX_RESOLUTION,
    )
    close: str | float = option(
        "1%",
        "Close gaps up to this width: 0.02 (model units) or 1% (of the diagonal). Gaps of less "
        "than two voxels are closed in any case. Holes of an open surface up to this width are "
        "filled.",
        metavar="D",
    )
    keep_interior: bool = option(
        False,
        "Keep cavities that are wider than the gaps that are closed, instead of filling them. "
        "The faces of the mesh must agree about which side is out.",
    )
    sharp_edges: bool = option(
        False,
        "Keep corners and edges sharp where the faces of the mesh meet at more than 30 "
        "degrees. Without it, they are rounded by up to a voxel.",
    )
    components: int | str = option(
        ALL,
        "Which separate parts of the result to keep: all, the largest, or the N largest by volume.",
        choices=(ALL, LARGEST),
        metavar="N",
        low=1,
    )
    n_faces: int | None = option(
        None,
        "Number of triangles to simplify the result to.",
        metavar="N",
        low=MIN_FACES,
        flag="--faces",
        default="not simplified",
    )
    quality: Annotated[str, option_of(SimplifyOptions, "quality")] = SimplifyOptions.quality

    def __post_init__(self) -> None:
        super().__post_init__()
        self.gap(1.0)
        if self.surface == OPEN and self.keep_interior:
            raise OptionError("keep_interior: an open surface has no interior; leave it out")

    def gap(self, diagonal: float) -> float:
        """Return the width of the gaps to close, in the units of the diagonal."""
        return length_of("close", "a width", self.close, diagonal)

    @property
    def n_components(self) -> int | None:
        """How many of the largest parts are kept; None for all."""
        if isinstance(self.components, int):
            return self.components
        return 1 if self.components == LARGEST else None
