"""Choices of the classical mappings: where a plane, an axis, a center or a projector lies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from texbake.errors import OptionError
from texbake.mapping.options.checks import (
    CheckedOptions,
    Matrix,
    Vector,
    check_choice,
    check_direction,
    check_interval,
    check_numbers,
)

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
FITS = ("bounds", "pca")
SURFACES = ("plane", "cylinder", "sphere", "box")
VIAS = ("surface-normal", "object-normal", "centroid", "reflection")
UNSEEN = ("aside", "project")


@dataclass(frozen=True, kw_only=True)
class ProjectionOptions(CheckedOptions):
    """Where a classical mapping has its plane, axis, center or projector.

    Lengths are in model units, angles in degrees.

    Attributes
    ----------
    axis : str or (x, y, z), optional
        Direction that a plane is seen from, or that a cylinder or sphere turns about: `x`, `y`,
        `z` or any vector. None: `z` for planes, `y` else.
    normal : (x, y, z), optional
        Of the plane, instead of `axis`.
    fit : str
        Plane: `bounds` keeps the axes of the model, `pca` lies along the two directions in which
        its points spread most, or turns within the plane where an axis or normal is given.
    sides : bool
        Plane: put the faces that look away beside the others, so that none is mirrored.
    center : (x, y, z), optional
        A point of the axis, or the middle of the sphere or box. None: the middle of the bounding
        box.
    theta : (float, float)
        Angles about the axis that become s = 0 and s = 1. Angle 0 is the model's front (+z about
        `y`, +x about `z`, +y about `x`), and angles grow counter-clockwise seen from where the
        axis points to.
    height : (float, float), optional
        Cylinder: heights along the axis, measured from the center, that become t = 0 and t = 1.
        None: from the lowest to the highest corner.
    caps : bool
        Cylinder: map faces that look along the axis by a plane, beside the side.
    overlap : bool
        Box: let all six planes share the whole square, for textures that tile.
    surface : str
        Two-part: what the texture is put on first.
    via : str
        Two-part: what leads from a point of the object to that surface.
    eye : (x, y, z), optional
        Two-part: where the reflection is seen from.
    camera : (azimuth, elevation) or (azimuth, elevation, distance), optional
        Projector: where it stands, as the view of a preview. None: 0, 0.
    fov : float
        Projector: its vertical field of view.
    matrix : 4 rows of 4 numbers, optional
        Projector: takes (x, y, z, 1) to (s, t, r, q), instead of `camera`.
    unseen : str
        Projector: faces that look away or are hidden are put `aside`, one tile to the left, or get
        what they `project` to.
    linear : (au, bu, cu, av, bv, cv)
        Parametric: s = au u + bu v + cu and t = av u + bv v + cv.
    """

    axis: str | Vector | None = None
    normal: Vector | None = None
    fit: str = "bounds"
    sides: bool = False
    center: Vector | None = None
    theta: tuple[float, float] = (-180.0, 180.0)
    height: tuple[float, float] | None = None
    caps: bool = False
    overlap: bool = False
    surface: str = "cylinder"
    via: str = "centroid"
    eye: Vector | None = None
    camera: tuple[float, float] | tuple[float, float, float | None] | None = None
    fov: float = 35.0
    matrix: Matrix | None = None
    unseen: str = "aside"
    linear: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.axis, str):
            check_choice("axis", self.axis, tuple(AXES))
        elif self.axis is not None:
            check_direction("axis", self.axis)
        if self.normal is not None:
            check_direction("normal", self.normal)
            if self.axis is not None:
                raise OptionError("normal: the axis says the same already; give one of them")
        check_choice("fit", self.fit, FITS)
        check_choice("surface", self.surface, SURFACES)
        check_choice("via", self.via, VIAS)
        check_choice("unseen", self.unseen, UNSEEN)
        for name in "center", "eye":
            if getattr(self, name) is not None:
                check_numbers(name, getattr(self, name), 3)
        check_interval("theta", self.theta)
        if self.height is not None:
            check_interval("height", self.height)
        check_numbers("linear", self.linear, 6)
        self._check_projector()

    def _check_projector(self) -> None:
        if self.camera is not None:
            if not isinstance(self.camera, Sequence) or len(self.camera) not in (2, 3):
                raise OptionError(f"camera: {self.camera} is not azimuth, elevation and distance")
            check_numbers("camera", [v for v in self.camera if v is not None], len(self.camera))
            if self.matrix is not None:
                raise OptionError("matrix: the camera says the same already; give one of them")
            if len(self.camera) == 3 and not self.camera[2] > 0:  # type: ignore[operator]
                raise OptionError(f"camera: the distance {self.camera[2]} must be above 0")
        if not 0 < self.fov < 180 or not math.isfinite(self.fov):
            raise OptionError(f"fov: {self.fov} degrees is out of range; above 0 and below 180")
        if self.matrix is not None:
            if self.fov != ProjectionOptions.fov:
                raise OptionError("fov: the matrix has its own field of view; give one of them")
            if not isinstance(self.matrix, Sequence) or len(self.matrix) != 4:
                raise OptionError("matrix: it has not 4 rows of 4 numbers")
            for row in self.matrix:
                check_numbers("matrix", row, 4)
