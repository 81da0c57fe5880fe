"""The objects of an FBX file, what connects them, and where its models stand.

From version 7 on objects have numbers, and geometry is an object of its own, which several models
may show. Before, objects are known by class and name, and a model holds its geometry itself.

A point of a model goes through scaling about the scaling pivot, post-rotation, rotation and
pre-rotation about the rotation pivot, and translation::

    T  Roff  Rp  Rpre  R  Rpost^-1  Rp^-1  Soff  Sp  S  Sp^-1

Pre-rotation, post-rotation and the order of rotation count where `RotationActive` is set. The
geometric transform moves the geometry of a model, but not its children.

Based on: Autodesk, "FBX SDK", sample Transformations, 2020, for the ways to inherit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from functools import cached_property
from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, MeshError, quoted
from texbake.files import PathLike
from texbake.mesh.files.fbx_nodes import Node, read_nodes
from texbake.mesh.files.source import decode_name, parsed, read_array, short_name
from texbake.mesh.mesh import FloatArray
from texbake.records import dataclass

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
    """Objects by their ids, and for each id those that are connected to it."""

    path: PathLike  # for messages
    objects: dict[Id, FbxObject]
    # For each id the ids connected to it, each with the name of a property or "".
    members: dict[Id, list[tuple[Id, str]]]
    settings: dict[str, list[Any]]  # the global settings
    defaults: dict[str, dict[str, list[Any]]]  # properties of models and of materials by default
    n_bytes: int  # size of the file
    version: int = 0  # 7400 is 7.4; 0 where the file does not say
    creator: str = ""  # name of the program that wrote the file
    # Contents of images that have been read, by name; many textures may use the same image.
    images: dict[str, bytes] = field(default_factory=dict, repr=False)
    # For each name, the first object whose image has been read.
    named: dict[str, Id] = field(default_factory=dict, repr=False)
    # Results of `first_image` and of `members_of`: many materials may share a texture.
    first_images: dict[Id, tuple[bytes | None, str]] = field(default_factory=dict, repr=False)
    _members: dict[tuple[Id, str], list[FbxObject]] = field(default_factory=dict, repr=False)

    @cached_property
    def axes(self) -> FloatArray:
        """(4, 4) matrix from the axes and the unit of the file to Y up, Z to the front, meters."""
        return scene_axes(_numbers(self.settings))

    @cached_property
    def models(self) -> list[ModelInstance]:
        """All models, depth first, each after its parent."""
        return _all_models(self)

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
    """Read the objects and connections of an FBX file, binary or text."""
    return parsed(path, _read_scene)


def _read_scene(path: PathLike) -> FbxScene:
    data = read_array(path)
    root, version = read_nodes(path, data)
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
        version=version,
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
                values += value().tolist() if callable(value) else [value]
            found[entry.text()] = values
    return found


def _defaults(root: Node, name: str) -> dict[str, list[Any]]:
    for kind in (root.child("Definitions") or Node("")).named("ObjectType"):
        template = kind.child("PropertyTemplate")
        if kind.text() == name and template is not None:
            return read_properties(template)
    return {}


@dataclass(frozen=True, eq=False)
class ModelInstance:
    """A model and where it stands."""

    model: FbxObject
    matrix: FloatArray  # (4, 4) float64; of its geometry to the world: Y up, meters
    is_shown: bool
    transform: NodeTransform  # of itself, to the axes of the file
    parent: Id | None  # the model above it


def model_instances(scene: FbxScene) -> list[ModelInstance]:
    """Models that are shown, or all if no mesh is, depth first, each after its parent."""
    shown = [item for item in scene.models if item.is_shown]
    return shown if any(model_geometry(scene, item.model) for item in shown) else scene.models


def _all_models(scene: FbxScene) -> list[ModelInstance]:
    models = {key: item for key, item in scene.objects.items() if item.node.name == "Model"}
    children: dict[Id, list[Id]] = {}
    seen: set[Id] = set()
    for owner, members in scene.members.items():
        if owner in models:
            own = [m for m, name in members if m in models and not name and m not in seen]
            own = list(dict.fromkeys(own))
            seen.update(own)
            children[owner] = own
    pending: list[tuple[Id, NodeTransform, bool, Id | None]]
    pending = [(key, WORLD, True, None) for key in reversed(models) if key not in seen]
    found = []
    while pending:
        key, parent, is_shown, above = pending.pop()
        model = models[key]
        properties = model_properties(scene, model)
        with np.errstate(over="ignore", invalid="ignore"):
            here = place(parent, properties)
            matrix = pm.matmul(pm.matmul(scene.axes, here.matrix), geometric(properties))
        if not np.isfinite(matrix).all():
            raise MeshError(
                f"{scene.path}: model {quoted(model.name)}: its transform is not finite"
            )
        is_shown &= all(next(iter(properties.get(name, ())), 1) for name in ("Visibility", "Show"))
        found.append(ModelInstance(model, matrix, is_shown, here, above))
        pending += [(child, here, is_shown, key) for child in reversed(children.get(key, ()))]
    if len(found) < len(models):
        raise FileFormatError(f"{scene.path}: its models stand in a cycle; export it again")
    return found


def model_properties(scene: FbxScene, model: FbxObject) -> Properties:
    """Numbers among the properties of a model."""
    return _numbers({**scene.defaults["Model"], **model.properties})


def _numbers(properties: dict[str, list[Any]]) -> dict[str, Sequence[float]]:
    return {
        name: values
        for name, values in properties.items()
        if all(isinstance(value, int | float) for value in values)
    }


def model_geometry(scene: FbxScene, model: FbxObject) -> list[FbxObject]:
    """Objects that hold the polygons of a model, each once: itself, before version 7."""
    if has_polygons(model):
        return [model]
    return list(filter(has_polygons, dict.fromkeys(scene.members_of(model.key, "Geometry"))))


def model_objects(
    scene: FbxScene, models: Iterable[ModelInstance]
) -> list[tuple[ModelInstance, FbxObject]]:
    """Models with the geometries that they show: the objects of the mesh, by their numbers."""
    return [(model, item) for model in models for item in model_geometry(scene, model.model)]


def has_polygons(item: FbxObject) -> bool:
    """Whether an object is a mesh."""
    return item.node.child("PolygonVertexIndex") is not None


Properties = Mapping[str, Sequence[float]]
# Axes in the order in which they turn a point; 6, spherical, is taken as 0.
_ORDERS = ("xyz", "xzy", "yzx", "yxz", "zxy", "zyx")
_ROTATE_FIRST, _USUAL, _WITHOUT_PARENT_SCALE = range(3)


@dataclass(frozen=True, eq=False)
class NodeTransform:
    """Where a model stands."""

    matrix: FloatArray  # (4, 4) float64; to the world
    rotation: FloatArray  # (3, 3) float64; what its children inherit as rotation
    scaling: FloatArray  # (3,) float64; its own scaling


WORLD = NodeTransform(np.eye(4), np.eye(3), np.ones(3))


def place(parent: NodeTransform, properties: Properties) -> NodeTransform:
    """Place a model in its parent, by the way its `InheritType` says."""
    scaling = vectors(properties, "Lcl Scaling")
    rotation = _local_rotation(properties, vectors(properties, "Lcl Rotation"))
    local = _local(properties, vectors(properties, "Lcl Translation"), rotation, scaling)
    kind = _integer(properties, "InheritType", _USUAL)
    matrix = pm.matmul(parent.matrix, local)
    turned = pm.matmul(parent.rotation, rotation)
    if kind in (_ROTATE_FIRST, _WITHOUT_PARENT_SCALE):
        # What of the parent's map is no rotation; its own scaling stays out where asked for.
        stretch = pm.matmul(parent.rotation.T, parent.matrix[:3, :3])
        if kind == _WITHOUT_PARENT_SCALE:
            inverse = np.divide(1.0, parent.scaling, where=parent.scaling != 0, out=np.ones(3))
            stretch = stretch * inverse
        matrix[:3, :3] = pm.matmul(turned, stretch) * scaling
    return NodeTransform(matrix, turned, scaling)


def vectors(properties: Properties, name: str) -> FloatArray:
    """(3,) float64: translation, rotation or scaling of a model by the name of the property."""
    return _vector(properties, name, 1.0 if name == "Lcl Scaling" else 0.0)


def local_matrices(
    properties: Properties, translations: FloatArray, turns: FloatArray, scalings: FloatArray
) -> FloatArray:
    """(n, 4, 4) matrices of a model in its parent, from (n, 3) values of what may be animated."""
    return _local(properties, translations, _local_rotation(properties, turns), scalings)


def _local_rotation(properties: Properties, turns: FloatArray) -> FloatArray:
    """(..., 3, 3) rotations of a model in its parent, from (..., 3) angles in degrees."""
    is_active = bool(_integer(properties, "RotationActive", 0))
    order = _ORDERS[_integer(properties, "RotationOrder", 0) % 6 if is_active else 0]
    rotation = euler_matrices(turns, order)
    if not is_active:
        return rotation
    before = euler_matrices(_vector(properties, "PreRotation"))
    after = euler_matrices(_vector(properties, "PostRotation"))
    return pm.matmul(pm.matmul(before, rotation), after.T)


def _local(
    properties: Properties, translation: FloatArray, rotation: FloatArray, scaling: FloatArray
) -> FloatArray:
    """(..., 4, 4) matrices of a model in its parent."""
    pivot = _vector(properties, "RotationPivot")
    center = _vector(properties, "ScalingPivot")
    # Points stay in place under scaling at its pivot, and under rotation at the other.
    scaled = center - scaling * center + _vector(properties, "ScalingOffset") - pivot
    local = np.zeros((*scaling.shape[:-1], 4, 4))
    local[..., :3, :3] = rotation * scaling[..., None, :]
    local[..., :3, 3] = (
        pm.matvec(rotation, scaled) + pivot + _vector(properties, "RotationOffset") + translation
    )
    local[..., 3, 3] = 1.0
    return local


def geometric(properties: Properties) -> FloatArray:
    """(4, 4) matrix from the geometry of a model to the model."""
    rotation = euler_matrices(_vector(properties, "GeometricRotation"))
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * _vector(properties, "GeometricScaling", 1.0)
    matrix[:3, 3] = _vector(properties, "GeometricTranslation")
    return matrix


def euler_matrices(degrees: FloatArray, order: str = "xyz") -> FloatArray:
    """(..., 3, 3) rotations by (..., 3) angles about the axes, one axis after the other."""
    angles = np.where(np.isfinite(degrees), np.radians(degrees), np.nan)
    cos, sin = pm.cos(angles), pm.sin(angles)
    matrix: FloatArray = np.eye(3)
    for axis in order:
        i = "xyz".index(axis)
        j, k = (i + 1) % 3, (i + 2) % 3
        turn = np.zeros((*degrees.shape, 3))
        turn[..., i, i] = 1.0
        turn[..., j, j] = turn[..., k, k] = cos[..., i]
        turn[..., k, j], turn[..., j, k] = sin[..., i], -sin[..., i]
        matrix = pm.matmul(turn, matrix)
    return matrix


def _vector(properties: Properties, name: str, default: float = 0.0) -> FloatArray:
    values = properties.get(name, ())
    return np.array(values[:3], np.float64) if len(values) >= 3 else np.full(3, default)


def _integer(properties: Properties, name: str, default: int) -> int:
    values = properties.get(name, ())
    return int(values[0]) if len(values) and math.isfinite(values[0]) else default


def scene_axes(settings: Properties) -> FloatArray:
    """(4, 4) matrix from the axes and the unit of a file to Y up, Z to the front, and meters."""
    axes = np.zeros((3, 3))
    for row, (name, default) in enumerate((("Coord", 0), ("Up", 1), ("Front", 2))):
        axis = _integer(settings, f"{name}Axis", default)
        sign = _integer(settings, f"{name}AxisSign", 1)
        if 0 <= axis < 3:
            axes[row, axis] = -1.0 if sign < 0 else 1.0
    if abs(pm.det(axes)) != 1.0:
        axes = np.eye(3)
    unit = next(iter(settings.get("UnitScaleFactor", ())), 1.0)
    meters = 0.01 * unit if 0.0 < unit < math.inf else 0.01
    matrix = np.eye(4)
    matrix[:3, :3] = axes * meters
    return matrix
