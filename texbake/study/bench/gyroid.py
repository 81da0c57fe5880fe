"""A ball of bone: a gyroid lattice inside a sphere, with a formula and thousands of tunnels.

Its mesh follows the formula by marching tetrahedra: each cube of a grid is cut into six of them,
each of which the surface crosses in one or two triangles, so that the mesh is closed and no case
is ambiguous. Vertices are moved along their edges onto the surface.

Based on: Alan Schoen, "Infinite periodic minimal surfaces without self-intersections", NASA TN
D-5541, 1970; Akio Doi, Akio Koide, "An efficient method of triangulating equi-valued surfaces by
using tetrahedral cells", IEICE Transactions 74(1), 1991.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mesh.mesh import BoolArray, FloatArray, Mesh
from texbake.records import dataclass

Ids = npt.NDArray[np.int64]

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


def _tetrahedra(n: int) -> list[Ids]:
    """Six (n³, 4) arrays of grid points: paths along the axes from a corner to the opposite one."""
    steps = np.array([(n + 1) ** 2, n + 1, 1])
    cells = np.arange(n)
    first = (cells[:, None, None] * steps[0] + cells[:, None] * steps[1] + cells).ravel()
    paths = itertools.permutations(range(3))
    return [first[:, None] + np.cumsum([0, *steps[list(path)]]) for path in paths]


def _crossed(corners: Ids, is_inside: BoolArray, points: FloatArray) -> Ids:
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
