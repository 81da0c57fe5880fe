"""Reading glTF 2.0, as .glb or as .gltf with its buffers beside it or in it.

All triangles of the scene are joined into one mesh, in world space, one group for each primitive
of a node, so that a mesh that two nodes place is there twice. Instances of EXT_mesh_gpu_instancing
are nodes below theirs. `gltf_primitives` says what becomes of vertices.

Skinned meshes come in the pose they are stored in, without their node's transform, and morph
targets at rest; `Mesh.deformation` has what moves them. Where only some primitives have texture
coordinates or normals, the others get zeros.

Files of CAD programs have 100,000 nodes and more, so numbers are checked and matrices computed for
all nodes at once, and multiplied level by level.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, MeshError, counted, quoted, warn_of
from texbake.files import PathLike
from texbake.limits import most_triangles
from texbake.mesh.compose import MeshPart, join_parts
from texbake.mesh.deformation import Deformation, largest_weights
from texbake.mesh.files.conversion import check_corner_count
from texbake.mesh.files.gltf_document import INSTANCING, Document, read_document
from texbake.mesh.files.gltf_primitives import (
    INDICES,
    TRIANGLES,
    PrimitiveRequest,
    further_sets,
    motion_count,
    read_primitives,
    triangle_count,
)
from texbake.mesh.files.source import short_name, without_cycle_search
from texbake.mesh.mesh import FloatArray, Int64Array, IntArray, Mesh, require_few_sets
from texbake.mesh.rig import moving_ancestors, rotation_matrices
from texbake.records import dataclass

_PLACES = {"TRANSLATION": ("translation", 3), "ROTATION": ("rotation", 4), "SCALE": ("scale", 3)}
_MANY_INSTANCES = 100_000  # that any file may have; they take about 1 kB of memory each
_POINTS_AND_LINES = range(4)  # modes of primitives
_MOVES = ("translation", "rotation", "scale")
MAX_TRIANGLES = 20_000_000
"""Triangles, or a third of the vertices, that a file may place if its buffers have fewer bytes.

They take some 1 GB, and 2 GB where no two triangles share a vertex.
"""


def read_gltf(path: PathLike) -> Mesh:
    """Read a .glb or .gltf file; see the module for how a scene is converted."""
    with without_cycle_search():
        placed = scene_nodes(read_document(path))
        check_instance_count(placed)
        parts = _read_parts(placed)
    if not parts:
        raise MeshError(f"{path}: it has no faces; a mesh needs at least one triangle")
    pieces, names, nodes = zip(*parts, strict=True)
    require_few_sets(len({name for piece in pieces for name in piece.uv_sets}), Path(path).name)
    matrices = placed.mesh_matrices(placed.matrices())[list(nodes)]
    groups = list(zip(names, nodes, strict=True))
    return join_parts(pieces, Path(path).name, matrices, groups=groups)


def _read_parts(placed: SceneNodes) -> list[tuple[MeshPart, str, int]]:
    """Read the primitives of nodes, equal ones once, each with a name and the node's place."""
    document = placed.document
    requests: dict[Any, PrimitiveRequest] = {}
    keys: dict[int, list[Any]] = {}  # of the primitives of each mesh
    for node in placed.nodes:
        if "mesh" not in node or (type(node["mesh"]) is int and node["mesh"] in keys):
            continue
        mesh = document.item("meshes", node["mesh"])
        keys[node["mesh"]] = []
        for primitive in document.objects(mesh, "primitives"):
            key = _array_key(document, primitive)
            keys[node["mesh"]].append(key)
            if key not in requests:
                further = further_sets(document, primitive)
                requests[key] = PrimitiveRequest(primitive, further=tuple(further), deforms=True)
    modes = [each.primitive.get("mode", TRIANGLES) for each in requests.values()]
    if n_flat := sum(mode in _POINTS_AND_LINES for mode in modes):
        warn_of(document.path, f"left out {counted(n_flat, 'primitive')} of points or lines")
    pieces = dict(zip(requests, read_primitives(document, list(requests.values())), strict=True))
    parts = []
    n_corners = 0
    motions = _NodeMotions(placed)
    for i, node in enumerate(placed.nodes):
        if "mesh" not in node:
            continue
        mesh = document.item("meshes", node["mesh"])
        name = short_name(node.get("name") or mesh.get("name") or f"mesh {node['mesh']}")
        of_mesh = keys[node["mesh"]]
        for number, key in enumerate(of_mesh):
            piece = pieces[key]
            if piece is None:
                continue
            # Instances could ask for more than the file has; indices are 32-bit.
            n_corners += max(piece.faces.size, len(piece.positions))
            check_corner_count(n_corners, document.path)
            ending = "" if len(of_mesh) == 1 else f" {number}"
            if piece.uv_sets:
                names = _uv_set_names(mesh, requests[key].further)
                sets = {set_name: piece.uv_sets[name] for set_name, name in names.items()}
                piece = replace(piece, uv_sets=sets)
            piece = replace(piece, deformation=motions.of_node(i, piece))
            parts.append((piece, name + ending, i))
    return parts


