"""Rays that are hard: aimed exactly at what triangles have in common, or along a surface."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from catalog.case import Case

from texbake import Mesh
from texbake.mesh.frame import LocalFrame
from texbake.mesh.shapes import cube, icosphere

Array = npt.NDArray[np.float64]


class Aimed(NamedTuple):
    """A closed mesh, targets in its local frame, directions, and whether a miss is a fault."""

    mesh: Mesh
    targets: Array
    directions: Array
    must_hit: bool


def _unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _at_vertices(mesh):
    targets = LocalFrame.around(mesh).to_local(mesh.positions)
    return Aimed(mesh, targets, -_unit(targets), True)


def _at_edges(mesh):
    """At many places along each edge; that of a convex mesh is seen from along its middle."""
    points = LocalFrame.around(mesh).to_local(mesh.positions)
    starts = points[mesh.faces].reshape(-1, 3)
    ends = points[np.roll(mesh.faces, -1, axis=1)].reshape(-1, 3)
    targets = np.concatenate([starts + (ends - starts) * t for t in (0.125, 0.25, 1 / 3, 0.5, 0.9)])
    return Aimed(mesh, targets, -_unit(targets), True)


def _along_faces():
    """Along the sides of a cube, in their very planes."""
    mesh = cube()
    points = LocalFrame.around(mesh).to_local(mesh.positions)
    middles = points[mesh.faces].mean(axis=1)
    edges = points[mesh.faces[:, 1]] - points[mesh.faces[:, 0]]
    return Aimed(mesh, middles, _unit(edges), False)


def _touching():
    mesh = icosphere(4)
    targets = LocalFrame.around(mesh).to_local(mesh.positions)
    along = np.cross(targets, np.random.default_rng(0).normal(size=targets.shape))
    return Aimed(mesh, targets, _unit(along), False)


RAYS: tuple[Case[Aimed], ...] = (
    Case(name="closed mesh hit at vertices", wrong="each triangle leaves the hit to its neighbors",
         make=lambda: _at_vertices(icosphere(4))),
    Case(name="cube hit at corners", wrong="along the diagonal, all sides are hit at their corners",
         make=lambda: _at_vertices(cube())),
    Case(name="closed mesh hit at edges",
         wrong="both faces leave the hit to the other one, or both count it",
         make=lambda: _at_edges(icosphere(3))),
    Case(name="cube hit at edges", wrong="barycentric coordinates come out as -1e-17",
         make=lambda: _at_edges(cube())),
    Case(name="closed mesh hit tangentially",
         wrong="the ray enters through an edge and ends inside", make=_touching),
    Case(name="rays in the plane of a face", wrong="the distance is 0 / 0", make=_along_faces),
)  # fmt: skip
