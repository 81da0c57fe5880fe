"""Reading FBX, binary and text, versions 6 and 7; docs/reference/formats.md says what is read.

Each model is a group with its name; if it has several materials, each of them is a group named
``model/material``. Polygons of fewer than three corners, those with a corner that is no vertex, and
holes are left out. Layers hold values for corners, vertices, polygons or the whole, listed or by
index; corners whose index is -1 get zeros. Of the colors at a vertex the first counts. Sets of
texture coordinates that textures name are read in rows that all sets share.

Based on: Autodesk, "FBX SDK Programmer's Guide", 2020; A. Gessler and C. Kerl, "FBX binary file
format specification", Blender developers' blog, 2013.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np

from texbake.errors import FileFormatError, MeshError, counted, quoted, warn_of
from texbake.files import PathLike
from texbake.limits import most_triangles
from texbake.mesh.compose import join_parts
from texbake.mesh.files.conversion import (
    finite_rows,
    finite_vertices,
    linear_colors,
    rows_not_finite,
)
from texbake.mesh.files.fbx_nodes import Node
from texbake.mesh.files.fbx_rig import FbxMotions, read_motions
from texbake.mesh.files.fbx_scene import (
    FbxObject,
    FbxScene,
    Id,
    ModelInstance,
    model_geometry,
    model_instances,
    model_objects,
)
from texbake.mesh.files.source import decode_name
from texbake.mesh.files.unread_parts import unread_parts, warn_of_fbx
from texbake.mesh.hard_edges import Polygons, smoothed_normals
from texbake.mesh.mesh import AnyArray, FloatArray, Int64Array, Mesh
from texbake.mesh.polygons import triangulated
from texbake.mesh.weld import unique_corners, unique_rows
from texbake.records import dataclass

_FIRST_VERSION = 6000
# A file may place this many triangles, or corners per byte: instances can repeat a few very often.
_LEAST_TRIANGLES, _CORNERS_PER_BYTE = 6_000_000, 4


def read_fbx(path: PathLike) -> Mesh:
    """Read an FBX file, its first uvs only; see the module for how a scene is converted."""
    motions = read_motions(path)
    scene = motions.scene
    models = model_instances(scene)
    parts = list(read_parts(scene, models))
    if not parts:
        raise MeshError(f"{path}: {_why_empty(scene)}")
    if not all(item.is_shown for item in models):
        warn_of(path, "all its meshes are hidden; texbake reads them anyway")
    warn_of_fbx(scene, models)
    meshes = [part.mesh(path, motions) for part in parts]
    matrices, numbers = np.array([part.matrix for part in parts]), [part.number for part in parts]
    return join_parts(meshes, Path(path).name, matrices, objects=numbers)


def _why_empty(scene: FbxScene) -> str:
    """Return why a file has no triangles, and what to do."""
    if 0 < scene.version < _FIRST_VERSION:
        major, minor = divmod(scene.version // 100, 10)
        return (
            f"it is FBX {major}.{minor}, but only 6.0 and later are read; export it again as FBX "
            "7.4, or convert it with Autodesk's FBX Converter"
        )
    if any(model_geometry(scene, item) for item in scene.objects.values()):
        return "all its meshes are empty; a mesh needs at least one triangle"
    others = unread_parts(scene)
    has = f", but {', '.join(others)}" if others else ""
    return f"it has no faces{has}; a mesh needs at least one triangle"


@dataclass(frozen=True, eq=False)
class FbxPart:
    """Geometry that a model shows: where, and with which materials."""

    number: int  # of its object
    model: FbxObject
    source: FbxObject  # which holds the geometry
    matrix: FloatArray
    geometry: FbxGeometry
    materials: list[FbxObject]

    def material(self, number: int) -> FbxObject | None:
        """Return a material of the model; None where it has none of this number."""
        return self.materials[number] if 0 <= number < len(self.materials) else None

    def mesh(self, path: PathLike, motions: FbxMotions) -> Mesh:
        """Return the mesh in its own space, with its groups."""
        used, groups = np.unique(self.geometry.face_materials, return_inverse=True)
        names = (f"{self.model.name}/{getattr(self.material(i), 'name', i)}" for i in used.tolist())
        fields = dict(self.geometry.fields)
        n_vertices = len(fields["positions"])
        motion = motions.deformation(self.model, self.source, n_vertices)
        fields["positions"], fields["faces"], fields["colors"] = finite_vertices(
            path, fields["positions"], fields["faces"], fields.get("colors")
        )
        if len(fields["positions"]) < n_vertices:
            motion = None  # vertices that are not finite were left out
        return Mesh(
            **fields,
            deformation=motion,
            face_groups=groups.astype(np.int32),
            group_names=(self.model.name,) if len(used) == 1 else tuple(names),
            name=Path(path).name,
        )


def read_parts(scene: FbxScene, models: Iterable[ModelInstance]) -> Iterator[FbxPart]:
    """Yield the geometry that the models of a scene show, in the order of the tree."""
    read: dict[Id, FbxGeometry | None] = {}
    triangles = most_triangles(_LEAST_TRIANGLES)
    most = max(3 * triangles, _CORNERS_PER_BYTE * scene.n_bytes)
    uv_names = {uv_set_name(item) for item in scene.objects.values() if item.node.name == "Texture"}
    for number, (placed, item) in enumerate(model_objects(scene, models)):
        if item.key not in read:
            name = item.name or placed.model.name
            read[item.key] = _GeometryReader(scene.path, name, item.node).read(uv_names)
        geometry = read[item.key]
        if geometry is None:
            continue
        fields = geometry.fields
        most -= max(fields["faces"].size, fields["positions"].size)
        if most < 0:
            raise FileFormatError(
                f"{scene.path}: it repeats far more triangles than it holds; if you trust the "
                f"file, read it with texbake --max-triangles {10 * triangles}"
            )
        materials = scene.members_of(placed.model.key, "Material")
        yield FbxPart(number, placed.model, item, placed.matrix, geometry, materials)


def uv_set_name(texture: FbxObject) -> str:
    """Name of the set of texture coordinates that a texture lies on; empty where it names none."""
    value = next(iter(texture.properties.get("UVSet", ())), b"")
    return decode_name(value) if isinstance(value, bytes) else ""


_Layer = tuple[FloatArray, Int64Array]  # values, and the row of each corner
_FIELDS = {"Normals": "normals", "UV": "uvs", "Colors": "colors"}


@dataclass(frozen=True, eq=False)
class FbxGeometry:
    """Triangles in the space of their geometry."""

    fields: dict[str, Any]  # fields of `Mesh` but groups and name
    # (F,) int64; number of each triangle's material among those of the model.
    face_materials: Int64Array
    # Each (T, 2) float64; sets of texture coordinates after the first, by their names, in the rows
    # of the first.
    uv_sets: dict[str, FloatArray] = field(default_factory=dict)


class _GeometryReader:
    """Reads a node with `Vertices` and `PolygonVertexIndex`: its corners and polygons."""

    def __init__(self, path: PathLike, name: str, node: Node) -> None:
        self.path, self.node = path, node
        self.where = f"{path}: geometry {quoted(name)}"
        positions = _floats(node, "Vertices")
        self.positions = positions[: len(positions) // 3 * 3].reshape(-1, 3)
        corners = _integers(node.numbers("PolygonVertexIndex"))
        ends = np.flatnonzero(corners < 0)
        # A last polygon that does not end is dropped.
        corners = corners[: ends[-1] + 1 if len(ends) else 0]
        self.sizes = np.diff(ends, prepend=-1)
        self.vertices = np.where(corners < 0, ~corners, corners)
        self.slots, self.polygons = self._triangles()

    def _triangles(self) -> tuple[Int64Array, Int64Array]:
        """Corners and polygons of the triangles that are kept."""
        slots, polygons = triangulated(self.where, self.positions, self.vertices, self.sizes)
        is_bad = self.vertices >= len(self.positions)
        bad = np.zeros(len(self.sizes), np.bool_)
        if is_bad.any():
            polygon_of = np.repeat(np.arange(len(self.sizes)), self.sizes)
            bad[polygon_of[is_bad]] = True
            n_bad = counted(int(np.count_nonzero(bad)), "face")
            warn_of(self.where, f"left out {n_bad} with corners that are not vertices")
        layer = self.node.child("LayerElementHole")
        if layer is not None:
            holes = _integers(layer.numbers("Hole"))[: len(bad)]
            bad[: len(holes)] |= holes != 0
        if not bad.any():
            return slots, polygons
        kept = ~bad[polygons]
        return slots[kept], polygons[kept]

    def read(self, uv_names: Collection[str]) -> FbxGeometry | None:
        """Return triangles, and of the sets after the first those named; None without triangles."""
        if len(self.slots) == 0:
            return None
        is_bad = rows_not_finite(self.positions)
        if is_bad.any() and is_bad[self.vertices[self.slots]].any():
            raise MeshError(f"{self.where}: a value of Vertices is not finite")
        fields: dict[str, Any] = {
            "positions": self.positions,
            "faces": self.vertices[self.slots],
            "polygon_of": self.polygons,
        }
        normals = self._layer(self._first("LayerElementNormal"), "Normals", 3)
        if normals is not None:
            fields |= {"normals": normals[0], "normal_faces": normals[1][self.slots]}
        else:
            fields |= self._smoothing()
        uv_sets, rows = self._uv_sets(uv_names)
        if uv_sets:
            fields |= {"uvs": uv_sets.pop(next(iter(uv_sets))), "uv_faces": rows[self.slots]}
        colors = self._layer(self._first("LayerElementColor"), "Colors", 4)
        if colors is not None:
            values, rows = colors
            fields["colors"] = np.ones((len(self.positions), 4), np.float32)
            slots = self.slots.ravel()[::-1]  # of the colors at a vertex, the first comes last
            with np.errstate(over="ignore"):  # `Mesh` refuses what is not finite
                fields["colors"][self.vertices[slots]] = values[rows[slots]]
            fields["colors"] = linear_colors(fields["colors"])
        return FbxGeometry(fields, self._materials(), uv_sets)

    def _first(self, layer: str) -> Node | None:
        """Return the layer of the least number."""
        return min(self.node.named(layer), key=_number, default=None)

    def _uv_sets(self, names: Collection[str]) -> tuple[dict[str, FloatArray], Int64Array]:
        """Sets by name, the first and those named, and the row of each corner in them all."""
        layers: dict[str, _Layer] = {}
        for layer in sorted(self.node.named("LayerElementUV"), key=_number):
            name = layer.child_text("Name")
            if layers and (name in layers or name not in names):
                continue
            values = self._layer(layer, "UV", 2)
            if values is not None:
                layers[name] = values
            elif not layers:
                break
        if len(layers) < 2:
            rows = next((rows for _, rows in layers.values()), self.vertices)
            return {name: values for name, (values, _) in layers.items()}, rows
        table = np.stack([rows for _, rows in layers.values()], axis=1)
        row_ids, numbers = unique_rows(table.astype(np.int32))
        sets = {name: values[rows[row_ids]] for name, (values, rows) in layers.items()}
        return sets, numbers.astype(np.int64)

    def _smoothing(self) -> dict[str, Any]:
        """Return normals that smoothing makes, as fields; none where no edge is hard."""
        node = self._first("LayerElementSmoothing")
        if node is None:
            return {}
        values = _integers(node.numbers("Smoothing"))
        polygons = Polygons(self.vertices, self.sizes)
        pairs = polygons.pairs(self.slots)
        if node.child_text("MappingInformationType") == "ByEdge":
            edges = _integers(self.node.numbers("Edges"))[: len(values)]
            hard = edges[values[: len(edges)] == 0]
            hard = hard[(hard >= 0) & (hard < len(pairs.keys))]
            is_smooth = ~np.isin(pairs.keys[pairs.one], pairs.keys[hard])
        else:
            places = self._places(node)
            if places is None:
                return {}
            # Groups as bits; 0 makes a polygon flat, as programs mean that write 0 and 1 alone.
            groups = np.maximum(_looked_up(values, places), 0)
            is_smooth = (groups[pairs.one] & groups[pairs.other]) != 0
        faces = self.vertices[self.slots].astype(np.int32)
        return smoothed_normals(self.positions, faces, polygons, self.slots, pairs, is_smooth)

    def _layer(self, node: Node | None, name: str, width: int) -> _Layer | None:
        """Read a layer; None where no corner has a value."""
        if node is None:
            return None
        values = _floats(node, name)
        values = values[: len(values) // width * width].reshape(-1, width)
        values = finite_rows(self.path, values, _FIELDS[name])
        places = self._places(node)
        if places is None or len(values) == 0:
            return None
        is_listed = node.child_text("ReferenceInformationType") == "Direct"
        rows = places
        if not is_listed and node.child(f"{name}Index") is not None:
            rows = _looked_up(_integers(node.numbers(f"{name}Index")), places)
        is_missing = (rows < 0) | (rows >= len(values))
        if is_missing.all():
            return None
        if is_missing.any():
            values = np.concatenate([values, np.zeros((1, width))])
            rows = np.where(is_missing, len(values) - 1, rows)
        if is_listed and len(values) >= len(rows):  # one for each corner
            values, numbers = unique_corners(self.vertices, values[rows])
            rows = numbers.astype(np.int64)
        return values, rows

    def _places(self, node: Node) -> Int64Array | None:
        """(C,) element that each corner takes its value from."""
        mapping = node.child_text("MappingInformationType")
        if mapping == "ByPolygonVertex":
            return np.arange(len(self.vertices))
        if mapping in ("ByVertice", "ByVertex", "ByControlPoint"):
            return self.vertices
        if mapping == "ByPolygon":
            return np.repeat(np.arange(len(self.sizes)), self.sizes)
        return np.zeros_like(self.vertices) if mapping == "AllSame" else None

    def _materials(self) -> Int64Array:
        """(F,) material of each triangle."""
        node = self.node.child("LayerElementMaterial") or Node("")
        ids = _integers(node.numbers("Materials"))
        if len(ids) == 0:
            return np.zeros(len(self.polygons), np.int64)
        is_by_polygon = node.child_text("MappingInformationType") == "ByPolygon"
        return _looked_up(ids, self.polygons if is_by_polygon else 0 * self.polygons)


def _floats(node: Node, name: str) -> FloatArray:
    """(n,) numbers of a child."""
    with np.errstate(invalid="ignore"):  # a signaling NaN is read like any other NaN
        return node.numbers(name).astype(np.float64)


def _looked_up(table: Int64Array, places: Int64Array) -> Int64Array:
    """Return the entries at the places, -1 where the table ends before."""
    found = np.full(places.shape, -1, np.int64)
    is_inside = places < len(table)
    found[is_inside] = table[places[is_inside]]
    return found


def _integers(values: AnyArray) -> Int64Array:
    """Return values as integers; any other value becomes an integer that no array has."""
    if values.dtype.kind in "iu":
        return values.astype(np.int64)
    with np.errstate(invalid="ignore"):
        is_sound = np.abs(values) < 2.0**53
        return np.where(is_sound, values, 2.0**53).astype(np.int64)


def _number(layer: Node) -> int:
    number = layer.values[0] if layer.values else 0
    return number if isinstance(number, int) else 0
