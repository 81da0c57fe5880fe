"""Options of `simplify`, without loading anything heavy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final, Literal, get_args

from texbake.errors import OptionError
from texbake.mesh.options import (
    ANGLE_OPTION,
    DEFAULT_ANGLE,
    DEFAULT_ORIENTATION,
    JOIN_OBJECTS_OPTION,
    NORMALS_OPTION,
    ORIENTATION_OPTION,
    check_angle,
    length_of,
)
from texbake.schema import CheckedOptions, Option

Quality = Literal["fast", "best"]

QUALITIES: Final[tuple[Quality, ...]] = get_args(Quality)
DEFAULT_QUALITY: Final[Quality] = "fast"
Seams = Literal["auto", "keep", "drop"]

SEAMS: Final[tuple[Seams, ...]] = get_args(Seams)
DEFAULT_SEAMS: Final[Seams] = "auto"

Topology = Literal["keep", "simplify"]

TOPOLOGIES: Final[tuple[Topology, ...]] = get_args(Topology)
DEFAULT_TOPOLOGY: Final[Topology] = "keep"

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
    "Stop where the two surfaces would lie further apart anywhere: 0.02 (model units) or 0.5% (of "
    "the diagonal). With a number of triangles, whichever comes first.",
    metavar="D",
    default="no limit",
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
    quality: Annotated[
        str,
        Option(
            "Simplify quickly (fast), or more slowly and closer to the surface (best).",
            choices=QUALITIES,
        ),
    ] = DEFAULT_QUALITY
    seams: Annotated[
        str,
        Option(
            "Seams of texture coordinates: keep them while the number of triangles can be reached "
            "with them (auto), keep them and more triangles if need be (keep), or leave texture "
            "coordinates out (drop), which mostly brings the result closer to the surface; unwrap "
            "then makes new charts.",
            choices=SEAMS,
        ),
    ] = DEFAULT_SEAMS
    topology: Annotated[
        str,
        Option(
            "If holes, tunnels and parts need more triangles than requested, stop with an error "
            "(keep), or close them with a surface around the mesh, without texture coordinates "
            "(simplify).",
            choices=TOPOLOGIES,
        ),
    ] = DEFAULT_TOPOLOGY
    orientation: Annotated[str, ORIENTATION_OPTION] = DEFAULT_ORIENTATION
    join_objects: Annotated[bool, JOIN_OBJECTS_OPTION] = False
    normals: Annotated[str, NORMALS_OPTION] = "keep"
    angle: Annotated[float, ANGLE_OPTION] = DEFAULT_ANGLE

    def __post_init__(self) -> None:
        super().__post_init__()
        check_angle(self.normals, self.angle)
        check_target(self.n_faces, self.error)
