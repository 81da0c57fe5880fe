"""Writing a `Rig` as glTF: objects of a mesh put back where their nodes are.

Codes of quantized positions count from one corner of the whole mesh, so an object that nothing
bends gets a node below its own that takes the codes there; all others keep floats.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mesh.files.gltf_asset import GltfAsset
from texbake.mesh.files.gltf_compression import Quantization
from texbake.mesh.files.gltf_vertices import Frame
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.rig import Rig, RigObject


class RigWriter:
    """Writes a rig into an asset; `finish` ends it."""

    def __init__(self, asset: GltfAsset, rig: Rig, quantization: Quantization | None) -> None:
        self.asset, self.rig, self.quantization = asset, rig, quantization
        self.nodes = [dict(node) for node in rig.nodes]
        self.scene: list[int] = list(rig.content["scenes"][0]["nodes"])
        self._accessors: dict[int, int] = {}  # those written, by their numbers in the rig

    def frame(self, item: RigObject, mesh: Mesh, faces: npt.NDArray[np.intp]) -> Frame:
        """Return the space in which the faces of an object are written."""
        skin = self.nodes[item.node].get("skin")
        joints = None
        if skin is not None and mesh.deformation is not None:
            vertices = np.unique(mesh.faces[faces])
            bound = mesh.deformation.weights[vertices] > 0.0
            if bound.any():
                joints = self.skins.numbers(skin, mesh.deformation.joints[vertices][bound])
        matrix = inverse(item.matrix)
        return Frame(
            matrix=np.eye(4) if matrix is None else matrix,
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
        *,
        is_coded: bool,
    ) -> None:
        """Add the mesh of an object, and hang it on its node."""
        fields = dict(item.fields)
        if not any("targets" in primitive for primitive in primitives):
            fields.pop("weights", None)
        if extras := {**fields.pop("extras", {}), **extras}:
            fields["extras"] = extras
        mesh = self.asset.add_mesh(fields.pop("name", name), primitives, **fields)
        node = self.nodes[item.node]
        to_node = inverse(item.matrix)
        if to_node is None:  # its scale is 0, so it stays where it is
            self.scene.append(len(self.nodes))
            self.nodes.append({"name": name, "mesh": mesh})
        elif is_coded and self.quantization is not None:
            matrix = pm.matmul(to_node, self.quantization.matrix())
            node.setdefault("children", [])
            node["children"] = [*node["children"], len(self.nodes)]
            self.nodes.append({"mesh": mesh, "matrix": matrix.T.ravel().tolist()})
        else:
            node["mesh"] = mesh
        if not any("JOINTS_0" in primitive["attributes"] for primitive in primitives):
            node.pop("skin", None)

    @cached_property
    def skins(self) -> _Skins:
        """Its skins, which may get more joints."""
        return _Skins(self.rig)

    def finish(self) -> None:
        """Write nodes, skins, animations, cameras and lights."""
        meshes = {number for number, node in enumerate(self.nodes) if "mesh" in node}
        for number, node in enumerate(self.nodes):
            if number not in meshes:
                node.pop("skin", None)
                node.pop("weights", None)
        content = {
            "nodes": self.nodes,
            "scenes": [{**self.rig.content["scenes"][0], "nodes": self.scene}],
            **{key: self.rig.content[key] for key in ("cameras",) if key in self.rig.content},
        }
        skins = list(self._skins())
        if skins and any("skin" in node for node in self.nodes):
            content["skins"] = skins
        else:
            for node in self.nodes:
                node.pop("skin", None)
        if animations := list(self._animations(meshes)):
            content["animations"] = animations
        if "extensions" in self.rig.content:
            content["extensions"] = self.rig.content["extensions"]
        used = {name for node in self.nodes for name in node.get("extensions", ())}
        for name in sorted({*used, *content.get("extensions", ())}):
            self.asset.use(name)
        self.asset.adopt(content)

    def _skins(self) -> Iterator[dict[str, Any]]:
        for number, skin in enumerate(self.rig.content.get("skins", ())):
            made = {**skin, "joints": self.skins.joints[number]}
            if "inverseBindMatrices" in skin:
                matrices = self.skins.matrices[number].astype(np.float32)
                made["inverseBindMatrices"] = self.asset.add_array(matrices)
            yield made

    def _animations(self, meshes: Iterable[int]) -> Iterator[dict[str, Any]]:
        has_morphs = self.asset.meshes_with_targets()
        for animation in self.rig.content.get("animations", ()):
            samplers: list[dict[str, Any]] = []
            channels = []
            for channel in animation["channels"]:
                target = channel["target"]
                if target["path"] == "weights" and (
                    target["node"] not in meshes
                    or self.nodes[target["node"]]["mesh"] not in has_morphs
                ):
                    continue
                sampler = animation["samplers"][channel["sampler"]]
                made = {
                    **sampler,
                    "input": self._accessor(sampler["input"], bounded=True),
                    "output": self._accessor(sampler["output"], bounded=False),
                }
                if made not in samplers:
                    samplers.append(made)
                channels.append({**channel, "sampler": samplers.index(made)})
            if channels:
                yield {**animation, "samplers": samplers, "channels": channels}

    def _accessor(self, number: int, *, bounded: bool) -> int:
        key = 2 * number + bounded
        if key not in self._accessors:
            self._accessors[key] = self.asset.add_array(self.rig.arrays[number], bounded=bounded)
        return self._accessors[key]


class _Skins:
    """Joints of skins, and (n, 16) matrices that take positions to them at rest."""

    def __init__(self, rig: Rig) -> None:
        self.joints: list[list[int]] = []
        self.matrices: list[npt.NDArray[Any]] = []
        self._n_nodes = len(rig.nodes)
        for skin in rig.content.get("skins", ()):
            n = len(skin["joints"])
            unit = np.tile(np.eye(4, dtype=np.float32).ravel(), (n, 1))
            given = skin.get("inverseBindMatrices")
            self.joints.append(list(skin["joints"]))
            self.matrices.append(unit if given is None else rig.arrays[given][:n])

    def numbers(self, skin: int, nodes: IntArray) -> IntArray:
        """(n,) int32: number of each node among the joints of a skin, which gets those it lacks."""
        own = set(self.joints[skin])
        for node in sorted(set(nodes.tolist()) - own):
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


def inverse(matrix: FloatArray) -> FloatArray | None:
    """Inverse of a (4, 4) matrix; None where it has none in numbers worth the name."""
    with np.errstate(all="ignore"):
        determinant = pm.det(matrix[:3, :3])
        if not np.isfinite(determinant) or abs(determinant) < 1e-30:
            return None
        found = pm.inv(matrix)
    return found if np.isfinite(found).all() else None
