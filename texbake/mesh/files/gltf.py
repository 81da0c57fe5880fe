"""Reading glTF 2.0, as .glb or as .gltf with its buffers beside it or in it.

All triangles of the scene are joined into one mesh, in world space, one group for each primitive
of a node, so that a mesh that two nodes place is there twice. `gltf_primitives` says what becomes
of vertices.

Skinned meshes come in the pose they are stored in, without their node's transform, and morph
targets at rest. Where only some primitives have texture coordinates or normals, the others get
zeros.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import MeshError
from texbake.files import PathLike
from texbake.mesh.compose import is_mirroring, normal_map, signed_tangents, with_alpha
from texbake.mesh.files.gltf_document import Document, read_document
from texbake.mesh.files.gltf_nodes import (
    INDICES,
    TRIANGLES,
    SceneNodes,
    check_instance_count,
    further_sets,
    scene_nodes,
)
from texbake.mesh.files.gltf_primitives import PrimitiveMesh, PrimitiveRequest, read_primitives
from texbake.mesh.files.source import short_name, without_cycle_search
from texbake.mesh.files.unread_parts import warn_of_gltf
from texbake.mesh.mesh import FloatArray, IntArray, Mesh, check_corner_count
from texbake.mesh.uv_sets import UvSet, require_few_sets

_BATCH = 1 << 16  # rows moved at once


def read_gltf(path: PathLike) -> Mesh:
    """Read a .glb or .gltf file; see the module for how a scene is converted.

    Positions, NORMAL, TEXCOORD_n (v turned up), TANGENT where all primitives have it, and COLOR_0.
    Groups are named after the node, else the mesh.
    """
    with without_cycle_search():
        placed = scene_nodes(read_document(path))
        check_instance_count(placed)
        parts = _read_parts(placed)
    if not parts:
        raise MeshError(f"{path}: it has no faces; a mesh needs at least one triangle")
    warn_of_gltf(placed.document)
    matrices = placed.mesh_matrices(placed.matrices())[[part.node for part in parts]]
    return _joined(parts, matrices, Path(path).name)


class _Part(NamedTuple):
    """A primitive of a node."""

    primitive: PrimitiveMesh
    uv_sets: dict[str, int]  # numbers of its further sets of texture coordinates, by their names
    name: str
    node: int  # place of the node in the scene


def _read_parts(placed: SceneNodes) -> list[_Part]:
    """Read the primitives of a scene's nodes; the arrays of equal ones are read once."""
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
                requests[key] = PrimitiveRequest(primitive, further=tuple(further))
    pieces = dict(zip(requests, read_primitives(document, list(requests.values())), strict=True))
    parts = []
    n_corners = 0
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
            uv_sets = _uv_set_names(mesh, requests[key].further)
            parts.append(_Part(piece, uv_sets, name + ending, i))
    return parts


def _array_key(document: Document, primitive: dict[str, Any]) -> Any:
    """Return a key that primitives with the same arrays share."""
    attributes = document.mapping(primitive, "attributes")
    numbers = [primitive.get("mode", TRIANGLES), primitive.get(INDICES, -1)]
    numbers += attributes.values()
    if "extensions" in primitive or set(map(type, numbers)) != {int}:
        return id(primitive)
    return (*attributes, *numbers)


def _uv_set_names(mesh: dict[str, Any], numbers: Collection[int]) -> dict[str, int]:
    """Numbers of sets of texture coordinates by their names.

    Files of texbake have names in the `extras` of a mesh, by the names of the attributes:
    `"extras": {"TEXCOORD_1": "lightmap"}`.
    """
    extras = mesh.get("extras")
    names: dict[str, int] = {}
    for number in numbers:
        attribute = f"TEXCOORD_{number}"
        name = extras.get(attribute) if isinstance(extras, dict) else None
        is_sound = isinstance(name, str) and name.strip() and name.isprintable()
        names[str(name) if is_sound and name not in names else attribute] = number
    return names


def _joined(parts: list[_Part], matrices: FloatArray, name: str) -> Mesh:
    """Put parts into one mesh, each moved by its matrix."""
    pieces = [part.primitive for part in parts]
    nodes = [part.node for part in parts]
    set_names = dict.fromkeys(chain.from_iterable(part.uv_sets for part in parts))
    require_few_sets(len(set_names), name)
    joiner = _Joiner(pieces, matrices)
    uvs, uv_faces = joiner.values([piece.uvs for piece in pieces], 2)
    uv_sets = {}
    for set_name in set_names:
        numbers = (part.uv_sets.get(set_name, -1) for part in parts)
        rows = [piece.further_uvs.get(i) for piece, i in zip(pieces, numbers, strict=True)]
        uv_sets[set_name] = UvSet(*joiner.values(rows, 2))
    # A matrix of huge numbers takes finite points to infinity, which `Mesh` refuses.
    with np.errstate(over="ignore", invalid="ignore"):
        positions = joiner.positions()
        normals, normal_faces = joiner.normals()
        tangents = joiner.tangents()
    return Mesh(
        positions=positions,
        faces=joiner.indices([piece.faces for piece in pieces], joiner.n_vertices),
        uvs=uvs,
        uv_faces=uv_faces,
        uv_sets=uv_sets,
        normals=normals,
        normal_faces=normal_faces,
        tangents=tangents,
        colors=joiner.colors(),
        face_groups=np.repeat(np.arange(len(pieces), dtype=np.int32), joiner.n_faces),
        group_names=tuple(part.name for part in parts),
        group_objects=tuple(nodes) if len(set(nodes)) > 1 else (),
        name=name,
    )


