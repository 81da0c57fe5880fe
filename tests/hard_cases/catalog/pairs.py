"""Pairs of meshes that are hard to bake: a high-poly one and a low-poly one with coordinates."""

from typing import NamedTuple

import numpy as np
from catalog.case import Case
from catalog.geometry import mesh_of, moved

from texbake import Mesh
from texbake.mesh.shapes import icosphere, plane, uv_sphere


class Pair(NamedTuple):
    """A high-poly mesh, a low-poly one, and the height of the one over the other at every texel."""

    high: Mesh
    low: Mesh
    height: float


def sheets(*places):
    """Unit squares at (x, z), each a chart; those of sign -1 face down."""
    square, n = plane(), len(places)
    positions, faces, uvs = [], [], []
    for i, (x, z, sign) in enumerate(places):
        positions.append(square.positions + np.array([x, 0.0, z]))
        faces.append((square.faces if sign > 0 else square.faces[:, ::-1]) + 4 * i)
        u = square.uvs[:, 0] if sign > 0 else 1.0 - square.uvs[:, 0]
        uvs.append(np.column_stack([(i + 0.1 + 0.8 * u) / n, 0.1 + 0.8 * square.uvs[:, 1]]))
    corners = np.concatenate(faces)
    return mesh_of(np.concatenate(positions), corners, uvs=np.concatenate(uvs), uv_faces=corners)


def _thin_wall():
    """A wall of 0.01 beside a sheet whose high-poly surface lies 0.1 behind the low-poly one."""
    low, high = (sheets((0, 0, 1), (0, -0.01, -1), (3, z, 1)) for z in (0.0, -0.1))
    return Pair(high, low, 0.0)


def _one_triangle():
    high = mesh_of([[-9.0, -9.0, 0.01], [9.0, -9.0, 0.01], [0.0, 19.0, 0.01]], [[0, 1, 2]])
    return Pair(high, plane(16, 16), 0.01)


PAIRS: tuple[Case[Pair], ...] = (
    Case(name="high-poly mesh coarser than the low-poly one",
         wrong="the ray distance is measured from a few vertices, and rays end before the surface",
         make=_one_triangle),
    Case(name="wall thinner than the cage",
         wrong="rays pass through the wall and hit its other side", make=_thin_wall),
    Case(name="high-poly mesh equal to the low-poly one", wrong="a ray distance of 0 hits nothing",
         make=lambda: Pair(plane(4, 4), plane(4, 4), 0.0)),
    Case(name="high-poly mesh with a hole", wrong="the colors around the hole are smeared over it",
         make=lambda: Pair(
             mesh_of(plane(8, 8).positions, np.delete(plane(8, 8).faces, slice(40, 60), axis=0)),
             plane(4, 4), 0.0)),
    Case(name="high-poly mesh inside out", wrong="every hit is culled, and the map is empty",
         make=lambda: Pair(
             mesh_of(plane(4, 4).positions, plane(4, 4).faces[:, ::-1]), plane(4, 4), 0.0)),
    Case(name="high-poly mesh elsewhere", wrong="rays of unlimited length hit whatever lies behind",
         make=lambda: Pair(moved(icosphere(1), 1.0, (1e3, 0.0, 0.0)), uv_sphere(6, 12), 0.0),
         traits=frozenset({"apart"})),
)  # fmt: skip
