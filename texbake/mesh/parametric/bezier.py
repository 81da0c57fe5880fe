"""Bicubic Bézier patches, evaluated so that what should meet meets bit by bit.

Weights of the Bernstein polynomials at k / n are whole numbers divided once, and terms are added
from both ends, so that a curve traversed from its other end has the same points. Corners are the
control points, and borders depend on their own four control points alone: patches that share those
share the points of the border, in whichever direction each of them walks it.

Where a border is a single point (four equal control points, as at the lid of the classic teapot),
the surface has no tangent along it. Its normal there is the limit on the way to it, for which the
tangent's place is taken by the mixed second derivative.

Based on: G. Farin, "Curves and Surfaces for CAGD", 5th edition, 2002, chapters 5 and 14.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.normals import shading_normals
from texbake.mesh.parametric.grid import grid_mesh, lattice, open_lines, triangulate
from texbake.mesh.parametric.options import check_triangles
from texbake.mesh.weld import weld_rows

_TILES_ABREAST = 10  # as UDIM has them
# Two tangents whose cross product is shorter, relative to theirs, are parallel but for rounding.
_PARALLEL = 1e-12


def make_bezier(*, resolution: tuple[int, int], patches: FloatArray) -> Mesh:
    """Surface of bicubic patches.

    `patches` (P, 4, 4, 3) or (P, 4, 4, 5) float64: control points, as of `patches_of`.
    """
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


def _divided(vectors: FloatArray, lengths: FloatArray, where: npt.NDArray[np.bool_]) -> FloatArray:
    """Vectors by their lengths, 0 where that is not wanted."""
    return np.asarray(np.divide(vectors, lengths, out=np.zeros_like(vectors), where=where))