class _NodeMotions:
    """What moves the vertices of nodes: the joints of a skin, or a node that an animation moves."""

    def __init__(self, placed: SceneNodes) -> None:
        self.placed, document = placed, placed.document
        self._places = {index: place for place, index in enumerate(placed.indices)}
        self._skins: dict[int, IntArray] = {}
        moving = {self._places.get(node, -1) for node in moving_nodes(document)}
        nodes = [i for i, node in enumerate(placed.nodes) if "mesh" in node] if moving else []
        self._movers = moving_ancestors(nodes, placed.parents.tolist(), moving)

    def of_node(self, place: int, piece: MeshPart) -> Deformation | None:
        """Deformation of the vertices of a piece of a node."""
        node, n, stored = self.placed.nodes[place], len(piece.positions), piece.deformation
        morphs = () if stored is None else stored.morphs
        joints, weights = np.zeros((n, 1), np.int32), np.zeros((n, 1))
        if "skin" in node:
            table = self._joints(node["skin"])
            if stored is not None and stored.is_bound and table is not None:
                joints, weights = stored.joints, stored.weights
                is_outside = (joints < 0) | (joints >= len(table))
                if is_outside.any():
                    line = f"a skin has {len(table)} joints; left out vertex joints beyond them"
                    warn_of(self.placed.document.path, line)
                    joints = np.where(is_outside, 0, joints)
                    weights = np.where(is_outside, 0.0, weights)
                    joints, weights = largest_weights(joints, weights, joints.shape[1])
                joints = table[joints]
        elif place in self._movers:
            joints, weights = joints + np.int32(self._movers[place]), weights + 1.0
        if not morphs and not weights.any():
            return None
        return Deformation(joints, weights, morphs)

    def _joints(self, index: Any) -> IntArray | None:
        """(n,) int32: nodes of the joints of a skin; None if one is not in the scene."""
        document = self.placed.document
        if type(index) is not int:
            return None
        if index not in self._skins:
            places: list[int] = []
            with suppress(FileFormatError):  # the rig warns of it
                joints = indices(document, document.item("skins", index), "joints")
                places = [self._places.get(joint, -1) for joint in joints]
            self._skins[index] = np.array(places, np.int32)
        table = self._skins[index]
        return table if len(table) and table.min() >= 0 else None


def moving_nodes(document: Document) -> set[int]:
    """Nodes that animations move, by their places in the file; damaged animations move none."""
    found: set[int] = set()
    animations = document.content.get("animations")
    for animation in animations if isinstance(animations, list) else ():
        with suppress(FileFormatError, AttributeError):
            for channel in document.objects(animation, "channels"):
                target = document.mapping(channel, "target")
                if target.get("path") in _MOVES and type(target.get("node")) is int:
                    found.add(target["node"])
    return found


def _array_key(document: Document, primitive: dict[str, Any]) -> Any:
    """Return a key that primitives with the same arrays share."""
    attributes = document.mapping(primitive, "attributes")
    numbers = [primitive.get("mode", TRIANGLES), primitive.get(INDICES, -1)]
    numbers += attributes.values()
    if {"extensions", "targets"} & primitive.keys() or set(map(type, numbers)) != {int}:
        return id(primitive)
    return (*attributes, *numbers)


def _uv_set_names(mesh: dict[str, Any], numbers: Collection[int]) -> dict[str, str]:
    """Attributes of uv sets by their names: `"extras": {"TEXCOORD_1": "lightmap"}`."""
    extras = mesh.get("extras")
    names: dict[str, str] = {}
    for number in numbers:
        attribute = f"TEXCOORD_{number}"
        name = extras.get(attribute) if isinstance(extras, dict) else None
        is_sound = isinstance(name, str) and name.strip() and name.isprintable()
        names[str(name) if is_sound and name not in names else attribute] = attribute
    return names


