"""Writing a `Rig` as glTF: objects of a mesh put back where their nodes are.

Quantized positions count from one corner of the whole mesh, so a rigid object gets a node below its
own, whose matrix undoes the quantization; objects with joints or morph targets keep floats. A
skinned object is written where `Mesh` has it, in the pose that it is stored in, and its skin binds
it there. An object whose node cannot place it gets a node of its own at the root of the scene.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.files.gltf_asset import GltfAsset
from texbake.mesh.files.gltf_compression import Grid, Quantization
from texbake.mesh.files.gltf_vertices import Frame
from texbake.mesh.files.unread_parts import LIGHTS
from texbake.mesh.mesh import AnyArray, FloatArray, IndexArray, IntArray, Mesh
from texbake.mesh.rig import Rig, RigObject, inverse, matrix_field


class RigWriter:
    """Writes a rig into an asset; `finish` ends it."""

    def __init__(self, asset: GltfAsset, rig: Rig, quantization: Quantization | None) -> None:
        self.asset, self.rig, self.quantization = asset, rig, quantization
        self.nodes = [dict(node) for node in rig.nodes]
        self.scene: list[int] = list(rig.content["scenes"][0]["nodes"])
        self.placed_apart: dict[str, list[str]] = {}  # objects at the root, by the reason
        self._apart: dict[int, int] = {}  # the nodes of those, by the nodes that they came from
        self._with_targets: set[int] = set()  # meshes with morph targets
        # Meshes by their nodes, and what is said of the nodes below those.
        self._placed: dict[int, tuple[int, dict[str, Any] | None]] = {}
        self._accessors: dict[tuple[int, bool], int] = {}  # of the arrays of the rig, written once

    def frame(self, item: RigObject, mesh: Mesh, faces: IndexArray, *, is_repeated: bool) -> Frame:
        """Return the space in which the faces of an object are written."""
        skin = self.nodes[item.node].get("skin")
        joints = None
        matrix = inverse(item.matrix)
        if is_repeated and self.quantization is not None and matrix is not None:
            points = mesh.positions[np.unique(mesh.faces[faces])]
            points = pm.matmul(points, matrix[:3, :3].T) + matrix[:3, 3]
            return Frame(matrix, grid=Grid.around(points.min(axis=0), points.max(axis=0)))
        if skin is not None and mesh.deformation is not None and matrix is not None:
            vertices = np.unique(mesh.faces[faces])
            bound = mesh.deformation.weights[vertices] > 0.0
            if bound.any():
                joints = self.skins.numbers(skin, mesh.deformation.joints[vertices][bound])
        return Frame(
            matrix=np.eye(4) if matrix is None or self._ignores_node(item) else matrix,
            joints=joints,
            n_morphs=item.n_morphs if mesh.deformation is not None else 0,
            has_morph_normals=self.rig.has_morph_normals,
        )

    def place(
        self,
        item: RigObject,
        name: str,
        primitives: list[dict[str, Any]],
        extras: dict[str, Any],
        frame: Frame,
    ) -> None:
        """Add the mesh of an object, and hang it on its node."""
        fields = dict(item.fields)
        has_targets = any("targets" in primitive for primitive in primitives)
        if not has_targets:
            fields.pop("weights", None)
        if extras := {**fields.pop("extras", {}), **extras}:
            fields["extras"] = extras
        mesh = self.asset.add_mesh(fields.pop("name", name), primitives, **fields)
        if has_targets:
            self._with_targets.add(mesh)
        node = self.nodes[item.node]
        if any("JOINTS_0" in primitive["attributes"] for primitive in primitives):
            node["mesh"] = mesh
            return
        to_node, codes, below = inverse(item.matrix), None, None
        if self.quantization is not None and frame.is_on_common_grid:
            codes = self.quantization.positions.matrix()
        if to_node is None or self._ignores_node(item):
            why = "its node flattens it" if to_node is None else "it has lost its skin"
            self._place_apart(item, name, mesh, codes, why)
        else:
            if codes is not None:
                below = matrix_field(pm.matmul(to_node, codes))
            elif frame.grid is not None:
                below = frame.grid.place()
            self._placed[item.node] = mesh, below
            self._hang(item.node, mesh, below)
        node.pop("skin", None)

    def place_again(self, item: RigObject, first: RigObject) -> None:
        """Hang the mesh of a first object on the node of one that is the same in its space."""
        self._hang(item.node, *self._placed[first.node])

    def _hang(self, number: int, mesh: int, below: dict[str, Any] | None) -> None:
        """Hang a mesh on a node, or on a new one below it with the fields `below`."""
        node = self.nodes[number]
        if below is None:
            node["mesh"] = mesh
            return
        node["children"] = [*node.get("children", ()), len(self.nodes)]
        self.nodes.append({"mesh": mesh, **below})

    def _ignores_node(self, item: RigObject) -> bool:
        """Whether an object, such as a skinned one, ignores the transform of its node."""
        return item.ignores_node or "skin" in self.rig.nodes[item.node]

    def _place_apart(
        self, item: RigObject, name: str, mesh: int, codes: FloatArray | None, why: str
    ) -> None:
        """Hang a mesh on a new node at the root of the scene."""
        node = self.nodes[item.node]
        apart: dict[str, Any] = {"name": name, "mesh": mesh}
        if codes is not None:
            apart |= matrix_field(codes)
        if "weights" in node:
            apart["weights"] = node.pop("weights")
        self._apart[item.node] = len(self.nodes)
        self.scene.append(len(self.nodes))
        self.nodes.append(apart)
        self.placed_apart.setdefault(why, []).append(name)

    @cached_property
    def skins(self) -> _Skins:
        """Skins of the rig, which may get more joints."""
        return _Skins(self.rig)

    def finish(self) -> None:
        """Write nodes, skins, animations, cameras and lights."""
        for node in self.nodes:
            if "mesh" not in node:
                node.pop("skin", None)
            if node.get("mesh") not in self._with_targets:
                node.pop("weights", None)
        rig, skins = self.rig.content, self._written_skins()
        content = {
            "nodes": self.nodes,
            "scenes": [{**rig["scenes"][0], "nodes": self.scene}],
            "cameras": rig.get("cameras"),
            "skins": skins,
            "animations": list(self._animations()),
        }
        used = {name for node in self.nodes for name in node.get("extensions", ())}
        for name in sorted({*used, *rig.get("extensions", ())}):
            self.asset.use(name)
        self.asset.adopt({key: value for key, value in content.items() if value})
        for name, extension in rig.get("extensions", {}).items():
            self.asset.extend(name, extension)

    def _written_skins(self) -> list[dict[str, Any]]:
        """Write the skins of nodes, which get their new numbers."""
        skins: list[dict[str, Any]] = []
        numbers: dict[int, int] = {}
        for node in self.nodes:
            if "skin" not in node:
                continue
            number = node["skin"]
            if number not in numbers:
                numbers[number] = len(skins)
                skins.append(self._skin(number))
            node["skin"] = numbers[number]
        return skins

    def _skin(self, number: int) -> dict[str, Any]:
        skin = self.rig.content["skins"][number]
        content = {**skin, "joints": self.skins.joints[number]}
        matrices = self.skins.matrices[number].astype(np.float32)
        if "inverseBindMatrices" in skin or (matrices != np.eye(4).ravel()).any():
            content["inverseBindMatrices"] = self.asset.add_array(matrices)
        return content

    @cached_property
    def _moved_nodes(self) -> set[int]:
        """Nodes that animations move: if nothing bends any more, those with something to show."""
        if not self.rig.bends or self._with_targets or any("skin" in n for n in self.nodes):
            return set(range(len(self.nodes)))
        parents = {
            child: parent
            for parent, node in enumerate(self.nodes)
            for child in node.get("children", ())
        }
        found: set[int] = set()
        for number, node in enumerate(self.nodes):
            at: int | None = number
            if {"mesh", "camera"} & node.keys() or LIGHTS in node.get("extensions", ()):
                while at is not None and at not in found:
                    found.add(at)
                    at = parents.get(at)
        return found

    def _animations(self) -> Iterator[dict[str, Any]]:
        for animation in self.rig.content.get("animations", ()):
            samplers: list[dict[str, Any]] = []
            channels = []
            for channel in animation["channels"]:
                target = channel["target"]
                if target["node"] not in self._moved_nodes:
                    continue
                if target["path"] == "weights":
                    node = self._apart.get(target["node"], target["node"])
                    if self.nodes[node].get("mesh") not in self._with_targets:
                        continue
                    target = {**target, "node": node}
                sampler = animation["samplers"][channel["sampler"]]
                written = {
                    **sampler,
                    "input": self._accessor(sampler["input"], bounded=True),
                    "output": self._accessor(sampler["output"], bounded=False),
                }
                if written not in samplers:
                    samplers.append(written)
                channels.append({"sampler": samplers.index(written), "target": target})
            if channels:
                yield {**animation, "samplers": samplers, "channels": channels}

    def _accessor(self, number: int, *, bounded: bool) -> int:
        key = number, bounded
        if key not in self._accessors:
            self._accessors[key] = self.asset.add_array(self.rig.arrays[number], bounded=bounded)
        return self._accessors[key]


class _Skins:
    """Joints of skins, and (n, 16) matrices that take positions of `Mesh` to them at rest."""

    def __init__(self, rig: Rig) -> None:
        self.joints: list[list[int]] = []
        self.matrices: list[AnyArray] = []
        self._n_nodes = len(rig.nodes)
        stored = {rig.nodes[item.node].get("skin"): item.matrix for item in rig.objects.values()}
        for number, skin in enumerate(rig.content.get("skins", ())):
            n = len(skin["joints"])
            unit = np.tile(np.eye(4, dtype=np.float32).ravel(), (n, 1))
            binds = skin.get("inverseBindMatrices")
            self.joints.append(list(skin["joints"]))
            rows = unit if binds is None else rig.arrays[binds][:n]
            to_stored = inverse(stored.get(number, np.eye(4)))
            if to_stored is not None and (to_stored != np.eye(4)).any():
                # The rows of a file are the columns of matrices.
                rows = pm.matmul(to_stored.T, rows.reshape(-1, 4, 4).astype(float)).reshape(-1, 16)
                rows[:, 3::4] = np.array([0.0, 0.0, 0.0, 1.0])  # whatever rounding has left
            self.matrices.append(rows)

    def numbers(self, skin: int, nodes: IntArray) -> IntArray:
        """(n,) int32: number of each node among the joints of a skin, which gets those it lacks."""
        for node in sorted(set(nodes.tolist()) - set(self.joints[skin])):
            for joints, matrices in zip(self.joints, self.matrices, strict=True):
                if node in joints:
                    row = matrices[joints.index(node)][None]
                    self.matrices[skin] = np.concatenate([self.matrices[skin], row])
                    self.joints[skin].append(node)
                    break
        table = np.full(self._n_nodes, -1, np.int32)
        joints = self.joints[skin]
        table[joints[::-1]] = np.arange(len(joints), dtype=np.int32)[::-1]
        return table
