"""Bicubic Bézier patches, evaluated so that what should meet meets bit by bit.

Weights are whole numbers divided once, and terms are added from both ends, so that a curve
traversed from its other end has the same points. Borders depend on their own four control points
alone, so that patches that share those share the border's points.

Where a border is a single point, its normal is the limit on the way to it, for which the tangent's
place is taken by the mixed second derivative.

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

Based on: G. Farin, "Curves and Surfaces for CAGD", 5th edition, 2002, chapters 5 and 14; F. Crow,
"The Origins of the Teapot", IEEE Computer Graphics and Applications 7(1), 1987 (the files).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, counted, quoted
from texbake.files import PathLike
from texbake.limits import whole_number
from texbake.mesh.files.source import TextLine, parse_row, read_lines
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh
from texbake.mesh.normals import shading_normals
from texbake.mesh.parametric.grid import grid_mesh, lattice, open_lines, triangulate
from texbake.mesh.parametric.options import check_triangles
from texbake.mesh.parametric.revolution import numbers_of
from texbake.mesh.weld import weld_rows

_TILES_ABREAST = 10  # as UDIM has them
# Two tangents whose cross product is shorter, relative to theirs, are parallel but for rounding.
_PARALLEL = 1e-12
_N_POINTS = 16  # of a patch
# Numbers of a control point: its place, or its place and its texture coordinates.
_POINT_WIDTHS = (3, 5)


def make_bezier(*, resolution: tuple[int, int], patches: FloatArray) -> Mesh:
    """Surface of bicubic patches, (P, 4, 4, 3) or (P, 4, 4, 5) as of `patches_of`."""
    n_u, n_v = resolution
    n_patches = len(patches)
    check_triangles(2 * n_u * n_v * n_patches)
    nodes, quads = lattice(open_lines(n_u), open_lines(n_v))  # of one patch
    firsts = np.arange(n_patches, dtype=np.int32) * len(nodes)
    quads = (quads + firsts[:, None, None]).reshape(-1, 4)
    patch = np.repeat(np.arange(n_patches, dtype=np.int32), len(nodes))
    nodes = np.column_stack([np.tile(nodes, (n_patches, 1)), patch])
    surface = _Surface(patches[..., :3], n_u, n_v)
    points = surface.points(nodes)
    grid = triangulate(nodes, weld_rows(points), quads)

    column, row, patch = grid.nodes.T
    if patches.shape[-1] == 3:
        tile_v, tile_u = np.divmod(patch, _TILES_ABREAST)
        uvs = np.stack([tile_u + column / (2 * n_u), tile_v + row / (2 * n_v)], axis=-1)
    else:
        uvs = _Surface(patches[..., 3:], n_u, n_v).points(grid.nodes)
    mesh = grid_mesh(
        grid,
        name="bezier",
        positions=points[grid.vertex_ids],
        uvs=uvs,
        normals=surface.normals(grid.nodes),
        face_groups=patch[grid.faces[:, 0]],
        group_names=tuple(f"patch {k + 1}" for k in range(n_patches)),
    )
    assert mesh.normals is not None
    if not (mesh.normals == 0.0).all(axis=1).any():
        return mesh
    normals, normal_faces = shading_normals(mesh)  # smooth ones in place of zeros, which stay
    used, numbers = np.unique(normal_faces, return_inverse=True)
    return mesh.replace(normals=normals[used], normal_faces=numbers.reshape(-1, 3))


class _Surface:
    """Patches at the half steps of a lattice; nodes are (column, row, patch)."""

    def __init__(self, patches: FloatArray, n_u: int, n_v: int) -> None:
        u_cubic, u_quadratic = (weights[..., None] for weights in _bernstein(2 * n_u))
        points = np.moveaxis(patches, 2, 0)[..., None, :]  # (4, P, 4, 1, 3): along u first
        self._curves = _curve(points, u_cubic)  # (P, 4, 2 n_u + 1, 3): of each row of points
        self._slopes = _slope(points, u_quadratic)
        self._v_cubic, self._v_quadratic = _bernstein(2 * n_v)
        self._last = np.array([2 * n_u, 2 * n_v])

    def points(self, nodes: IntArray) -> FloatArray:
        """(N, 3): where nodes are; (N, 2) for a surface of texture coordinates."""
        return _curve(self._rows(self._curves, nodes), self._v_cubic[:, nodes[:, 1], None])

    def normals(self, nodes: IntArray) -> FloatArray:
        """(N, 3): unit normals at nodes, or their limits; 0 where there is none."""
        curves, slopes = self._rows(self._curves, nodes), self._rows(self._slopes, nodes)
        quadratic = self._v_quadratic[:, nodes[:, 1], None]
        along_u = _curve(slopes, self._v_cubic[:, nodes[:, 1], None])
        along_v = _slope(curves, quadratic)
        mixed = _slope(slopes, quadratic)
        # From the borders u = 1 and v = 1 the way into the patch is backwards.
        sign_u, sign_v = np.where(nodes[:, :2] == self._last, -1.0, 1.0).T[..., None]
        along_u = _unit(np.where((along_u == 0.0).all(axis=1)[:, None], sign_v * mixed, along_u))
        along_v = _unit(np.where((along_v == 0.0).all(axis=1)[:, None], sign_u * mixed, along_v))
        normals = np.cross(along_u, along_v)
        lengths = pm.norm(normals, axis=1, keepdims=True)
        return _divided(normals, lengths, lengths > _PARALLEL)

    @staticmethod
    def _rows(values: FloatArray, nodes: IntArray) -> FloatArray:
        """(4, N, 3): values on the four curves along u that make the curve along v."""
        column, patch = nodes[:, 0], nodes[:, 2]
        return np.stack([values[patch, row, column] for row in range(4)])


def _bernstein(steps: int) -> tuple[FloatArray, FloatArray]:
    """(4, K) and (3, K): the cubic and quadratic polynomials at k / steps, k = 0 ... steps."""
    up = np.arange(steps + 1, dtype=np.float64)
    down = up[::-1]
    cubic = np.stack([down**3, 3.0 * (down * down * up), 3.0 * (down * up * up), up**3])
    quadratic = np.stack([down * down, 2.0 * (down * up), up * up])
    return cubic / float(steps) ** 3, quadratic / float(steps) ** 2


def _curve(points: FloatArray, weights: FloatArray) -> FloatArray:
    """Points of curves of four control points each; exactly that point where all four are equal."""
    a, b, c, d = points
    outer, inner = weights[0] * a + weights[3] * d, weights[1] * b + weights[2] * c
    return np.asarray(np.where((a == b) & (b == c) & (c == d), a, outer + inner))


def _slope(points: FloatArray, weights: FloatArray) -> FloatArray:
    """Derivatives of such curves; exactly 0 where all four points are equal."""
    a, b, c, d = points
    outer, inner = weights[0] * (b - a) + weights[2] * (d - c), weights[1] * (c - b)
    return np.asarray(3.0 * (outer + inner))


def _unit(vectors: FloatArray) -> FloatArray:
    """Unit vectors; 0 stays 0."""
    lengths = pm.norm(vectors, axis=1, keepdims=True)
    return _divided(vectors, lengths, lengths > 0.0)


def _divided(vectors: FloatArray, lengths: FloatArray, where: BoolArray) -> FloatArray:
    """Vectors by their lengths, 0 where that is not wanted."""
    return np.asarray(np.divide(vectors, lengths, out=np.zeros_like(vectors), where=where))


def patches_of(source: PathLike | npt.ArrayLike) -> FloatArray:
    """(P, 4, 4, 3 or 5) float64 control points, from a file or an array: patch, row, column."""
    patches, error, name = numbers_of(source, "patches", _read_patches)
    if patches.ndim != 4 or patches.shape[1:3] != (4, 4) or patches.shape[3] not in _POINT_WIDTHS:
        raise error(
            f"{name}: an array of shape {patches.shape} does not hold patches; give (n, 4, 4, 3), "
            "or (n, 4, 4, 5) with texture coordinates"
        )
    if len(patches) == 0:
        raise error(f"{name}: it has no patches")
    return patches


def _read_patches(path: PathLike) -> FloatArray:
    """Read control points in any layout that this module's docstring shows."""
    lines = read_lines(path, "a patch file")
    if not lines:
        raise FileFormatError(f"{path}: it has no patches; it holds comments alone")
    if len(lines[0].words) in _POINT_WIDTHS:
        points, n_patches = _points(path, lines), -(-len(lines) // _N_POINTS)
    else:
        n_patches, lines = _count(path, lines[0], "patches"), lines[1:]
        width = len(lines[0].words) if lines else 0
        if width == 2:
            points = _points(path, _without_degrees(path, lines))
        elif width in _POINT_WIDTHS:
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
    width = width if width in _POINT_WIDTHS else _POINT_WIDTHS[0]
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
