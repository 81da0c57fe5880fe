"""Profiles of surfaces of revolution: radius and height, point by point.

A file has a point a line, as in::

    # radius height
    0.0  0.0
    0.8  0.1
    1.0  0.9
"""

from __future__ import annotations

import os

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError, OptionError
from texbake.files import PathLike
from texbake.mesh.files.number_lines import parse_row, read_lines
from texbake.mesh.mesh import FloatArray


def profile_of(source: PathLike | npt.ArrayLike) -> FloatArray:
    """Profile of a file, or of an array that a caller has at hand; see `read_profile`.

    Raises
    ------
    OptionError
        The array is no profile.
    """
    if isinstance(source, (str, os.PathLike)):
        return read_profile(source)
    try:
        points = np.asarray(source, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise OptionError("profile: it is not an array of numbers") from error
    if points.ndim != 2 or points.shape[1] != 2:
        raise OptionError(f"profile: an array of the shape {points.shape} is none; give (n, 2)")
    if not np.isfinite(points).all():
        raise OptionError("profile: a point is not finite")
    if (points[:, 0] < 0.0).any():
        raise OptionError("profile: a radius is negative")
    fault = _fault(points)
    if fault:
        raise OptionError(f"profile: {fault}")
    return points


def read_profile(path: PathLike) -> FloatArray:
    """Read a profile.

    Each line has a radius and a height, with blanks or a comma between them; `#` begins a comment.

    Returns
    -------
    (n, 2) float64
        At least two points that differ, of radius 0 or more, not all on the axis.

    Raises
    ------
    FileError
        The file is missing or cannot be read.
    FileFormatError
        It is no such file; the message names the line.
    """
    lines = read_lines(path, "a profile")
    rows = []
    for line in lines:
        row = parse_row(path, line, 2, "a point")
        if row[0] < 0.0:
            raise FileFormatError(
                f"{path}: line {line.number}: the radius {line.words[0]} is negative"
            )
        rows.append(row)
    points = np.array(rows, dtype=np.float64).reshape(-1, 2)
    fault = _fault(points)
    if fault:
        raise FileFormatError(f"{path}: {fault}")
    return points


def _fault(points: FloatArray) -> str:
    """Why points make no surface; empty where they do."""
    if len(points) < 2 or (points == points[0]).all():
        return "it has fewer than two points that differ; a profile needs a radius and height each"
    if not points[:, 0].any():
        return "it lies on the axis; a profile needs a point with a radius above 0"
    return ""
