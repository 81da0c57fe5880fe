"""Files and arrays that surfaces are made from: profiles of revolution, and bicubic Bézier patches.

A profile file has a radius and a height per line, as in::

    # radius height
    0.0  0.0
    0.8  0.1
    1.0  0.9

Patch files come in the three layouts in which the classic teapot is found. Shared points, as in the
data of F. Crow's article; indices begin at 1::

    32
    1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16
    ... a line of 16 indices for each patch
    306
    1.4,0.0,2.4
    ... a line for each point

Patches one after the other, each with its degrees and 16 points (the BPT layout)::

    28
    3 3
    1.4 0.0 2.4
    ... 16 lines

Points alone, 16 lines per patch, with or without the number of patches before them.

In all of them a point may have five numbers, x, y, z, u and v: texture coordinates of its own,
which the surface interpolates as it does its points. Either all points have them or none. The first
four points are the first row of a patch: u goes along a row, v from row to row, and the surface
faces the side from which u, v turn counter-clockwise.

Based on: F. Crow, "The Origins of the Teapot", IEEE Computer Graphics and Applications 7(1), 1987.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError, OptionError, TexbakeError, counted, quoted
from texbake.files import PathLike
from texbake.limits import whole_number
from texbake.mesh.files.source import TextLine, parse_row, read_lines
from texbake.mesh.mesh import FloatArray

_N_POINTS = 16  # of a patch
# Numbers of a control point: its place, or its place and its texture coordinates.
POINT_WIDTHS = (3, 5)


def profile_of(source: PathLike | npt.ArrayLike) -> FloatArray:
    """(n, 2) float64 points of a profile, from a file or an array, with radii of 0 or more."""
    points, error, name = _numbers_of(source, "profile", _read_profile)
    if points.ndim != 2 or points.shape[1] != 2:
        raise error(f"{name}: an array of shape {points.shape} is not a profile; give (n, 2)")
    if (points[:, 0] < 0.0).any():
        raise error(f"{name}: a radius is negative")
    if len(points) < 2 or (points == points[0]).all():
        raise error(
            f"{name}: it has fewer than two points that differ; a profile needs a radius and "
            "height each"
        )
    if not points[:, 0].any():
        raise error(f"{name}: it lies on the axis; a profile needs a point with a radius above 0")
    return points


def patches_of(source: PathLike | npt.ArrayLike) -> FloatArray:
    """(P, 4, 4, 3 or 5) float64 control points, from a file or an array: patch, row, column."""
    patches, error, name = _numbers_of(source, "patches", _read_patches)
    if patches.ndim != 4 or patches.shape[1:3] != (4, 4) or patches.shape[3] not in POINT_WIDTHS:
        raise error(
            f"{name}: an array of shape {patches.shape} does not hold patches; give (n, 4, 4, 3), "
            "or (n, 4, 4, 5) with texture coordinates"
        )
    if len(patches) == 0:
        raise error(f"{name}: it has no patches")
    return patches


def _numbers_of(
    source: PathLike | npt.ArrayLike, name: str, read: Callable[[PathLike], FloatArray]
) -> tuple[FloatArray, type[TexbakeError], PathLike]:
    """Finite numbers of a file or an array, and the type and name for errors about them."""
    if isinstance(source, (str, os.PathLike)):
        return read(source), FileFormatError, source
    try:
        numbers = np.asarray(source, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise OptionError(f"{name}: it is not an array of numbers") from error
    if not np.isfinite(numbers).all():
        raise OptionError(f"{name}: a point is not finite")
    return numbers, OptionError, name


def _read_profile(path: PathLike) -> FloatArray:
    rows = [parse_row(path, line, 2, "a point") for line in read_lines(path, "a profile")]
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def _read_patches(path: PathLike) -> FloatArray:
    """Read control points in any layout that this module's docstring shows."""
    lines = read_lines(path, "a patch file")
    if not lines:
        raise FileFormatError(f"{path}: it has no patches; it holds comments alone")
    if len(lines[0].words) in POINT_WIDTHS:
        points, n_patches = _points(path, lines), -(-len(lines) // _N_POINTS)
    else:
        n_patches, lines = _count(path, lines[0], "patches"), lines[1:]
        width = len(lines[0].words) if lines else 0
        if width == 2:
            points = _points(path, _without_degrees(path, lines))
        elif width in POINT_WIDTHS:
            points = _points(path, lines)
        else:
            points = _shared(path, lines, n_patches)
    if len(points) != _N_POINTS * n_patches:
        raise FileFormatError(
            f"{path}: it has {counted(len(points), 'point')}; "
            f"{counted(n_patches, 'patch', 'patches')} should have {_N_POINTS * n_patches}"
        )
    return points.reshape(-1, 4, 4, points.shape[-1])


def _shared(path: PathLike, lines: Sequence[TextLine], n_patches: int) -> FloatArray:
    """Points of patches that are indices, from 1, into points that follow."""
    rows = [
        parse_row(path, line, _N_POINTS, f"patch {number}")
        for number, line in enumerate(lines[:n_patches], start=1)
    ]
    if len(lines) <= n_patches:
        raise FileFormatError(f"{path}: it ends before the number of points")
    n_points = _count(path, lines[n_patches], "points")
    points = _points(path, lines[n_patches + 1 :])
    if len(points) != n_points:
        raise FileFormatError(f"{path}: it has {len(points)} points, and should have {n_points}")
    indices = np.array(rows).ravel()
    bad = indices[~np.isin(indices, np.arange(1, n_points + 1))]
    if len(bad):
        raise FileFormatError(
            f"{path}: {bad[0]:g} is not an index; there are points 1 to {n_points}"
        )
    return points[indices.astype(np.int64) - 1]


def _without_degrees(path: PathLike, lines: Sequence[TextLine]) -> list[TextLine]:
    """Lines of points alone, of patches that each begin with their degrees."""
    for line in lines[:: _N_POINTS + 1]:
        if line.words != ["3", "3"]:
            raise FileFormatError(
                f"{path}: line {line.number}: a patch begins with {quoted(' '.join(line.words))}; "
                "only degrees of 3 3 are read"
            )
    return [line for number, line in enumerate(lines) if number % (_N_POINTS + 1)]


def _points(path: PathLike, lines: Sequence[TextLine]) -> FloatArray:
    """(n, 3) or (n, 5) points of lines, as many numbers each as the first has."""
    width = len(lines[0].words) if lines else 0
    width = width if width in POINT_WIDTHS else POINT_WIDTHS[0]
    rows = [parse_row(path, line, width, "a point") for line in lines]
    return np.array(rows, dtype=np.float64).reshape(-1, width)


def _count(path: PathLike, line: TextLine, what: str) -> int:
    """Read a number of things, alone on its line."""
    count = whole_number(line.words[0]) if len(line.words) == 1 else None
    if not count:
        raise FileFormatError(
            f"{path}: line {line.number}: {quoted(' '.join(line.words))} is not a number of {what}"
        )
    return count
