"""Poses of a mesh that a rig deforms: where its vertices are at some times of its animations.

Simplification adds the errors in these poses, so that joints keep the edges at which they bend. A
skin without animation is posed by rotating all its joints. Poses are approximate, which is enough
for that: rotations are interpolated linearly, and so are splines.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.deformation import Deformation
from texbake.mesh.files.node_matrices import inverse_or_identity, node_matrix
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.rig import Rig

_N_POSES = 4
_BEND = 0.35  # sine of half the angle by which joints rotate: 41 degrees

Values = Mapping[tuple[int, str], FloatArray]  # by the number of a node and the animated property


def with_poses(mesh: Mesh, rig: Rig | None) -> Mesh:
    """Return a mesh with a few poses for simplification, if it has a skin or morph targets."""
    deformation = mesh.deformation
    if deformation is None or rig is None or not rig.bends:
        return mesh
    poser = _Poser(rig, mesh)
    poses = np.stack([poser.pose(values) for values in _samples(rig, deformation)])
    finite = poses[[bool(np.isfinite(pose).all()) for pose in poses]]
    return mesh.replace(deformation=replace(deformation, poses=finite))


def _samples(rig: Rig, deformation: Deformation) -> Iterator[Values]:
    """Yield animated values at some times, and trial values of joints and morph targets."""
    animations = rig.content.get("animations", ())
    for i in range(_N_POSES if animations else 0):
        animation = animations[i * len(animations) // _N_POSES]
        yield _sampled(rig, animation, (i + 1) / _N_POSES)
    joints = {joint for skin in rig.content.get("skins", ()) for joint in skin["joints"]}
    if joints and not joints & rig.moving_nodes:
        for axis in range(3):
            turn = np.zeros(4)
            turn[axis], turn[3] = _BEND, math.sqrt(1.0 - _BEND * _BEND)
            yield {(joint, "turn"): turn for joint in joints}
    n_morphs = len(deformation.morphs)
    for first in range(min(n_morphs, 2)):
        weights = np.zeros(n_morphs)
        weights[first::2] = 1.0
        yield {(item.node, "weights"): weights for item in rig.objects.values()}


def _sampled(rig: Rig, animation: Mapping[str, Any], share: float) -> Values:
    """Values at a share of the length of an animation."""
    samplers = animation["samplers"]
    end = max(float(rig.arrays[sampler["input"]].max()) for sampler in samplers)
    start = min(float(rig.arrays[sampler["input"]].min()) for sampler in samplers)
    time = start + share * (end - start)
    found = {}
    for channel in animation["channels"]:
        sampler, target = samplers[channel["sampler"]], channel["target"]
        times = rig.arrays[sampler["input"]][:, 0].astype(np.float64)
        values = rig.arrays[sampler["output"]].astype(np.float64).reshape(len(times), -1)
        if sampler["interpolation"] == "CUBICSPLINE":
            values = np.split(values, 3, axis=1)[1]
        after = int(np.searchsorted(times, time, side="right"))
        before = max(after - 1, 0)
        after = min(after, len(times) - 1)
        span = times[after] - times[before]
        part = (time - times[before]) / span if span > 0.0 else 0.0
        a, b = values[before], values[after]
        if target["path"] == "rotation" and pm.vecdot(a, b) < 0.0:
            b = -b
        found[target["node"], target["path"]] = a + part * (b - a)
    return found


class _Poser:
    """Poses the vertices of a mesh."""

    def __init__(self, rig: Rig, mesh: Mesh) -> None:
        self.rig, self.mesh = rig, mesh
        self._order: list[tuple[int, int]] = []  # nodes with their parents, parents first
        pending = [(root, -1) for root in rig.content["scenes"][0]["nodes"]]
        while pending:
            node, parent = pending.pop()
            self._order.append((node, parent))
            pending += [(child, node) for child in rig.nodes[node].get("children", ())]
        rest = self._world({})
        self._to_nodes = {node: inverse_or_identity(matrix) for node, matrix in rest.items()}
        # From the world back to where a skinned object is stored, by its first joint.
        self._back: dict[int, FloatArray] = {}
        stored = {rig.nodes[item.node].get("skin"): item.matrix for item in rig.objects.values()}
        for number, skin in enumerate(rig.content.get("skins", ())):
            matrix = stored.get(number, np.eye(4))
            binds = rig.arrays.get(skin.get("inverseBindMatrices", -1))
            joints = skin["joints"]
            for row, joint in enumerate(joints):
                bind = np.eye(4) if binds is None else binds[row].reshape(4, 4).T.astype(float)
                if row == 0:
                    back = pm.matmul(matrix, inverse_or_identity(pm.matmul(rest[joint], bind)))
                self._to_nodes[joint] = pm.matmul(bind, inverse_or_identity(matrix))
                self._back[joint] = back

    def pose(self, values: Values) -> FloatArray:
        """(V, 3) positions for some values of nodes."""
        mesh, deformation = self.mesh, self.mesh.deformation
        assert deformation is not None
        points = mesh.positions.copy()
        weights = [value for (_, path), value in values.items() if path == "weights"]
        for i, morph in enumerate(deformation.morphs):
            factor = max((float(row[i]) for row in weights if i < len(row)), default=0.0)
            points[morph.vertices] += factor * morph.displacements
        world = self._world(values)
        matrices = np.tile(np.eye(4)[:3], (len(self.rig.nodes), 1, 1))
        for node in np.unique(deformation.joints[deformation.weights > 0.0]).tolist():
            moved = pm.matmul(world[node], self._to_nodes[node])
            matrices[node] = pm.matmul(self._back.get(node, np.eye(4)), moved)[:3]
        rows = np.concatenate([points, np.ones((len(points), 1))], axis=1)
        posed = np.zeros_like(points)
        for joint, weight in zip(deformation.joints.T, deformation.weights.T, strict=True):
            posed += weight[:, None] * pm.matvec(matrices[joint], rows)
        is_bound = (deformation.weights > 0.0).any(axis=1, keepdims=True)
        return np.where(is_bound, posed, points)

    def _world(self, values: Values) -> dict[int, FloatArray]:
        """(4, 4) matrix of each node to the world."""
        world = {-1: np.eye(4)}
        for node, parent in self._order:
            found = self.rig.nodes[node]
            changed = {
                path: values[node, path]
                for path in ("translation", "rotation", "scale")
                if (node, path) in values
            }
            if changed:
                found = {key: value for key, value in found.items() if key != "matrix"} | changed
            matrix = node_matrix(found)
            if (node, "turn") in values:
                matrix = pm.matmul(matrix, node_matrix({"rotation": values[node, "turn"]}))
            world[node] = pm.matmul(world[parent], matrix)
        return world