@dataclass(frozen=True, eq=False)
class SceneNodes:
    """Nodes of a scene, depth first."""

    document: Document
    nodes: list[dict[str, Any]]  # the objects of the file
    indices: list[int]  # and their places in it
    # (n,) int64; place of each node's parent in the list; -1 for a root.
    parents: Int64Array
    levels: Int64Array  # (n,) int64; how many nodes stand above each

    def matrices(self) -> FloatArray:
        """(n, 4, 4) float64: the matrix of each node to the world."""
        order = np.argsort(self.levels, kind="stable")
        # Nodes in the order of their levels; the world is the parent of the roots.
        numbers = np.empty(len(order) + 1, np.int64)
        numbers[order] = np.arange(len(order))
        numbers[-1] = len(order)
        parents = numbers[self.parents[order]]
        local = _local_matrices(self.document, self.nodes)[order]
        placed = np.empty((len(order) + 1, 4, 4))
        placed[-1] = np.eye(4)
        stops = np.cumsum(np.bincount(self.levels)).tolist()
        # Huge factors may multiply to infinity, which a mesh refuses.
        with np.errstate(over="ignore", invalid="ignore"):
            for start, stop in zip([0, *stops], stops, strict=False):
                placed[start:stop] = pm.matmul(placed[parents[start:stop]], local[start:stop])
        return np.asarray(placed[numbers[:-1]])

    def mesh_matrices(self, matrices: FloatArray) -> FloatArray:
        """(n, 4, 4) float64: matrices of the meshes of nodes; the identity for skinned meshes."""
        matrices = matrices.copy()
        matrices[[i for i, node in enumerate(self.nodes) if "skin" in node]] = np.eye(4)
        return matrices


