"""Reading glTF 2.0, as .glb or as .gltf with its buffers beside it or in it.

All triangles of the scene are joined into one mesh, in world space, one group for each primitive
of a node, so that a mesh that two nodes place is there twice. `gltf_primitives` says what becomes
of vertices.

Skinned meshes come in the pose they are stored in, without their node's transform, and morph
targets at rest. Where only some primitives have texture coordinates or normals, the others get
zeros.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import MeshError, TexbakeError
from texbake.files import PathLike
from texbake.mesh.compose import is_mirroring, normal_map, signed_tangents, with_alpha
from texbake.mesh.files.gltf_batches import Wanted, read_primitives
from texbake.mesh.files.gltf_document import Document, read_document
from texbake.mesh.files.gltf_nodes import (
    INDICES,
    TRIANGLES,
    PlacedNodes,
    placed_nodes,
    require_placeable,
)
from texbake.mesh.files.gltf_primitives import PrimitiveMesh, read_primitive
from texbake.mesh.files.gltf_uv_sets import further_sets, uv_set_names
from texbake.mesh.files.passed_over import warn_of_gltf
from texbake.mesh.files.source import short_name, without_cycle_search
from texbake.mesh.mesh import FloatArray, IntArray, Mesh, check_corner_count
from texbake.mesh.uv_sets import UvSet, require_few_sets

_BATCH = 1 << 16  # rows moved at once


def read_gltf(path: PathLike) -> Mesh:
    """Read a .glb or .gltf file; see the module for how a scene is converted.

    Positions, NORMAL, TEXCOORD_n (v turned up), TANGENT where all primitives have it, and COLOR_0.
    Groups are named after the node, else the mesh.
    """
    with without_cycle_search():
        placed = placed_nodes(read_document(path))
        require_placeable(placed)
        parts = _placed_parts(placed)
    if not parts.nodes:
        raise MeshError(f"{path}: it has no faces; a mesh needs at least one triangle")
    warn_of_gltf(placed.document)
    return _joined(parts, placed.mesh_matrices(placed.matrices())[parts.nodes], Path(path).name)


@dataclass(eq=False)
class _Parts:
    """The parts of a mesh, one for each primitive of a node, in order.

    Attributes
    ----------
    uv_sets : list of dict
        Number of each further set of texture coordinates of a part, by name.
    nodes : list of int
        Place of the node of each part.
    """

    pieces: list[PrimitiveMesh] = field(default_factory=list)
    uv_sets: list[dict[str, int]] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    nodes: list[int] = field(default_factory=list)


def _placed_parts(placed: PlacedNodes) -> _Parts:
    """Read what the nodes of a scene place, each primitive once."""
    reader = _MeshReader(placed.document)
    reader.read_ahead(node["mesh"] for node in placed.nodes if "mesh" in node)
    parts = _Parts()
    n_corners = 0
    for i, node in enumerate(placed.nodes):
        if "mesh" not in node:
            continue
        mesh_name, pieces = reader.mesh(node["mesh"])
        name = short_name(node.get("name") or mesh_name)
        for ending, piece, uv_sets in pieces:
            # Instances could ask for more than the file has; indices are 32-bit.
            n_corners += max(piece.faces.size, len(piece.positions))
            check_corner_count(n_corners, placed.document.path)
            parts.pieces.append(piece)
            parts.uv_sets.append(uv_sets)
            parts.names.append(name + ending)
            parts.nodes.append(i)
    return parts


class _Piece(NamedTuple):
    """A primitive, the ending of its name, and numbers of further UV sets by their names."""

    ending: str
    primitive: PrimitiveMesh
    uv_sets: dict[str, int]


@dataclass(eq=False)
class _MeshReader:
    """Reads the meshes of a document, each once, and primitives that share all arrays once."""

    document: Document
    _meshes: dict[int, tuple[str, list[_Piece]]] = field(default_factory=dict)
    _primitives: dict[Any, PrimitiveMesh | None] = field(default_factory=dict)

    def read_ahead(self, indices: Iterable[Any]) -> None:
        """Read together those primitives of meshes that can be.

        `mesh` reads the others, and says what is wrong with them.
        """
        wanted: dict[Any, Wanted] = {}
        with suppress(TexbakeError):
            for index in dict.fromkeys(index for index in indices if type(index) is int):
                mesh = self.document.item("meshes", index)
                for primitive in self.document.objects(mesh, "primitives"):
                    key = self._key(primitive)
                    if key is not None and key not in wanted:
                        further = further_sets(self.document, primitive)
                        wanted[key] = Wanted(primitive, further=tuple(further))
        pieces = read_primitives(self.document, list(wanted.values()))
        found = zip(wanted, pieces, strict=True)
        self._primitives |= {key: piece for key, piece in found if piece is not None}

    def mesh(self, index: Any) -> tuple[str, list[_Piece]]:
        """Name of a mesh, and its primitives that have triangles."""
        if type(index) is int and index in self._meshes:
            return self._meshes[index]
        mesh = self.document.item("meshes", index)
        primitives = self.document.objects(mesh, "primitives")
        found: list[_Piece] = []
        for i, primitive in enumerate(primitives):
            numbers = further_sets(self.document, primitive)
            piece = self._piece(primitive, numbers)
            if piece is None or len(piece.faces) == 0:
                continue
            names = uv_set_names(self.document, mesh, numbers) if numbers else {}
            uv_sets = {name: number for number, name in names.items()}
            found.append(_Piece("" if len(primitives) == 1 else f" {i}", piece, uv_sets))
        self._meshes[index] = short_name(mesh.get("name") or f"mesh {index}"), found
        return self._meshes[index]

    def _piece(self, primitive: dict[str, Any], further: list[int]) -> PrimitiveMesh | None:
        key = self._key(primitive)
        if key is None:
            return read_primitive(self.document, primitive, further=further)
        if key not in self._primitives:
            self._primitives[key] = read_primitive(self.document, primitive, further=further)
        return self._primitives[key]

    def _key(self, primitive: dict[str, Any]) -> Any:
        """Return a key that primitives with the same arrays share; None where unknown."""
        attributes = self.document.mapping(primitive, "attributes")
        numbers = [primitive.get("mode", TRIANGLES), primitive.get(INDICES, -1)]
        numbers += attributes.values()
        if "extensions" in primitive or set(map(type, numbers)) != {int}:
            return None
        return (*attributes, *numbers)


def _joined(parts: _Parts, matrices: FloatArray, name: str) -> Mesh:
    """Put parts into one mesh, each moved by its matrix."""
    pieces = parts.pieces
    set_names = dict.fromkeys(chain.from_iterable(parts.uv_sets))
    require_few_sets(len(set_names), name)
    joiner = _Joiner(pieces, matrices)
    uvs, uv_faces = joiner.values([piece.uvs for piece in pieces], 2)
    uv_sets = {}
    for set_name in set_names:
        numbers = (sets.get(set_name, -1) for sets in parts.uv_sets)
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
        group_names=tuple(parts.names),
        group_objects=tuple(parts.nodes) if len(set(parts.nodes)) > 1 else (),
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
