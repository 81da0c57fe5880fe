"""What moves the vertices of a mesh: nodes that they are bound to, and morph targets.

Nodes are those of `texbake.mesh.rig`, by their numbers: the joints of a skin, or the one node that
carries a rigid part. So two parts can share vertices that move alike, whatever their skins are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import MeshError
from texbake.records import dataclass

_Floats = npt.NDArray[np.float64]
_Ints = npt.NDArray[np.int32]


def _read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Read-only view of an array."""
    view = array.view()
    view.flags.writeable = False
    return view


@dataclass(frozen=True, eq=False)
class Morph:
    """Displacements of one morph target; vertices that it does not list stay in place."""

    vertices: _Ints  # (n,) int32; ascending
    displacements: _Floats  # (n, 3) float64; in the space of the mesh's positions

    def __post_init__(self) -> None:
        if np.shape(self.displacements) != (len(self.vertices), 3):
            raise MeshError("morph target: vertices and displacements differ in length")
        for name in ("vertices", "displacements"):
            object.__setattr__(self, name, _read_only(getattr(self, name)))

    @classmethod
    def of_rows(cls, rows: _Floats) -> Morph:
        """Morph target of (V, 3) displacements."""
        moved = np.flatnonzero(rows.any(axis=1))
        return cls(moved.astype(np.int32), rows[moved])

    def rows(self, n_vertices: int) -> _Floats:
        """(V, 3) float64: displacements of all vertices."""
        rows = np.zeros((n_vertices, 3))
        rows[self.vertices] = self.displacements
        return rows


@dataclass(frozen=True, eq=False)
class Deformation:
    """What moves the vertices of a mesh.

    `joints`, `weights` (V, K): nodes, and their shares of sum 1 or all 0; `morphs`: numbered as in
    each object; `poses` (P, V, 3): further ones in which a simplified mesh should look right.
    """

    joints: _Ints
    weights: _Floats
    morphs: tuple[Morph, ...] = ()
    poses: _Floats = field(default_factory=lambda: np.zeros((0, 0, 3)))

    def __post_init__(self) -> None:
        shape = np.shape(self.joints)
        n = shape[0] if shape else 0
        if len(shape) != 2 or np.shape(self.weights) != shape:
            raise MeshError("deformation: joints and weights are not two (V, K) arrays")
        if np.shape(self.poses)[1:] != (n if len(self.poses) else 0, 3):
            raise MeshError(f"deformation: poses are not (P, {n}, 3)")
        for morph in self.morphs:
            if len(morph.vertices) and not 0 <= morph.vertices.min() <= morph.vertices.max() < n:
                raise MeshError(f"deformation: a morph target moves vertices beyond the {n} there")
        for name in ("joints", "weights", "poses"):
            object.__setattr__(self, name, _read_only(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.joints)

    @property
    def is_bound(self) -> bool:
        """Whether a node moves any vertex."""
        return bool(self.weights.any())

    def of(self, vertices: npt.NDArray[np.intp] | _Ints) -> Deformation:
        """Return the deformation of some vertices, in their order; vertices may be repeated."""
        morphs = (Morph.of_rows(morph.rows(len(self))[vertices]) for morph in self.morphs)
        poses = self.poses[:, vertices] if len(self.poses) else self.poses
        return Deformation(self.joints[vertices], self.weights[vertices], tuple(morphs), poses)

    def mixed(self, vertices: npt.NDArray[np.intp] | _Ints, shares: _Floats) -> Deformation:
        """Deformation of n vertices that are weighted means of (n, S) others; K joints at most."""
        n, width = len(vertices), self.joints.shape[1]
        morphs = [
            Morph.of_rows(pm.vecmat(shares, morph.rows(len(self))[vertices]))
            for morph in self.morphs
        ]
        joints = self.joints[vertices].reshape(n, -1)
        weights = (self.weights[vertices] * shares[:, :, None]).reshape(n, -1)
        return Deformation(*largest_weights(joints, weights, width), tuple(morphs))

    def moved(self, linear: _Floats) -> Deformation:
        """Return the deformation of a mesh transformed by a map with a (3, 3) linear part."""
        morphs = (
            Morph(morph.vertices, pm.matmul(morph.displacements, linear.T)) for morph in self.morphs
        )
        return Deformation(self.joints, self.weights, tuple(morphs))

    def rows(self, vertices: npt.NDArray[np.intp] | _Ints) -> _Floats:
        """(n, W) float64: all numbers of some vertices, to compare them."""
        moves = (morph.rows(len(self))[vertices] for morph in self.morphs)
        bound = self.weights[vertices] > 0.0
        joints = np.where(bound, self.joints[vertices], -1)
        return np.concatenate([joints, self.weights[vertices], *moves], axis=1, dtype=np.float64)


def largest_weights(joints: _Ints, weights: _Floats, width: int) -> tuple[_Ints, _Floats]:
    """(n, width) joints of (n, m), each once, with the largest weights, of sum 1 or all 0."""
    n = len(joints)
    order = np.argsort(joints, axis=1, kind="stable")
    joints = np.take_along_axis(joints, order, axis=1)
    weights = np.take_along_axis(weights, order, axis=1)
    is_first = np.ones(joints.shape, np.bool_)
    is_first[:, 1:] = joints[:, 1:] != joints[:, :-1]
    # Number the runs of equal joints, row after row.
    runs = np.cumsum(is_first, axis=None).reshape(joints.shape) - 1
    sums = np.zeros(joints.shape)
    sums[is_first] = np.bincount(runs.ravel(), weights.ravel())
    order = np.argsort(-sums, axis=1, kind="stable")[:, :width]
    joints = np.take_along_axis(joints, order, axis=1)
    sums = np.take_along_axis(sums, order, axis=1)
    totals = np.zeros((n, 1))
    for column in sums.T:  # in order, whatever the processor
        totals[:, 0] += column
    sums = np.divide(sums, totals, out=np.zeros_like(sums), where=totals > 0.0)
    return np.where(sums > 0.0, joints, 0).astype(np.int32), sums


def joined_deformations(parts: Sequence[tuple[Deformation | None, int]]) -> Deformation | None:
    """Join the deformations of parts with so many vertices each; None where no part has one."""
    found = [part for part, _ in parts if part is not None]
    if not found:
        return None
    n = sum(length for _, length in parts)
    width = max(part.joints.shape[1] for part in found)
    joints, weights = np.zeros((n, width), np.int32), np.zeros((n, width))
    vertices: list[list[_Ints]] = [[] for _ in range(max(len(part.morphs) for part in found))]
    moves: list[list[_Floats]] = [[] for _ in vertices]
    start = 0
    for part, length in parts:
        if part is not None:
            joints[start : start + length, : part.joints.shape[1]] = part.joints
            weights[start : start + length, : part.joints.shape[1]] = part.weights
            for i, morph in enumerate(part.morphs):
                vertices[i].append(morph.vertices + np.int32(start))
                moves[i].append(morph.displacements)
        start += length
    morphs = (
        Morph(np.concatenate(rows), np.concatenate(steps))
        for rows, steps in zip(vertices, moves, strict=True)
    )
    return Deformation(joints, weights, tuple(morphs))
