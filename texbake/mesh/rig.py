"""What moves a mesh and stands beside it in its file: nodes, skins, animations, cameras, lights.

A `Mesh` is one list of triangles where its file has nodes with meshes. A `Rig` says which node each
object of the mesh came from, and where the node stands, so that a writer can put the triangles
back. All else is glTF's own JSON, which texbake carries along. Readers of other formats build that
JSON from their files.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.files import PathLike
from texbake.mesh.files.node_matrices import matrix_field
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.records import dataclass


@dataclass(frozen=True, kw_only=True, eq=False)
class RigObject:
    """An object of a mesh, and the node that carries it."""

    node: int  # number of the node
    matrix: FloatArray  # (4, 4) float64; from the mesh of the node to the positions of `Mesh`
    fields: Mapping[str, Any] = field(default_factory=dict)  # glTF's fields of its mesh
    n_morphs: int = 0
    ignores_node: bool = False  # whether a skin moves the object, or did, instead of its node


@dataclass(frozen=True, kw_only=True, eq=False)
class Rig:
    """Nodes of a file and what refers to them, as in glTF; accessors are numbers of `arrays`."""

    content: Mapping[str, Any]
    arrays: Mapping[int, npt.NDArray[np.float32]] = field(default_factory=dict)  # each (n, width)
    objects: Mapping[int, RigObject]  # by the numbers of `Mesh.group_objects`
    has_morph_normals: bool = False
    passed_over: tuple[str, ...] = ()  # what else is in the file, such as `2 cameras`

    @property
    def nodes(self) -> list[dict[str, Any]]:
        """JSON of the nodes."""
        return self.content["nodes"]  # type: ignore[no-any-return]

    @property
    def moving_nodes(self) -> set[int]:
        """Nodes that an animation moves."""
        channels = (
            channel["target"]
            for animation in self.content.get("animations", ())
            for channel in animation["channels"]
        )
        return {target["node"] for target in channels if target["path"] != "weights"}

    @property
    def bends(self) -> bool:
        """Whether objects have skins or morph targets."""
        skinned = ("skin" in self.nodes[item.node] for item in self.objects.values())
        return self.has_morphs or any(skinned)

    @property
    def has_morphs(self) -> bool:
        """Whether objects have morph targets."""
        return any(item.n_morphs for item in self.objects.values())

    def object_of(self, group: int, mesh: Mesh) -> RigObject | None:
        """Return the object that a group of a mesh belongs to; None where objects were joined."""
        if mesh.group_objects:
            return self.objects.get(mesh.group_objects[group])
        return next(iter(self.objects.values())) if len(self.objects) == 1 else None

    def fits(self, mesh: Mesh) -> bool:
        """Whether each group of a mesh belongs to an object of the rig."""
        groups = range(len(mesh.group_names)) if mesh.face_groups is not None else [0]
        return all(self.object_of(group, mesh) is not None for group in groups)

    def transformed(self, matrix: FloatArray) -> Rig:
        """Return the rig of a mesh whose positions a (4, 4) matrix has transformed."""
        if (matrix == np.eye(4)).all():
            return self
        number = len(self.nodes)
        scenes = [dict(scene) for scene in self.content["scenes"]]
        first = scenes[self.content.get("scene", 0)]
        root = {"name": "transform", **matrix_field(matrix), "children": first.get("nodes", [])}
        first["nodes"] = [number]
        objects = {
            key: replace(item, matrix=pm.matmul(matrix, item.matrix))
            for key, item in self.objects.items()
        }
        content = {**self.content, "nodes": [*self.nodes, root], "scenes": scenes}
        return replace(self, content=content, objects=objects)


def read_rig(path: PathLike) -> Rig | None:
    """Read the rig of a file; None for formats without one."""
    place = _READERS.get(Path(path).suffix.lower())
    if place is None:
        return None
    module, name = place
    found: Rig = getattr(import_module(f"texbake.mesh.files.{module}"), name)(path)
    return found


_READERS = {
    ".glb": ("gltf_rig", "read_gltf_rig"),
    ".gltf": ("gltf_rig", "read_gltf_rig"),
    ".fbx": ("fbx_rig", "read_fbx_rig"),
}


def moving_ancestors(
    places: Iterable[int], parents: Sequence[int], moving: set[int]
) -> dict[int, int]:
    """Nearest moving node of each node: itself or an ancestor; absent where none moves."""
    known: dict[int, int] = {}
    for place in places:
        at = place
        while at >= 0 and at not in moving:
            at = parents[at]
        if at >= 0:
            known[place] = at
    return known
