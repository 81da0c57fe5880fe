"""Where a photograph was taken from: a camera, or any 4 x 4 projection, and files of both.

World space is right-handed. A camera's matrix takes (x, y, z, 1) in model space to (s, t, r, q) as
in `texbake.mapping.classical.projector`: (s / q, t / q) has (0, 0) and (1, 1) at the lower left and
upper right corner of the picture, and q, like r, is the depth along the view.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texbake.errors import FileError, FileFormatError, OptionError
from texbake.files import PathLike
from texbake.mapping.classical.projector import read_matrix
from texbake.mapping.options.checks import Matrix, Vector, check_direction, check_numbers
from texbake.mesh.mesh import FloatArray

# Of the length of `up`: what is left of it across the view; below, the picture could turn by
# rounding alone.
_LEAST_UP = 1e-9


@dataclass(frozen=True, kw_only=True)
class PhotoCamera:
    """A perspective camera.

    Attributes
    ----------
    position, target : (x, y, z)
        Where it stands and what is in the middle of its picture; model space.
    up : (x, y, z)
        What is up in the picture; any length, not along the view.
    fov : float
        Vertical field of view in degrees, above 0 and below 180.
    aspect : float, optional
        Width of the picture over its height; None: that of the photograph's pixels.

    Raises
    ------
    OptionError
        One of them is something else, or they determine no picture.
    """

    position: Vector
    target: Vector
    up: Vector = (0.0, 1.0, 0.0)
    fov: float = 35.0
    aspect: float | None = None

    def __post_init__(self) -> None:
        check_numbers("position", self.position, 3)
        check_numbers("target", self.target, 3)
        check_direction("up", self.up)
        if not _is_number(self.fov) or not 0.0 < self.fov < 180.0:
            raise OptionError(f"fov: {self.fov!r} degrees are not above 0 and below 180")
        if self.aspect is not None and not (
            _is_number(self.aspect) and 0.0 < self.aspect < math.inf
        ):
            raise OptionError(f"aspect: {self.aspect!r} must be above 0, such as 1.5")
        self.axes()

    def axes(self) -> FloatArray:
        """(3, 3) float64: rows right, up and back (against the view), unit vectors."""
        back = np.subtract(self.position, self.target)
        distance = np.linalg.norm(back)
        if not 0.0 < distance < math.inf:
            raise OptionError(
                "target: it is where the camera stands; give a point that it looks at"
            )
        back = back / distance
        right = np.cross(np.divide(self.up, np.abs(self.up).max()), back)
        across = np.linalg.norm(right)
        if across < _LEAST_UP:
            raise OptionError(f"up: {self.up} is along the view; give a direction across it")
        right = right / across
        return np.stack([right, np.cross(back, right), back])

    def matrix(self, aspect: float = 1.0) -> FloatArray:
        """(4, 4) float64: model space to (s, t, r, q); `aspect` where the camera has none."""
        right, up, back = self.axes()
        focal = 1.0 / math.tan(math.radians(self.fov) / 2.0)
        across = focal / (self.aspect or aspect)
        rows = np.stack([0.5 * (across * right - back), 0.5 * (focal * up - back), -back, -back])
        return np.column_stack([rows, -rows @ np.asarray(self.position, np.float64)])


def read_camera(path: PathLike) -> PhotoCamera | Matrix:
    """Read where a photograph was taken from.

    Parameters
    ----------
    path
        A TOML file with `position` and `target`, and maybe `up`, `fov` and `aspect`; or, with any
        other suffix, sixteen numbers as `read_matrix` takes them.

    Raises
    ------
    FileError
        The file cannot be read.
    FileFormatError
        It is no such file; the message names the key.
    """
    if Path(path).suffix.lower() != ".toml":
        return read_matrix(path)
    try:
        with Path(path).open("rb") as file:
            keys = tomllib.load(file)
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileFormatError(f"{path}: it is not TOML: {error}") from error
    return _camera_of(path, keys)


def _camera_of(path: PathLike, keys: Mapping[str, Any]) -> PhotoCamera:
    known = tuple(PhotoCamera.__dataclass_fields__)
    for key in keys:
        if key not in known:
            raise FileFormatError(
                f"{path}: {key}: it is no key of a camera; {', '.join(known)} are"
            )
    for key in "position", "target":
        if key not in keys:
            raise FileFormatError(f"{path}: {key}: it is missing; give {key} = [x, y, z]")
    try:
        return PhotoCamera(**{key: _value(value) for key, value in keys.items()})
    except OptionError as error:
        raise FileFormatError(f"{path}: {error}") from error


def _value(value: Any) -> Any:
    return tuple(value) if isinstance(value, Sequence) and not isinstance(value, str) else value


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
