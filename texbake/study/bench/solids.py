"""Solids of the bench with formulas: a box with beveled edges, and a ball of bone.

The box has normals, one for each of the six sides, twelve bevels and eight corners. Without them no
program could know that the edges are hard.

The ball is a gyroid lattice inside a sphere, with thousands of tunnels. Its mesh follows the
formula by marching tetrahedra: each cube of a grid is cut into six of them, each of which the
surface crosses in one or two triangles, so that the mesh is closed and no case is ambiguous.
Vertices are moved along their edges onto the surface.

Based on: Alan Schoen, "Infinite periodic minimal surfaces without self-intersections", NASA TN
D-5541, 1970; Akio Doi, Akio Koide, "An efficient method of triangulating equi-valued surfaces by
using tetrahedral cells", IEICE Transactions 74(1), 1991.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.mesh import BoolArray, FloatArray, Int64Array, IntArray, Mesh
from texbake.mesh.parametric.grid import grid_quads, split_quads
from texbake.mesh.shapes import cube
from texbake.records import dataclass

_BOX, _BEVEL = 0.5, 0.08  # half its side, how far from an edge its bevel begins
_INNER = _BOX - _BEVEL


def box_value(points: FloatArray) -> FloatArray:
    """(n,) heights of points (n, 3) over the plane of the box that is farthest out."""
    x, y, z = np.abs(points).T
    sides = np.maximum(np.maximum(x, y), z) - _BOX
    edges = np.maximum(np.maximum(x + y, y + z), z + x) - (_BOX + _INNER)
    corners = x + y + z - (_BOX + 2.0 * _INNER)
    return np.asarray(
        np.maximum(np.maximum(sides, edges / math.sqrt(2.0)), corners / math.sqrt(3.0))
    )


def beveled_box(n_triangles: int) -> Mesh:
    """Six sides, twelve bevels and eight corners: a grid with one normal for each."""
    n = max(round(math.sqrt(n_triangles / 15.5)), 1)
    across = max(round(n * math.sqrt(0.5) * _BEVEL / _INNER), 1)
    points: list[FloatArray] = []
    faces: list[IntArray] = []
    counts: list[int] = []
    outs = [np.array(out) for out in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(out)]
    for out in outs:
        sides = {1: (n, n), 2: (across, n), 3: (across, across)}[int(np.abs(out).sum())]
        grid, triangles = _grid_between(_facet(out), *sides)
        a, b, c = np.moveaxis(grid[triangles], 1, 0)
        across_out = pm.vecdot(np.cross(b - a, c - a), out)
        triangles = triangles[np.abs(across_out) > 1e-15]
        faces.append(triangles[:, :: int(np.sign(across_out.sum()))] + sum(map(len, points)))
        points.append(grid)
        counts.append(len(triangles))
    ids = np.repeat(np.arange(len(outs)), counts)
    used, corners = np.unique(np.concatenate(faces), return_inverse=True)
    return Mesh(
        positions=np.concatenate(points)[used],
        faces=corners.reshape(-1, 3).astype(np.int32),
        normals=np.array(outs),
        normal_faces=np.stack([ids] * 3, axis=1).astype(np.int32),
        name="beveled box",
    )


def _facet(out: FloatArray) -> FloatArray:
    """(4, 3) corners in turn around the facet that faces a direction; of three, the last twice."""
    ring = ((-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0))
    axes, free = np.flatnonzero(out), np.flatnonzero(out == 0.0)
    chosen = [int(axes[i]) for i in ((0, 0, 0, 0), (0, 0, 1, 1), (0, 1, 2, 2))[len(axes) - 1]]
    corners = np.repeat(_INNER * out[None], 4, axis=0)
    for corner, axis, signs in zip(corners, chosen, ring, strict=True):
        corner[axis] = _BOX * out[axis]
        corner[free] = _INNER * np.array(signs)[2 - len(free) :]
    return corners


def _grid_between(corners: FloatArray, n_u: int, n_v: int) -> tuple[FloatArray, IntArray]:
    """Points and triangles of a grid between four corners."""
    u = np.linspace(0.0, 1.0, n_u + 1)[:, None, None]
    v = np.linspace(0.0, 1.0, n_v + 1)[None, :, None]
    a, b, c, d = corners
    grid = (1.0 - u) * ((1.0 - v) * a + v * b) + u * ((1.0 - v) * d + v * c)
    return grid.reshape(-1, 3), split_quads(grid_quads(n_u, n_v))


def cube_with_uvs() -> Mesh:
    """A cube of 8 vertices, its sides beside one another in three columns and two rows."""
    mesh = cube()
    corners = np.empty((12, 3, 2))
    for i, face in enumerate(mesh.faces):
        points = mesh.positions[face]
        normal = np.cross(points[1] - points[0], points[2] - points[0])
        axis, sign = int(np.abs(normal).argmax()), np.sign(normal[np.abs(normal).argmax()])
        side = axis + 3 * (sign < 0)
        first, second = points[:, (axis + 1) % 3], points[:, (axis + 2) % 3]
        square = np.stack([0.5 + sign * first, 0.5 + second], axis=1)
        corners[i] = (0.05 + 0.9 * square + [side % 3, side // 3]) / 3.0
    uvs, places = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    return mesh.replace(uvs=uvs, uv_faces=places.reshape(-1, 3).astype(np.int32))


_TRIANGLES_PER_CELL = 1500.0  # of the lattice; each adds four tunnels
_TRIANGLES_PER_POINT = 1.55  # of the grid, found by counting
_BLEND = 0.02  # width of the rounded edge between the lattice and the ball
_ROUNDS = 32  # halvings of an edge


@dataclass(frozen=True)
class Gyroid:
    """The lattice, with `cells` of its cells across the ball."""

    cells: float
    radius: float = 0.5

    @classmethod
    def of(cls, n_triangles: int) -> Gyroid:
        """Return the lattice that so many triangles show well."""
        return cls(pm.power(n_triangles / _TRIANGLES_PER_CELL * 6.0 / math.pi, 1.0 / 3.0))

    def value(self, points: FloatArray) -> FloatArray:
        """(n,) heights of points (n, 3) over the surface, about in units of length near it."""
        wave = math.pi * self.cells / self.radius
        x, y, z = wave * points.T
        lattice = pm.sin(x) * pm.cos(y) + pm.sin(y) * pm.cos(z) + pm.sin(z) * pm.cos(x)
        lattice, ball = lattice / (1.5 * wave), pm.norm(points, axis=1) - self.radius
        near = np.maximum(_BLEND - np.abs(lattice - ball), 0.0) / _BLEND
        return np.asarray(np.maximum(lattice, ball) + 0.25 * _BLEND * near * near)

    def mesh(self, n_triangles: int) -> Mesh:
        """Return about that many triangles of the surface."""
        n = max(round(pm.power(n_triangles / _TRIANGLES_PER_POINT, 1.0 / 3.0)), 4)
        half = 1.05 * self.radius
        axis = np.linspace(-half, half, n + 1)
        points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
        return _marched(self.value, points, n)


def _marched(value: Callable[[FloatArray], FloatArray], points: FloatArray, n: int) -> Mesh:
    is_inside = value(points) < 0.0
    triangles = np.concatenate([_crossed(cut, is_inside, points) for cut in _tetrahedra(n)])
    edges = triangles.reshape(-1, 2)
    keys, corners = np.unique(
        edges.min(axis=1) * len(points) + edges.max(axis=1), return_inverse=True
    )
    ends = np.stack(np.divmod(keys, len(points)), axis=1)
    ends = np.where(is_inside[ends[:, :1]], ends, ends[:, ::-1])
    inner, outer = points[ends[:, 0]], points[ends[:, 1]]
    for _ in range(_ROUNDS):
        middle = 0.5 * (inner + outer)
        below = value(middle)[:, None] < 0.0
        inner, outer = np.where(below, middle, inner), np.where(below, outer, middle)
    faces = corners.reshape(-1, 3).astype(np.int32)
    return Mesh(positions=0.5 * (inner + outer), faces=faces, name="gyroid")


def _tetrahedra(n: int) -> list[Int64Array]:
    """Six (n³, 4) arrays of grid points: paths along the axes from a corner to the opposite one."""
    steps = np.array([(n + 1) ** 2, n + 1, 1])
    cells = np.arange(n)
    first = (cells[:, None, None] * steps[0] + cells[:, None] * steps[1] + cells).ravel()
    paths = itertools.permutations(range(3))
    return [first[:, None] + np.cumsum([0, *steps[list(path)]]) for path in paths]


def _crossed(corners: Int64Array, is_inside: BoolArray, points: FloatArray) -> Int64Array:
    """(n, 3, 2): triangles across tetrahedra, each corner as the two ends of an edge."""
    corners = corners[(counts := is_inside[corners].sum(axis=1)) % 4 > 0]
    counts = counts[counts % 4 > 0]
    order = np.argsort(~is_inside[corners], axis=1, kind="stable")  # those inside first
    corners = np.take_along_axis(corners, order, axis=1)
    found = []
    for count, cut in (
        (1, [[[0, 1], [0, 2], [0, 3]]]),
        (2, [[[0, 2], [0, 3], [1, 3]], [[0, 2], [1, 3], [1, 2]]]),
        (3, [[[0, 3], [1, 3], [2, 3]]]),
    ):
        some = corners[counts == count]
        for triangle in cut:
            edges = some[:, np.array(triangle)]
            a, b, c = np.moveaxis(points[edges].mean(axis=2), 1, 0)
            out = points[some[:, count:]].mean(axis=1) - points[some[:, :count]].mean(axis=1)
            turned = pm.vecdot(np.cross(b - a, c - a), out) < 0.0
            found.append(np.where(turned[:, None, None], edges[:, ::-1], edges))
    return np.concatenate(found)
