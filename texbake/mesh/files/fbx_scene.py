"""The objects of an FBX file, what connects them, and where its models stand.

From version 7 on objects have numbers, and geometry is an object of its own, which several models
may show. Before, objects are known by class and name, and a model holds its geometry itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NoReturn

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, MeshError, quoted
from texbake.files import PathLike
from texbake.mesh.files.fbx_ascii import ascii_version, read_ascii
from texbake.mesh.files.fbx_binary import MAGIC, binary_version, read_binary
from texbake.mesh.files.fbx_nodes import Node
from texbake.mesh.files.fbx_transforms import WORLD, geometric, place, scene_axes
from texbake.mesh.files.source import decode_name, parsed, read_array, short_name
from texbake.mesh.mesh import FloatArray

Id = int | str
_TEXTURES = ("Texture", "LayeredTexture")


@dataclass(frozen=True, eq=False)
class FbxObject:
    """An object of the file: its name, and its class where the file says more than its node."""

    key: Id
    name: str
    kind: str
    node: Node

    @cached_property
    def properties(self) -> dict[str, list[Any]]:
        """Its properties by name; many materials may share one with many."""
        return read_properties(self.node)


@dataclass(frozen=True, eq=False)
class FbxScene:
    """Objects by their ids, and for each id those that are connected to it.

    Attributes
    ----------
    path
        For messages.
    members : dict
        For each id the ids connected to it, each with the name of a property or "".
    settings : dict
        The global settings.
    defaults : dict
        Properties of models and of materials by default.
    n_bytes : int
        Size of the file.
    version : int
        7400 is 7.4; 0 where the file does not say.
    creator : str
        Name of the program that wrote the file.
    images : dict of str to bytes
        Contents of images that have been read, by name; many textures may use the same image.
    named : dict of str to id
        For each name, the first object whose image has been read.
    found : dict of id to (bytes or None, str)
        Results of `first_image` for textures; many materials may share a texture.
    """

    path: PathLike
    objects: dict[Id, FbxObject]
    members: dict[Id, list[tuple[Id, str]]]
    settings: dict[str, list[Any]]
    defaults: dict[str, dict[str, list[Any]]]
    n_bytes: int
    version: int = 0
    creator: str = ""
    images: dict[str, bytes] = field(default_factory=dict, repr=False)
    named: dict[str, Id] = field(default_factory=dict, repr=False)
    found: dict[Id, tuple[bytes | None, str]] = field(default_factory=dict, repr=False)
    _members: dict[tuple[Id, str], list[FbxObject]] = field(default_factory=dict, repr=False)

    def fail(self, what: str) -> NoReturn:
        """Raise `FileFormatError`."""
        raise FileFormatError(f"{self.path}: {what}; export it again")

    def members_of(self, key: Id, node_name: str) -> list[FbxObject]:
        """Objects of a kind of node that are connected to an object, in order."""
        if (key, node_name) not in self._members:
            found = (self.objects.get(member) for member, _ in self.members.get(key, ()))
            self._members[key, node_name] = [
                item for item in found if item is not None and item.node.name == node_name
            ]
        return self._members[key, node_name]

    def textures_of(self, key: Id) -> dict[str, FbxObject]:
        """Textures connected to properties of an object, the first for each property."""
        found: dict[str, FbxObject] = {}
        for member, name in self.members.get(key, ()):
            item = self.objects.get(member)
            if name and item is not None and item.node.name in _TEXTURES:
                found.setdefault(name, item)
        return found


def read_scene(path: PathLike) -> FbxScene:
    """Read the objects and connections of an FBX file, binary or text.

    Raises
    ------
    FileError
        The file is missing or cannot be read.
    FileFormatError
        It is not FBX, or it is damaged.
    """
    return parsed(path, _read_scene)


def _read_scene(path: PathLike) -> FbxScene:
    data = read_array(path)
    is_binary = data[: len(MAGIC)].tobytes() == MAGIC
    root = (read_binary if is_binary else read_ascii)(path, data)
    objects_node = root.child("Objects") or Node("")
    objects: dict[Id, FbxObject] = {}
    for node in objects_node.children:
        item = _object(node)
        objects.setdefault(item.key, item)
    settings = root.child("GlobalSettings") or objects_node.child("GlobalSettings") or Node("")
    return FbxScene(
        path=path,
        objects=objects,
        members=_members(root),
        settings=read_properties(settings),
        defaults={kind: _defaults(root, kind) for kind in ("Model", "Material")},
        n_bytes=len(data),
        version=binary_version(data) if is_binary else ascii_version(data),
        creator=root.child_text("Creator"),
    )


def _object(node: Node) -> FbxObject:
    values = node.values
    if values and isinstance(values[0], int):
        name = node.text(1)
        return FbxObject(values[0], _name_alone(name), node.text(2), node)
    name = node.text(0)
    return FbxObject(_full_name(name), _name_alone(name), node.text(1), node)


def _full_name(name: str) -> str:
    """Return class and name, which binary files write the other way round."""
    short, separator, kind = name.partition("\0\1")
    return f"{kind}::{short}" if separator else name


def _name_alone(name: str) -> str:
    """Return the name of an object without its class."""
    alone, separator, _ = name.partition("\0\1")
    if not separator:
        _, separator, alone = name.partition("::")
    return short_name(alone if separator else name)


def _members(root: Node) -> dict[Id, list[tuple[Id, str]]]:
    members: dict[Id, list[tuple[Id, str]]] = {}
    connections = root.child("Connections")
    for node in () if connections is None else connections.children:
        if len(node.values) < 3:
            continue
        member, owner = (
            _full_name(decode_name(value)) if isinstance(value, bytes) else value
            for value in node.values[1:3]
        )
        if isinstance(member, int | str) and isinstance(owner, int | str):
            members.setdefault(owner, []).append((member, node.text(3)))
    return members


def read_properties(node: Node) -> dict[str, list[Any]]:
    """Values of the properties of a node by their names, those that are numbers or text."""
    found: dict[str, list[Any]] = {}
    # The name is followed by two words on the type, from version 7 on by three.
    for list_name, name, first in (("Properties60", "Property", 3), ("Properties70", "P", 4)):
        for entry in (node.child(list_name) or Node("")).named(name):
            values: list[Any] = []
            for value in entry.values[first:]:
                values += value.load().tolist() if hasattr(value, "load") else [value]
            found[entry.text()] = values
    return found


def _defaults(root: Node, name: str) -> dict[str, list[Any]]:
    for kind in (root.child("Definitions") or Node("")).named("ObjectType"):
        template = kind.child("PropertyTemplate")
        if kind.text() == name and template is not None:
            return read_properties(template)
    return {}


@dataclass(frozen=True, eq=False)
class PlacedModel:
    """A model and the (4, 4) matrix of its geometry to the world: Y up, meters."""

    model: FbxObject
    matrix: FloatArray


def placed_models(scene: FbxScene, *, hidden: bool = False) -> Iterator[PlacedModel]:
    """Models that are shown, or all models with `hidden`, depth first, each after its parent."""
    models = {key: item for key, item in scene.objects.items() if item.node.name == "Model"}
    children: dict[Id, list[Id]] = {}
    seen: set[Id] = set()
    for owner, members in scene.members.items():
        if owner in models:
            own = [m for m, name in members if m in models and not name and m not in seen]
            own = list(dict.fromkeys(own))
            seen.update(own)
            children[owner] = own
    pending = [(key, WORLD, True) for key in reversed(models) if key not in seen]
    n_placed = 0
    axes = scene_axes(_numbers(scene.settings))
    while pending:
        key, parent, is_shown = pending.pop()
        n_placed += 1
        model = models[key]
        properties = _numbers({**scene.defaults["Model"], **model.properties})
        with np.errstate(over="ignore", invalid="ignore"):
            here = place(parent, properties)
            matrix = pm.matmul(pm.matmul(axes, here.matrix), geometric(properties))
        if not np.isfinite(matrix).all():
            raise MeshError(
                f"{scene.path}: model {quoted(model.name)}: its transform is not finite"
            )
        shown = is_shown and _is_visible(properties)
        if shown or hidden:
            yield PlacedModel(model, matrix)
        pending += [(child, here, shown) for child in reversed(children.get(key, ()))]
    if n_placed < len(models):
        scene.fail("its models stand in a cycle")


def _numbers(properties: dict[str, list[Any]]) -> dict[str, Sequence[float]]:
    return {
        name: values
        for name, values in properties.items()
        if all(isinstance(value, int | float) for value in values)
    }


def _is_visible(properties: dict[str, Sequence[float]]) -> bool:
    return all(next(iter(properties.get(name, ())), 1) for name in ("Visibility", "Show"))


def model_geometry(scene: FbxScene, model: FbxObject) -> list[FbxObject]:
    """Objects that hold the polygons of a model, each once: itself, before version 7."""
    if has_polygons(model):
        return [model]
    return list(filter(has_polygons, dict.fromkeys(scene.members_of(model.key, "Geometry"))))


def has_polygons(item: FbxObject) -> bool:
    """Whether an object is a mesh."""
    return item.node.child("PolygonVertexIndex") is not None
