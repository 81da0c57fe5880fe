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
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError, OptionError, quoted
from texbake.files import PathLike
from texbake.limits import whole_number
from texbake.mesh.files.source import TextLine, parse_row, read_lines
from texbake.mesh.mesh import FloatArray


def profile_of(source: PathLike | npt.ArrayLike) -> FloatArray:
    """Profile of a file, or of an array that a caller has at hand; see `read_profile`."""
    if isinstance(source, (str, os.PathLike)):
        return read_profile(source)
    try:
        points = np.asarray(source, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise OptionError("profile: it is not an array of numbers") from error
    if points.ndim != 2 or points.shape[1] != 2:
        raise OptionError(
            f"profile: an array of shape {points.shape} is not a profile; give (n, 2)"
        )
    if not np.isfinite(points).all():
        raise OptionError("profile: a point is not finite")
    if (points[:, 0] < 0.0).any():
        raise OptionError("profile: a radius is negative")
    fault = _profile_fault(points)
    if fault:
        raise OptionError(f"profile: {fault}")
    return points


def read_profile(path: PathLike) -> FloatArray:
    """Read a profile.

    Each line has a radius and a height, with blanks or a comma between them; `#` begins a comment.

    Returns (n, 2) float64: at least two points that differ, of radius 0 or more, not all on the
    axis.
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
    fault = _profile_fault(points)
    if fault:
        raise FileFormatError(f"{path}: {fault}")
    return points


def _profile_fault(points: FloatArray) -> str:
    """Why points make no surface; empty where they do."""
    if len(points) < 2 or (points == points[0]).all():
        return "it has fewer than two points that differ; a profile needs a radius and height each"
    if not points[:, 0].any():
        return "it lies on the axis; a profile needs a point with a radius above 0"
    return ""


_N_POINTS = 16  # of a patch
# Numbers of a control point: its place, or its place and its texture coordinates.
POINT_WIDTHS = (3, 5)


def patches_of(source: PathLike | npt.ArrayLike) -> FloatArray:
    """Patches of a file, or of an array that a caller has at hand; see `read_patches`."""
    if isinstance(source, (str, os.PathLike)):
        return read_patches(source)
    try:
        patches = np.asarray(source, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise OptionError("patches: it is not an array of numbers") from error
    if (
        patches.ndim != 4
        or patches.shape[1:3] != (4, 4)
        or patches.shape[3] not in POINT_WIDTHS
        or len(patches) == 0
    ):
        raise OptionError(
            f"patches: an array of shape {patches.shape} does not hold patches; give (n, 4, 4, 3), "
            "or (n, 4, 4, 5) with texture coordinates"
        )
    if not np.isfinite(patches).all():
        raise OptionError("patches: a point is not finite")
    return patches


def read_patches(path: PathLike) -> FloatArray:
    """Read a file of bicubic Bézier patches, in any layout that this module's docstring shows.

    Blanks or commas separate the numbers of a line; `#` begins a comment.

    Returns (P, 4, 4, 3) or (P, 4, 4, 5) float64: control points: patch, row, column; x, y and z,
    and u and v if the file has them.
    """
    lines = read_lines(path, "a patch file")
    if not lines:
        raise FileFormatError(f"{path}: it has no patches; it holds comments alone")
    if len(lines[0].words) in POINT_WIDTHS:
        points = _separate(path, lines, None)
    else:
        n_patches, rest = _count(path, lines[0], "patches"), lines[1:]
        width = len(rest[0].words) if rest else 0
        # Only shared points have a second number alone on its line; a hole must not hide them.
        if width in (2, *POINT_WIDTHS) and not any(_count_in(line) is not None for line in rest):
            points = (_with_degrees if width == 2 else _separate)(path, rest, n_patches)
        else:
            points = _shared(path, rest, n_patches)
    return points.reshape(-1, 4, 4, points.shape[-1])


def _shared(path: PathLike, lines: Sequence[TextLine], n_patches: int) -> FloatArray:
    """Patches of indices into points that follow."""
    rows = []
    for patch in range(1, n_patches + 1):
        if patch > len(lines):
            raise FileFormatError(f"{path}: it ends before patch {patch} of {n_patches}")
        line = lines[patch - 1]
        if len(line.words) != _N_POINTS:
            raise FileFormatError(
                f"{path}: line {line.number}: patch {patch} of {n_patches} has "
                f"{len(line.words)} indices; it needs {_N_POINTS}"
            )
        rows.append(line)
    if len(lines) == n_patches:
        raise FileFormatError(f"{path}: it ends before the number of points")
    n_points = _count(path, lines[n_patches], "points")
    indices = np.array(
        [_indices(path, line, patch, n_points) for patch, line in enumerate(rows, start=1)]
    )
    of_points = lines[n_patches + 1 :]
    if len(of_points) < n_points:
        raise FileFormatError(f"{path}: it has {len(of_points)} of {n_points} points; it was cut")
    _refuse_more(path, of_points, n_points)
    width = _width(of_points)
    points = np.array([parse_row(path, line, width, "a point") for line in of_points])
    found: FloatArray = points[indices - 1]
    return found


def _indices(path: PathLike, line: TextLine, patch: int, n_points: int) -> list[int]:
    """Indices of one patch, from 1."""
    indices = []
    for word in line.words:
        try:
            index = int(word)
        except ValueError as error:
            raise FileFormatError(
                f"{path}: line {line.number}: patch {patch} has {quoted(word)} for an index"
            ) from error
        if not 1 <= index <= n_points:
            raise FileFormatError(
                f"{path}: line {line.number}: patch {patch} has the index {quoted(index)}; "
                f"there are points 1 to {n_points}"
            )
        indices.append(index)
    return indices


def _with_degrees(path: PathLike, lines: Sequence[TextLine], n_patches: int) -> FloatArray:
    """Patches of a line of degrees and 16 points each."""
    of_points: list[TextLine] = []
    for number, line in enumerate(lines):
        patch, place = divmod(number, _N_POINTS + 1)
        if place > 0 and len(line.words) == 2:
            raise FileFormatError(
                f"{path}: line {line.number}: patch {patch + 1} of {n_patches} ends after "
                f"{place - 1} points; it needs {_N_POINTS}"
            )
        if place == 0 and patch < n_patches and line.words != ["3", "3"]:
            raise FileFormatError(
                f"{path}: line {line.number}: patch {patch + 1} of {n_patches} begins with "
                f"{quoted(' '.join(line.words))}; only degrees of 3 3 are read"
            )
        if place > 0 or patch >= n_patches:
            of_points.append(line)
    return _separate(path, of_points, n_patches)


def _separate(path: PathLike, lines: Sequence[TextLine], n_patches: int | None) -> FloatArray:
    """Patches of 16 points each; as many as there are where no number of them is known."""
    if n_patches is None:
        n_patches = -(-len(lines) // _N_POINTS)
    _refuse_more(path, lines, _N_POINTS * n_patches)
    width = _width(lines)
    rows = [
        parse_row(path, line, width, f"a point of patch {number // _N_POINTS + 1}")
        for number, line in enumerate(lines)
    ]
    patch, n_left = divmod(len(rows), _N_POINTS)
    if patch < n_patches:
        raise FileFormatError(
            f"{path}: it ends where patch {patch + 1} of {n_patches} has {n_left} points; "
            f"it needs {_N_POINTS}"
        )
    return np.array(rows)


def _width(of_points: Sequence[TextLine]) -> int:
    """Numbers of each point: as many as the first has, if that may be."""
    width = len(of_points[0].words) if of_points else 0
    return width if width in POINT_WIDTHS else POINT_WIDTHS[0]


def _count_in(line: TextLine) -> int | None:
    """Return the whole number that stands in a line, alone."""
    return whole_number(line.words[0]) if len(line.words) == 1 else None


def _count(path: PathLike, line: TextLine, what: str) -> int:
    """Read a number of things, alone on its line."""
    count = _count_in(line)
    if not count:
        raise FileFormatError(
            f"{path}: line {line.number}: {quoted(' '.join(line.words))} is not a number of {what}"
        )
    return count


def _refuse_more(path: PathLike, lines: Sequence[TextLine], n_points: int) -> None:
    if len(lines) > n_points:
        raise FileFormatError(
            f"{path}: line {lines[n_points].number}: it goes on after the last of {n_points} points"
        )
