"""Choices of the classical mappings, and of what happens to (s, t) after any mapping."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from texbake.errors import OptionError, quoted
from texbake.mapping.options.shared import (
    Matrix,
    Vector,
    check_direction,
    check_interval,
    check_numbers,
)
from texbake.records import dataclass
from texbake.schema import CheckedOptions, option

if TYPE_CHECKING:
    from numpy.typing import NDArray


AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
FITS = ("bounds", "pca")
SURFACES = ("plane", "cylinder", "sphere", "box")
VIAS = ("surface-normal", "object-normal", "centroid", "reflection")
UNSEEN = ("aside", "project")

_BOX = "the middle of the bounding box; cylinders: that of a prism around its axis"


@dataclass(frozen=True, kw_only=True)
class ProjectionOptions(CheckedOptions):
    """Where a classical mapping has its plane, axis, center or projector.

    Angle 0 about an axis is the model's front (+z about `y`, +x about `z`, +y about `x`), and
    angles grow counter-clockwise as seen from where the axis points to. `fit="pca"` turns a plane
    into the two directions in which the points of the model spread most; where an axis or a normal
    is given, it only turns within the plane.
    """

    axis: str | Vector | None = option(
        None,
        "Direction that a plane faces, or axis of a cylinder or sphere.",
        metavar="X,Y,Z",
        choices=tuple(AXES),
        default="z for a plane, y for a cylinder or sphere",
    )
    normal: Vector | None = option(
        None,
        "Planar: normal of the plane, instead of an axis.",
        metavar="X,Y,Z",
        default="the axis",
    )
    fit: str = option(
        "bounds",
        "Planar: align the plane with the model's axes (bounds), or with the directions in "
        "which its points spread most (pca).",
        choices=FITS,
    )
    sides: bool = option(
        False, "Planar: put faces that look away beside the others, so that none is mirrored."
    )
    center: Vector | None = option(
        None,
        "Center of the sphere or box, or a point on the axis of the cylinder.",
        metavar="X,Y,Z",
        unit="model units",
        default=_BOX,
    )
    theta: tuple[float, float] = option(
        (-180.0, 180.0),
        "Angles about the axis that become s = 0 and s = 1.",
        metavar="A,B",
        unit="degrees",
    )
    height: tuple[float, float] | None = option(
        None,
        "Cylindrical: heights above the center that become t = 0 and t = 1 (below 1 with caps).",
        metavar="A,B",
        unit="model units",
        default="the lowest and the highest corner",
    )
    caps: bool = option(
        False,
        "Cylindrical: map faces across the axis, such as ends, with a plane, and place them "
        "above the side at the same scale. The side then ends at t = height / arc length.",
    )
    overlap: bool = option(
        False, "Box: let all six planes share the whole square, for textures that tile."
    )
    surface: str = option(
        "cylinder", "Two-part: the surface that the texture is put on first.", choices=SURFACES
    )
    via: str = option(
        "centroid", "Two-part: the line from a point of the object to that surface.", choices=VIAS
    )
    eye: Vector | None = option(
        None,
        "Two-part via reflection: the point that the reflection is seen from.",
        metavar="X,Y,Z",
        unit="model units",
    )
    camera: tuple[float, float] | tuple[float, float, float | None] | None = option(
        None,
        "Projector: azimuth and elevation in degrees, and the distance in model units.",
        metavar="AZ,EL[,DIST]",
        default="0,0, in front",
    )
    fov: float = option(
        35.0,
        "Projector: vertical field of view.",
        metavar="DEG",
        above=0,
        below=180,
        unit="degrees",
    )
    matrix: Matrix | None = option(
        None,
        "Projector: 4 x 4 numbers that take (x, y, z, 1) to (s, t, r, q), or 3 x 4 to (s, t, "
        "q), instead of a camera.",
        metavar="FILE",
    )
    unseen: str = option(
        "aside",
        "Projector: put faces that look away or are hidden one tile to the left (aside), or "
        "project onto them as well.",
        choices=UNSEEN,
    )
    linear: tuple[float, float, float, float, float, float] = option(
        (1.0, 0.0, 0.0, 0.0, 1.0, 0.0),
        "Parametric: s = AU u + BU v + CU and t = AV u + BV v + CV.",
        metavar="AU,BU,CU,AV,BV,CV",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.axis is not None and not isinstance(self.axis, str):
            check_direction("axis", self.axis)
        if self.normal is not None:
            check_direction("normal", self.normal)
            if self.axis is not None:
                raise OptionError("normal: the axis says the same already; give one of them")
        check_interval("theta", self.theta)
        if self.height is not None:
            check_interval("height", self.height)
        if self.camera is not None:
            if self.matrix is not None:
                raise OptionError("matrix: the camera says the same already; give one of them")
            distance = self.camera[2] if len(self.camera) == 3 else None
            if distance is not None and not distance > 0:
                raise OptionError(f"camera: the distance {distance} must be above 0")
        if self.matrix is not None:
            if self.fov != ProjectionOptions.fov:
                raise OptionError("fov: the matrix has its own field of view; give one of them")
            if not isinstance(self.matrix, Sequence) or len(self.matrix) not in (3, 4):
                raise OptionError("matrix: it must be 4 rows of 4 numbers, or 3")
            for row in self.matrix:
                check_numbers("matrix", row, 4)


WARPS = {"twirl": 90.0, "bulge": 0.5, "power": 2.0}  # with their strengths
FLIPS = ("s", "t", "st")

WarpFunction = Callable[["NDArray[Any]"], "NDArray[Any]"]


@dataclass(frozen=True, kw_only=True)
class TransformOptions(CheckedOptions):
    """What happens to coordinates after they have been mapped, in this order.

    The warp `twirl` turns points about (1/2, 1/2), by this many degrees at the middle and less
    farther out. `bulge` magnifies the middle by 1 / (1 - strength); a negative strength pinches it.
    `power` takes s and t to a power. From Python a warp may also be a function, which gets (n, 2)
    coordinates and returns as many.
    """

    warp: str | tuple[str, float] | WarpFunction | None = option(
        None,
        "Bend the coordinates. The default strengths are: "
        + ", ".join(f"{name} {strength:g}" for name, strength in WARPS.items())
        + ".",
        choices=tuple(WARPS),
        metavar=f"{'|'.join(WARPS)}[:STRENGTH]",
    )
    flip: str | None = option(None, "Mirror s, t or both about 1/2.", choices=FLIPS)
    rotate: float = option(
        0.0, "Turn counterclockwise about (1/2, 1/2).", metavar="DEG", unit="degrees"
    )
    scale: float | tuple[float, float] = option(
        1.0, "Multiply by this about (0, 0); 2 repeats the texture twice.", metavar="S[,T]"
    )
    texel_density: float | None = option(
        None,
        "Scale the coordinates so that the mesh has this many texels per model unit on average.",
        metavar="PX",
        above=0,
        unit="texels per model unit",
        default="as the mapping gives it",
    )
    offset: tuple[float, float] = option(
        (0.0, 0.0), "Add this at the end, to move the coordinates.", metavar="S,T"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.warp is not None and not callable(self.warp):
            _check_warp((self.warp, 1.0) if isinstance(self.warp, str) else self.warp)
        if not all(self.scales):
            raise OptionError(f"scale: {self.scale} leaves nothing; it must not be 0")

    @property
    def scales(self) -> tuple[float, float]:
        """Factors of s and t."""
        if isinstance(self.scale, (int, float)):
            return float(self.scale), float(self.scale)
        return self.scale


def _check_warp(warp: object) -> None:
    if not isinstance(warp, Sequence) or len(warp) != 2:
        raise OptionError(f"warp: {quoted(warp)} is not a name with its strength")
    name, strength = warp
    if name not in WARPS:
        raise OptionError(f"warp: {name} is not one of {', '.join(WARPS)}")
    if not (isinstance(strength, int | float) and math.isfinite(strength)):
        raise OptionError(f"warp: {quoted(strength)} is not a finite number")
    if name == "bulge" and not -1.25 < strength < 1:
        raise OptionError(f"warp: a bulge of {strength} folds over; use above -1.25 and below 1")
    if name == "power" and not strength > 0:
        raise OptionError(f"warp: a power of {strength} is not above 0")
