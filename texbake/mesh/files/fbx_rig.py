"""What moves the meshes of an FBX file: models as nodes, clusters as joints, shapes and animations.

Nodes are numbered as `FbxScene.models`, after a node that turns and scales the file to Y up and
meters. Of an animation, the first layer is read, and sampled at its keys and at least 30 times a
second, because glTF interpolates rotations in another way than FBX. Of the shapes of a
channel, the last is its morph target.

Based on: Autodesk, "FBX SDK Programmer's Guide", 2020; B. Raiskila, "ufbx", 2020, for the matrices
of clusters and for the flags of keys.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.files import PathLike
from texbake.mesh.deformation import Deformation, Morph, largest_weights
from texbake.mesh.files.fbx_curves import Curve, read_curve
from texbake.mesh.files.fbx_nodes import Node
from texbake.mesh.files.fbx_scene import (
    FbxObject,
    FbxScene,
    Id,
    geometric,
    local_matrices,
    model_instances,
    model_objects,
    model_properties,
    read_scene,
    vectors,
)
from texbake.mesh.files.node_matrices import (
    decomposed,
    inverse,
    matrix_field,
    node_fields,
    node_matrix,
)
from texbake.mesh.files.source import parsed
from texbake.mesh.files.unread_parts import unread_parts
from texbake.mesh.mesh import FloatArray
from texbake.mesh.rig import Rig, RigObject, moving_ancestors

_MOST_JOINTS = 8  # of a vertex
_PLACES = {"Lcl Translation": "translation", "Lcl Rotation": "rotation", "Lcl Scaling": "scale"}
_RATE = 30.0  # samples per second, at least
_MOST_SAMPLES = 1 << 18  # of a file


class FbxMotions:
    """What moves the geometries of a scene."""

    def __init__(self, scene: FbxScene) -> None:
        self.scene = scene
        self.numbers: dict[Id, int] = {m.model.key: i + 1 for i, m in enumerate(scene.models)}

    def clusters(self, geometry: FbxObject) -> list[tuple[int, FbxObject]]:
        """Clusters of a geometry, each with the number of its joint."""
        found = []
        for skin in self._deformers(geometry, "Skin"):
            for cluster in self._deformers(skin, "Cluster"):
                joints = self.scene.members_of(cluster.key, "Model")
                if joints and joints[0].key in self.numbers:
                    found.append((self.numbers[joints[0].key], cluster))
        return found

    def shapes(self, geometry: FbxObject) -> list[tuple[str, float, Node, Id | None]]:
        """Morph targets of a geometry: name, weight, node, and the channel that sets the weight."""
        found: list[tuple[str, float, Node, Id | None]] = [
            (shape.text() or f"shape {i}", 0.0, shape, None)
            for i, shape in enumerate(geometry.node.named("Shape"))
        ]
        used: set[Id] = set()  # files could name a large shape very often
        for blend in self._deformers(geometry, "BlendShape"):
            for channel in self._deformers(blend, "BlendShapeChannel"):
                shapes = self.scene.members_of(channel.key, "Geometry")
                percent = channel.node.numbers("DeformPercent")
                if shapes and shapes[-1].key not in used:
                    used.add(shapes[-1].key)
                    weight = float(percent[0]) / 100.0 if len(percent) else 0.0
                    found.append((channel.name, weight, shapes[-1].node, channel.key))
        return found

    def deformation(
        self, model: FbxObject, geometry: FbxObject, n_vertices: int
    ) -> Deformation | None:
        """Return what moves the vertices of a geometry that a model shows."""
        morphs = tuple(_morph(node, n_vertices) for _, _, node, _ in self.shapes(geometry))
        joints, weights = self.bindings(geometry, n_vertices)
        number = self.numbers[model.key]
        mover = number if weights.any() else self._movers.get(number)
        if mover is not None:  # moves what no cluster does
            is_free = ~weights.any(axis=1)
            joints[is_free, 0], weights[is_free, 0] = mover, 1.0
        if not morphs and not weights.any():
            return None
        return Deformation(joints, weights, morphs)

    def bindings(
        self, geometry: FbxObject, n_vertices: int
    ) -> tuple[npt.NDArray[np.int32], FloatArray]:
        """(V, K) joints and weights of the vertices of a geometry by its clusters."""
        clusters = self.clusters(geometry)
        if not clusters:
            return np.zeros((n_vertices, 1), np.int32), np.zeros((n_vertices, 1))
        rows, joints, weights = [], [], []
        for joint, cluster in clusters:
            indices = cluster.node.numbers("Indexes").astype(np.int64)
            values = cluster.node.numbers("Weights").astype(np.float64)
            n = min(len(indices), len(values))
            indices, values = indices[:n], values[:n]
            sound = (indices >= 0) & (indices < n_vertices) & (values > 0.0) & np.isfinite(values)
            rows.append(indices[sound])
            weights.append(values[sound])
            joints.append(np.full(np.count_nonzero(sound), joint))
        at, nodes, values = np.concatenate(rows), np.concatenate(joints), np.concatenate(weights)
        order = np.lexsort((nodes, -values, at))
        at, nodes, values = at[order], nodes[order], values[order]
        rank = np.arange(len(at)) - np.searchsorted(at, at)
        kept = rank < _MOST_JOINTS
        at, nodes, values, rank = at[kept], nodes[kept], values[kept], rank[kept]
        width = int(rank.max(initial=0)) + 1
        table, shares = np.zeros((n_vertices, width), np.int32), np.zeros((n_vertices, width))
        table[at, rank], shares[at, rank] = nodes, values
        return largest_weights(table, shares, width)

    def _deformers(self, owner: FbxObject, kind: str) -> list[FbxObject]:
        return [item for item in self.scene.members_of(owner.key, "Deformer") if item.kind == kind]

    @cached_property
    def parents(self) -> list[int]:
        """Number of the parent of each node."""
        parents = [m.parent for m in self.scene.models]
        return [-1, *(0 if parent is None else self.numbers[parent] for parent in parents)]

    @cached_property
    def _movers(self) -> dict[int, int]:
        moving = {
            self.numbers[key]
            for _, curves in self.animations
            for key, path in curves
            if key in self.numbers and path in _PLACES
        }
        return moving_ancestors(self.numbers.values(), self.parents, moving) if moving else {}

    @cached_property
    def animations(self) -> list[tuple[str, dict[tuple[Id, str], dict[int, Curve]]]]:
        """Name and curves of each animation: by what they move, property and axis."""
        scene = self.scene
        owners: dict[Id, list[tuple[Id, str]]] = {}
        for owner, members in scene.members.items():
            for member, name in members:
                if name.startswith("Lcl ") or name == "DeformPercent":
                    owners.setdefault(member, []).append((owner, name))
        found = []
        for stack in (o for o in scene.objects.values() if o.node.name == "AnimationStack"):
            curves: dict[tuple[Id, str], dict[int, Curve]] = {}
            for layer in scene.members_of(stack.key, "AnimationLayer")[:1]:
                for node in scene.members_of(layer.key, "AnimationCurveNode"):
                    axes = self._axes(node)
                    for target in owners.get(node.key, ()) if axes else ():
                        curves.setdefault(target, axes)
            if curves:
                found.append((stack.name, curves))
        return found

    def _axes(self, node: FbxObject) -> dict[int, Curve]:
        axes = {"d|X": 0, "d|Y": 1, "d|Z": 2, "d|DeformPercent": 0}
        found = {}
        for member, name in self.scene.members.get(node.key, ()):
            item = self.scene.objects.get(member)
            if name in axes and item is not None and item.node.name == "AnimationCurve":
                curve = read_curve(item.node)
                if curve is not None:
                    found[axes[name]] = curve
        return found


def _morph(node: Node, n_vertices: int) -> Morph:
    """Morph target of a shape."""
    indices = node.numbers("Indexes").astype(np.int64)
    moves = node.numbers("Vertices").astype(np.float64)
    n = min(len(indices), len(moves) // 3)
    indices, moves = indices[:n], moves[: 3 * n].reshape(-1, 3)
    sound = (indices >= 0) & (indices < n_vertices) & np.isfinite(moves).all(axis=1)
    rows = np.zeros((n_vertices, 3))
    rows[indices[sound]] = moves[sound]
    return Morph.of_rows(rows)


def read_motions(path: PathLike) -> FbxMotions:
    """Read an FBX file with what moves its geometries; in a block of `parsed_once`, once."""
    return parsed(path, _read_motions)


def _read_motions(path: PathLike) -> FbxMotions:
    return FbxMotions(read_scene(path))


def read_fbx_rig(path: PathLike) -> Rig:
    """Read the models of an FBX file as nodes, with skins, shapes and animations."""
    return _RigReader(read_motions(path)).read()


class _RigReader:
    def __init__(self, motions: FbxMotions) -> None:
        self.scene, self.motions = motions.scene, motions
        self.arrays: dict[int, npt.NDArray[np.float32]] = {}
        # For each channel of shapes: nodes, and the number of its morph target there.
        self.targets: dict[Id, list[tuple[int, int]]] = {}
        self.n_morphs: dict[int, int] = {}
        self.n_samples = 0

    def read(self) -> Rig:
        """Return the rig of the scene."""
        parents = list(self.motions.parents)
        nodes: list[dict[str, Any]] = [{"name": "axes", **matrix_field(self.scene.axes)}]
        # Of the nodes, which cannot have shear: it goes into the meshes.
        self.world = [np.eye(4)]
        for number, item in enumerate(self.scene.models, start=1):
            placed = item.transform.matrix
            above = inverse(self.world[parents[number]])
            if above is None and inverse(placed) is not None:
                above, parents[number] = np.eye(4), 0  # its parent would flatten it
            fields = node_fields(placed if above is None else pm.matmul(above, placed))
            nodes.append({"name": item.model.name, **fields})
            self.world.append(pm.matmul(self.world[parents[number]], node_matrix(fields)))
        for number, parent in enumerate(parents):
            if parent >= 0:
                nodes[parent].setdefault("children", []).append(number)
        content: dict[str, Any] = {"nodes": nodes, "scenes": [{"nodes": [0]}]}
        skins: list[dict[str, Any]] = []
        objects = self._objects(nodes, skins)
        if skins:
            content["skins"] = skins
        if animations := list(self._animations()):
            content["animations"] = animations
        others = ("camera", "cameras", "light", "lights")
        return Rig(
            content=content,
            arrays=self.arrays,
            objects=objects,
            has_morph_normals=True,
            passed_over=tuple(p for p in unread_parts(self.scene) if p.endswith(others)),
        )

    def _objects(
        self, nodes: list[dict[str, Any]], skins: list[dict[str, Any]]
    ) -> dict[int, RigObject]:
        objects: dict[int, RigObject] = {}
        models = model_instances(self.scene)
        for key, (item, geometry) in enumerate(model_objects(self.scene, models)):
            number = self.motions.numbers[item.model.key]
            clusters = self.motions.clusters(geometry)
            matrix = pm.matmul(self.scene.axes, self.world[number])
            if clusters:
                matrix = item.matrix
                nodes[number]["skin"] = len(skins)
                local = geometric(model_properties(self.scene, item.model))
                binds = {joint: _bind(cluster, local) for joint, cluster in clusters[::-1]}
                _, weights = self.motions.bindings(geometry, _n_vertices(geometry))
                if not weights.any(axis=1).all():
                    binds.setdefault(number, local)
                skins.append(self._skin(binds))
            shapes = self.motions.shapes(geometry)
            fields: dict[str, Any] = {"name": geometry.name or item.model.name}
            if shapes:
                fields["weights"] = [weight for _, weight, _, _ in shapes]
                fields["extras"] = {"targetNames": [name for name, _, _, _ in shapes]}
            for place, (_, _, _, channel) in enumerate(shapes):
                if channel is not None:
                    self.targets.setdefault(channel, []).append((number, place))
            self.n_morphs[number] = len(shapes)
            objects[key] = RigObject(
                node=number, matrix=matrix, fields=fields, n_morphs=len(shapes)
            )
        return objects

    def _skin(self, binds: dict[int, FloatArray]) -> dict[str, Any]:
        rows = np.array([matrix.T.ravel() for matrix in binds.values()])
        rows[:, 3::4] = np.array([0.0, 0.0, 0.0, 1.0])  # whatever rounding has left
        return {"joints": list(binds), "inverseBindMatrices": self._array(rows)}

    def _array(self, rows: npt.NDArray[Any]) -> int:
        with np.errstate(over="ignore"):
            self.arrays[len(self.arrays)] = rows.astype(np.float32)
        return len(self.arrays) - 1

    def _animations(self) -> Iterator[dict[str, Any]]:
        for name, curves in self.motions.animations:
            starts = [c.times[0] for axes in curves.values() for c in axes.values()]
            begin = min(starts, default=0.0)
            samplers: list[dict[str, Any]] = []
            channels: list[dict[str, Any]] = []
            for node, path, times, values in self._channels(curves):
                sampler = {
                    "input": self._array((times - begin)[:, None]),
                    "output": self._array(values),
                    "interpolation": "LINEAR",
                }
                channels.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
                samplers.append(sampler)
            if channels:
                yield {"name": name, "samplers": samplers, "channels": channels}

    def _channels(
        self, curves: dict[tuple[Id, str], dict[int, Curve]]
    ) -> Iterator[tuple[int, str, FloatArray, FloatArray]]:
        """Yield node, property, times and values of each animated property."""
        numbers = self.motions.numbers
        models = dict.fromkeys(key for key, path in curves if key in numbers and path in _PLACES)
        for key in models:
            properties = model_properties(self.scene, self.scene.objects[key])
            own = {path: curves[key, path] for path in _PLACES if (key, path) in curves}
            times = self._times([c for axes in own.values() for c in axes.values()])
            values = [
                _sampled(own.get(path, {}), times, vectors(properties, path)) for path in _PLACES
            ]
            matrices = local_matrices(properties, *values)
            for path, rows in zip(_PLACES.values(), decomposed(matrices), strict=True):
                if len(rows) > 1 and (rows[1:] == rows[0]).all():
                    yield numbers[key], path, times[:1], rows[:1]
                else:
                    yield numbers[key], path, times, rows
        of_nodes: dict[int, dict[int, Curve]] = {}
        for (key, path), axes in curves.items():
            for node, place in self.targets.get(key, ()) if path == "DeformPercent" else ():
                of_nodes.setdefault(node, {})[place] = axes[0]
        for node, places in of_nodes.items():
            times = self._times(list(places.values()), self.n_morphs[node])
            weights = np.zeros((len(times), self.n_morphs[node]))
            for place, curve in places.items():
                weights[:, place] = curve.at(times) / 100.0
            yield node, "weights", times, weights.reshape(-1, 1)

    def _times(self, curves: list[Curve], width: int = 1) -> FloatArray:
        """Times at which to sample curves, where each sample has `width` values."""
        keys = np.unique(np.concatenate([curve.times for curve in curves]))
        span = float(keys[-1] - keys[0])
        left = max((_MOST_SAMPLES - self.n_samples) // width, 64)
        keys = keys if len(keys) <= left else keys[:: -(-len(keys) // left)]
        n = min(int(span * _RATE) + 1, left)
        grid = keys[0] + span * np.arange(n) / max(n - 1, 1)
        times: FloatArray = np.unique(np.concatenate([keys, grid]))
        # Closer than a thousandth of a second, times may be equal in float32.
        times = times[np.append(True, np.diff(times) > 1e-3)]
        self.n_samples += width * len(times)
        return times


def _n_vertices(geometry: FbxObject) -> int:
    return len(geometry.node.numbers("Vertices")) // 3


def _bind(cluster: FbxObject, local: FloatArray) -> FloatArray:
    """(4, 4) matrix from a geometry to the joint of a cluster; `local` leads to the model."""
    values = cluster.node.numbers("Transform").astype(np.float64)
    return pm.matmul(values.reshape(4, 4).T if len(values) == 16 else np.eye(4), local)


def _sampled(axes: dict[int, Curve], times: FloatArray, default: FloatArray) -> FloatArray:
    rows: FloatArray = np.tile(default, (len(times), 1))
    for axis, curve in axes.items():
        rows[:, axis] = curve.at(times)
    return rows