def check_instance_count(placed: SceneNodes) -> None:
    """Raise `FileFormatError` if a file repeats its triangles too often.

    Nodes can share a mesh, and primitives an accessor, so a small file can ask for more triangles
    than fit into memory. Three vertices count as a triangle, and each further UV set, set of
    joints and morph target once more. This reads no triangle.
    """
    document = placed.document
    counts: dict[int, int] = {}
    n_placed = 0
    for node in placed.nodes:
        index = node.get("mesh")
        if index is None:
            continue
        mesh = document.item("meshes", index)
        if index not in counts:
            counts[index] = 0
            for primitive in document.objects(mesh, "primitives"):
                if n_triangles := triangle_count(document, primitive):
                    position = document.mapping(primitive, "attributes")["POSITION"]
                    n_vertices = document.integer(document.item("accessors", position), "count", 0)
                    n_sets = 1 + len(further_sets(document, primitive))
                    n_sets += motion_count(document, primitive)
                    counts[index] += max(n_triangles, n_vertices // 3) * n_sets
        n_placed += counts[index]
    # A triangle takes more than a byte, unless it is there several times.
    most = most_triangles(MAX_TRIANGLES)
    if n_placed > most and n_placed > document.n_bytes:
        raise FileFormatError(
            f"{document.path}: its nodes repeat {sum(counts.values()):,} triangles up to "
            f"{n_placed:,}, more than {most:,} with their vertices and UV sets; "
            f"if you trust the file, read it with texbake --max-triangles {n_placed}"
        )


def scene_nodes(document: Document) -> SceneNodes:
    """Return the nodes of the scene; without any, each mesh once, where it is."""
    nodes = document.items("nodes")
    if not nodes:
        meshes: list[dict[str, Any]] = [{"mesh": i} for i in range(len(document.items("meshes")))]
        n = len(meshes)
        return SceneNodes(document, meshes, list(range(n)), np.full(n, -1), np.zeros(n, np.int64))
    found: list[dict[str, Any]] = []
    numbers: list[int] = []
    parents: list[int] = []
    levels: list[int] = []
    # Nodes can share the accessors of instances, where one takes 12 bytes: three or so may.
    most, n_copies = max(_MANY_INSTANCES, document.n_bytes // 4), 0
    pending = [(root, -1, 0) for root in reversed(_roots(document, nodes))]
    seen = bytearray(len(nodes))
    while pending:
        index, parent, level = pending.pop()
        if not 0 <= index < len(nodes):
            document.fail(f"it has no nodes[{quoted(index)}]")
        node = nodes[index]
        if seen[index]:
            document.fail(f"nodes[{index}] stands twice in the scene")
        seen[index] = 1
        if "children" in node:
            children = indices(document, node, "children")
            pending += [(child, len(found), level + 1) for child in reversed(children)]
        place, copies = len(found), _instances(document, node, most - n_copies)
        if copies is None:
            found.append(node)
            copies = []
        else:
            found += [{key: node[key] for key in node if key != "mesh"}, *copies]
            n_copies += len(copies)
        # Instances have no number in the file.
        numbers += [index, *range(len(nodes) + place, len(nodes) + place + len(copies))]
        parents += [parent] + [place] * len(copies)
        levels += [level] + [level + 1] * len(copies)
    return SceneNodes(
        document, found, numbers, np.array(parents, np.int64), np.array(levels, np.int64)
    )


def _instances(document: Document, node: dict[str, Any], most: int) -> list[dict[str, Any]] | None:
    """Nodes of the copies of a mesh, to stand below a node; None if it shows its mesh itself."""
    copying = document.mapping(document.mapping(node, "extensions"), INSTANCING)
    accessors = document.mapping(copying, "attributes")
    if "mesh" not in node or "skin" in node or not _PLACES.keys() & accessors.keys():
        return None
    columns = {}
    for attribute, (field, width) in _PLACES.items():
        if attribute in accessors:
            columns[field] = rows = document.accessor(accessors[attribute]).astype(np.float64)
            if rows.shape[1] != width or not np.isfinite(rows).all():
                document.fail(f"{attribute} of instances does not have {width} finite numbers each")
    if len({len(rows) for rows in columns.values()}) > 1:
        document.fail("attributes of instances differ in their counts")
    if len(rows) > most:
        document.fail("its nodes repeat its instances too often")
    lists = {field: rows.tolist() for field, rows in columns.items()}
    own: dict[str, Any] = {key: node[key] for key in ("name", "mesh", "weights") if key in node}
    return [
        {**own, **dict(zip(lists, values, strict=True))}
        for values in zip(*lists.values(), strict=True)
    ]


def _roots(document: Document, nodes: list[dict[str, Any]]) -> list[int]:
    """Indices of the nodes at the top: of the scene, else of the first, else of the whole file."""
    if document.items("scenes"):
        return indices(document, document.item("scenes", document.content.get("scene", 0)), "nodes")
    children = {child for node in nodes for child in indices(document, node, "children")}
    return [i for i in range(len(nodes)) if i not in children]


def indices(document: Document, owner: dict[str, Any], key: str) -> list[int]:
    """A list of indices that an object holds; empty where there is none."""
    found = owner.get(key, [])
    if not isinstance(found, list) or not set(map(type, found)) <= {int, bool}:
        document.fail(f"{quoted(key)} is not a list of indices")
    return found


def _local_matrices(document: Document, nodes: list[dict[str, Any]]) -> FloatArray:
    """(n, 4, 4) matrices of nodes, from their columns or translations, rotations and scales."""
    matrices = np.tile(np.eye(4), (len(nodes), 1, 1))
    others: Sequence[int] = range(len(nodes))
    placed, columns = _rows(document, nodes, others, "matrix", 16)
    matrices[placed] = columns.reshape(-1, 4, 4).swapaxes(1, 2)
    if placed:
        others = sorted(set(others).difference(placed))
    turned, rotations = _rows(document, nodes, others, "rotation", 4)
    matrices[turned, :3, :3] = rotation_matrices(rotations)
    scaled, scales = _rows(document, nodes, others, "scale", 3)
    matrices[scaled, :3, :3] *= scales[:, None]
    moved, translations = _rows(document, nodes, others, "translation", 3)
    matrices[moved, :3, 3] = translations
    return matrices


def _rows(
    document: Document, nodes: list[dict[str, Any]], among: Sequence[int], key: str, width: int
) -> tuple[list[int], FloatArray]:
    """Places of the nodes, among some, that hold numbers, and the (n, width) numbers."""
    places = [i for i in among if nodes[i].get(key) is not None]
    values = [nodes[i][key] for i in places]
    is_sound = set(map(type, values)) <= {list} and set(map(len, values)) <= {width}
    if is_sound and set(map(type, chain.from_iterable(values))) <= {int, float}:
        with suppress(OverflowError):  # integers of JSON have any length
            rows = np.array(values, np.float64).reshape(-1, width)
            if (np.abs(rows) < 1e300).all():
                return places, rows
    for i in places:  # the first that is wrong is named
        document.numbers(nodes[i], key, width)
    return places, np.array(values, np.float64).reshape(-1, width)