class _Joiner:
    """Joins the arrays of parts of a mesh, moved; triangles that are mirrored are turned back."""

    def __init__(self, pieces: list[PrimitiveMesh], matrices: FloatArray) -> None:
        self.pieces = pieces
        self.matrices = matrices
        self.is_mirrored = is_mirroring(matrices[:, :3, :3])
        self.n_vertices = [len(piece.positions) for piece in pieces]
        self.n_faces = [len(piece.faces) for piece in pieces]

    def indices(self, arrays: list[IntArray], n_rows: list[int]) -> IntArray:
        """(F, 3) int32 indices into joined rows, of indices into the rows of each part."""
        starts = np.cumsum([0, *n_rows[:-1]], dtype=np.int32)
        joined = np.concatenate(arrays)
        joined += np.repeat(starts, self.n_faces)[:, None]
        turned = np.repeat(self.is_mirrored, self.n_faces)
        joined[turned] = joined[turned, ::-1]
        return joined

    def values(
        self, rows: Sequence[FloatArray | None], width: int
    ) -> tuple[FloatArray, IntArray] | tuple[None, None]:
        """(n, width) joined rows and the (F, 3) indices of corners; None where no part has any.

        Parts that have none get one row of zeros.
        """
        if all(part is None for part in rows):
            return None, None
        zero = np.zeros((1, width))
        arrays = [zero if part is None else part for part in rows]
        corners = [
            0 * piece.corners if part is None else piece.corners
            for piece, part in zip(self.pieces, rows, strict=True)
        ]
        return np.concatenate(arrays), self.indices(corners, [len(array) for array in arrays])

    def positions(self) -> FloatArray:
        """(V, 3) positions in the world."""
        rows = np.concatenate([piece.positions for piece in self.pieces])
        self._map(rows, self.n_vertices, self.matrices[:, :3, :3])
        rows += np.repeat(self.matrices[:, :3, 3], self.n_vertices, axis=0)
        return rows

    def normals(self) -> tuple[FloatArray, IntArray] | tuple[None, None]:
        """(n, 3) normals in the world and the indices of corners; None where no part has any."""
        given = [piece.normals for piece in self.pieces]
        rows, corners = self.values(given, 3)
        if rows is None or corners is None:
            return None, None
        counts = [1 if part is None else len(part) for part in given]
        self._map(rows, counts, normal_map(self.matrices[:, :3, :3]))
        rows[np.repeat([part is None for part in given], counts)] = 0.0
        return rows, corners

    def tangents(self) -> npt.NDArray[np.float32] | None:
        """(F, 3, 4) tangents in the world; None where a part has none."""
        given = [piece.tangents for piece in self.pieces if piece.tangents is not None]
        if len(given) < len(self.pieces):
            return None
        rows, counts = np.concatenate(given), [len(part) for part in given]
        directions = np.ascontiguousarray(rows[:, :3])
        self._map(directions, counts, self.matrices[:, :3, :3])
        signs = np.repeat(np.where(self.is_mirrored, -1.0, 1.0), counts)[:, None]
        corners = self.indices([piece.corners for piece in self.pieces], counts)
        return signed_tangents(directions, rows[:, 3:], signs)[corners]

    def colors(self) -> npt.NDArray[np.float32] | None:
        """(V, 4) colors, white where a part has none; None where no part has any."""
        if all(piece.colors is None for piece in self.pieces):
            return None
        return np.concatenate(
            [
                np.ones((len(piece.positions), 4), np.float32)
                if piece.colors is None
                else with_alpha(piece.colors)
                for piece in self.pieces
            ]
        )

    def _map(self, rows: FloatArray, counts: list[int], maps: FloatArray) -> None:
        """Apply a (3, 3) map of each part to its rows, in place, as many at once as are alike."""
        n_rows = np.array(counts)
        starts = np.cumsum(n_rows) - n_rows
        order = np.argsort(n_rows, kind="stable")
        for alike in np.split(order, np.flatnonzero(np.diff(n_rows[order])) + 1):
            count = int(n_rows[alike[0]])
            n_parts = max(_BATCH // count, 1)
            for first in range(0, len(alike), n_parts):
                chosen = alike[first : first + n_parts]
                at = starts[chosen, None] + np.arange(count)
                rows[at] = pm.matmul(rows[at], maps[chosen].swapaxes(1, 2))
