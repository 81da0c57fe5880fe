"""What moves the meshes of an FBX file: models as nodes, clusters as joints, shapes and animations.

Nodes are numbered as `FbxScene.models`, after a node that turns and scales the file to Y up and
meters. Animations are sampled at their keys and at least 30 times a second, because glTF
interpolates rotations in another way than FBX. Each shape of a channel is a morph target, also
those in between.

Based on: Autodesk, "FBX SDK Programmer's Guide", 2020; B. Raiskila, "ufbx", 2020, for the matrices
of clusters and for the flags of keys.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import counted
from texbake.files import PathLike
from texbake.mesh.deformation import Deformation, largest_weights
from texbake.mesh.files.fbx_animations import (
    PERCENT,
    Animation,
    Shape,
    full_weights,
    read_animations,
    shape_weights,
)
from texbake.mesh.files.fbx_cameras import (
    LIGHT,
    is_shifted,
    read_camera,
    read_light,
    view_node,
    views_of,
)
from texbake.mesh.files.fbx_curves import Curve
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
from texbake.mesh.files.source import parsed
from texbake.mesh.files.unread_parts import LIGHTS
from texbake.mesh.mesh import FloatArray
from texbake.mesh.rig import (
    Rig,
    RigObject,
    decomposed,
    inverse,
    matrix_field,
    moving_ancestors,
    node_fields,
    node_matrix,
)

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

    def shapes(self, geometry: FbxObject) -> list[Shape]:
        """Morph targets of a geometry."""
        found = [
            Shape(shape.text() or f"shape {i}", shape)
            for i, shape in enumerate(geometry.node.named("Shape"))
        ]
        used: set[Id] = set()  # files could name a large shape very often
        for blend in self._deformers(geometry, "BlendShape"):
            for channel in self._deformers(blend, "BlendShapeChannel"):
                shapes = self.scene.members_of(channel.key, "Geometry")
                if not shapes or any(shape.key in used for shape in shapes):
                    continue
                used |= {shape.key for shape in shapes}
                full = full_weights(channel, len(shapes))
                names = [shape.name or channel.name for shape in shapes[:-1]]
                for place, shape in enumerate(shapes):
                    name = [*names, channel.name][place]
                    found.append(Shape(name, shape.node, channel, full, place))
        return found

    def deformation(
        self, model: FbxObject, geometry: FbxObject, n_vertices: int
    ) -> Deformation | None:
        """Return what moves the vertices of a geometry that a model shows."""
        morphs = tuple(shape.morph(n_vertices) for shape in self.shapes(geometry))
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
            for animation in self.animations
            for key, path in animation.targets
            if key in self.numbers and path in _PLACES
        }
        return moving_ancestors(self.numbers.values(), self.parents, moving) if moving else {}

    @cached_property
    def animations(self) -> list[Animation]:
        """Animations of the scene."""
        return read_animations(self.scene)


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
        self.shapes: dict[int, list[Shape]] = {}  # of each node
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
        left_out = self._add_views(content)
        return Rig(
            content=content,
            arrays=self.arrays,
            objects=objects,
            has_morph_normals=True,
            passed_over=tuple(counted(n, noun) for noun, n in left_out.items() if n),
        )

    def _add_views(self, content: dict[str, Any]) -> Counter[str]:
        """Add cameras and lights; return kinds of those that are left out, with their numbers."""
        scene, nodes, left_out = self.scene, content["nodes"], Counter[str]()
        lights: list[dict[str, Any]] = []
        for item in scene.models:
            number = self.motions.numbers[item.model.key]
            for kind, source in views_of(scene, item.model):
                node = view_node(kind, pm.matmul(scene.axes, self.world[number]))
                light = read_light(scene, source) if kind == LIGHT else None
                if kind == LIGHT and light is None:
                    left_out["area or volume light"] += 1
                    continue
                if node is None:
                    left_out[f"flattened {kind.lower()}"] += 1
                    continue
                if light is not None:
                    node["extensions"] = {LIGHTS: {"light": len(lights)}}
                    lights.append(light)
                else:
                    cameras = content.setdefault("cameras", [])
                    node["camera"] = len(cameras)
                    cameras.append(read_camera(scene, source))
                    left_out["camera shift"] += is_shifted(source)
                nodes[number].setdefault("children", []).append(len(nodes))
                # As Blender calls such nodes: names of nodes are unique in many programs.
                nodes.append({"name": f"{item.model.name}_Orientation", **node})
        if lights:
            content["extensions"] = {LIGHTS: {"lights": lights}}
        return left_out

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
                rest = _weights(shapes, lambda shape: np.array([shape.percent]))
                fields["weights"] = rest[0].tolist()
                fields["extras"] = {"targetNames": [shape.name for shape in shapes]}
                self.shapes[number] = shapes
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
        for animation in self.motions.animations:
            curves = [curve for target in animation.targets for curve in animation.curves(target)]
            begin = min((curve.times[0] for curve in curves), default=0.0)
            samplers: list[dict[str, Any]] = []
            channels: list[dict[str, Any]] = []
            for node, path, times, values in self._channels(animation):
                if np.abs(np.nan_to_num(values, nan=np.inf)).max() > np.finfo(np.float32).max:
                    continue  # huge numbers are damage
                sampler = {
                    "input": self._array((times - begin)[:, None]),
                    "output": self._array(values),
                    "interpolation": "LINEAR",
                }
                channels.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
                samplers.append(sampler)
            if channels:
                yield {"name": animation.name, "samplers": samplers, "channels": channels}

    def _channels(self, animation: Animation) -> Iterator[tuple[int, str, FloatArray, FloatArray]]:
        """Yield node, property, times and values of each animated property."""
        numbers, moved = self.motions.numbers, animation.targets
        models = dict.fromkeys(key for key, path in moved if key in numbers and path in _PLACES)
        for key in models:
            properties = model_properties(self.scene, self.scene.objects[key])
            curves = [curve for path in _PLACES for curve in animation.curves((key, path))]
            if not curves:
                continue
            times = self._times(curves)
            values = [
                animation.at((key, path), times, vectors(properties, path)) for path in _PLACES
            ]
            with np.errstate(over="ignore", invalid="ignore"):
                parts = decomposed(local_matrices(properties, *values))
            for path, rows in zip(_PLACES.values(), parts, strict=True):
                if len(rows) > 1 and (rows[1:] == rows[0]).all():
                    yield numbers[key], path, times[:1], rows[:1]
                else:
                    yield numbers[key], path, times, rows
        for node, shapes in self.shapes.items():
            keys = {shape.channel.key for shape in shapes if shape.channel is not None}
            curves = [
                curve for key in sorted(keys, key=str) for curve in animation.curves((key, PERCENT))
            ]
            if not curves:
                continue
            times = self._times(curves, len(shapes))

            def percents(
                shape: Shape, animation: Animation = animation, times: FloatArray = times
            ) -> FloatArray:
                if shape.channel is None:
                    return np.zeros(len(times))
                target, percent = (shape.channel.key, PERCENT), np.array([shape.percent])
                return animation.at(target, times, percent)[:, 0]

            weights = _weights(shapes, percents)
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


def _weights(shapes: list[Shape], percents: Callable[[Shape], FloatArray]) -> FloatArray:
    """(n, S) weights of shapes by the (n,) percentages of the channel of each."""
    firsts = [shape for shape in shapes if shape.place == 0]  # each before others of its channel
    return np.concatenate([shape_weights(s.full, percents(s)) for s in firsts], axis=1)


def _n_vertices(geometry: FbxObject) -> int:
    return len(geometry.node.numbers("Vertices")) // 3


def _bind(cluster: FbxObject, local: FloatArray) -> FloatArray:
    """(4, 4) matrix from a geometry to the joint of a cluster; `local` leads to the model."""
    values = cluster.node.numbers("Transform").astype(np.float64)
    return pm.matmul(values.reshape(4, 4).T if len(values) == 16 else np.eye(4), local)
