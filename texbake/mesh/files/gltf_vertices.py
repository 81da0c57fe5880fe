"""Vertices of GPU streams: corners of a mesh whose attributes all agree, bit for bit, are one.

Where a mesh hangs on nodes, each object is written in the space of its node, or, if it has a skin,
in the space that the skin binds. Displacements of normals of a morph target are computed: those of
the faces around each normal as they are displaced, less those of the same faces at rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import MeshError
from texbake.mesh.compose import corner_order, is_mirroring, normal_map, signed_tangents
from texbake.mesh.deformation import Morph, largest_weights
from texbake.mesh.distance import area_vectors
from texbake.mesh.files.conversion import as_text
from texbake.mesh.files.gltf_compression import (
    Grid,
    Quantization,
    color_codes,
    octahedral_codes,
    ordered_triangles,
    unit_codes,
)
from texbake.mesh.files.gltf_material_write import uv_numbers
from texbake.mesh.materials import UNPLACED, Materials, Placing
from texbake.mesh.mesh import (
    AnyArray,
    Float32Array,
    FloatArray,
    IndexArray,
    Int64Array,
    IntArray,
    Mesh,
)
from texbake.mesh.normals import shading_normals
from texbake.mesh.tangents import corner_tangents, image_axes
from texbake.mesh.weld import row_sums, unique_rows
from texbake.records import dataclass

Columns = dict[str, AnyArray]
_CODES = {"NORMAL": unit_codes, "TANGENT": unit_codes, "COLOR_0": color_codes}


@dataclass(frozen=True, eq=False)
class Frame:
    """The space that an object is written in, and its joints and morph targets."""

    matrix: FloatArray  # (4, 4) float64; from the positions of the mesh
    joints: IntArray | None = None  # (n,) int32: number of each node in the skin; -1 outside it
    n_morphs: int = 0
    has_morph_normals: bool = False
    grid: Grid | None = None  # of positions in this space; None for that of the whole mesh

    @property
    def linear(self) -> FloatArray:
        """(3, 3) linear part of the matrix."""
        return self.matrix[:3, :3]

    @property
    def is_rigid(self) -> bool:
        """Whether the object has neither joints nor morph targets."""
        return self.joints is None and self.n_morphs == 0

    @property
    def is_on_common_grid(self) -> bool:
        """Whether a quantized file counts positions from one corner of the whole mesh."""
        return self.is_rigid and self.grid is None


class Vertices(NamedTuple):
    """Vertices of a stream, and the (3 F,) indices of corners."""

    columns: Columns
    indices: Int64Array
    morphs: list[Columns]  # displacements of each morph target


@dataclass(frozen=True, eq=False)
class CornerVertices:
    """Builds the vertices of parts of a mesh."""

    mesh: Mesh
    origin: FloatArray  # (3,) float64; of the positions that are written
    materials: Materials | None = None  # of the faces; None where they have none of their own
    quantization: Quantization | None = None  # of the file; None for float32
    may_have_tangents: bool = True
    _tangents: dict[tuple[int, Placing], Float32Array] = field(default_factory=dict)

    def stream(
        self, faces: IndexArray, material: int, *, compress: bool, frame: Frame | None = None
    ) -> Vertices:
        """Vertices of faces of one material, in the space of a node `frame` if they hang on one."""
        if self.quantization is not None and frame is not None and frame.is_on_common_grid:
            frame = None
        corners = self._columns(faces, material, frame)
        turn = slice(None) if frame is None else corner_order(frame.linear)
        vertices = self.mesh.faces[faces][:, turn].ravel()
        if not all(np.isfinite(values).all() for values in corners.values()):
            name = self.mesh.name
            raise MeshError(f"{name}: a coordinate is beyond float32; scale it down first")
        has_morphs = frame is not None and frame.n_morphs
        # Vertices that agree in all columns may differ in morph targets.
        keys = [vertices[:, None]] if has_morphs else []
        kept, numbers = unique_rows(np.concatenate([*corners.values(), *keys], axis=1))
        indices = numbers.astype(np.int64)
        if compress:
            indices, order = ordered_triangles(indices, len(kept))
            kept = kept[order]
        columns = {attribute: values[kept] for attribute, values in corners.items()}
        morphs: list[Columns] = []
        if frame is not None and has_morphs:
            rows = self._normals[1][faces][:, turn].ravel()[kept]
            morphs = list(self._morphs(vertices[kept], rows, frame))
        return Vertices(columns, indices, morphs)

    def _columns(self, faces: IndexArray, material: int, frame: Frame | None = None) -> Columns:
        """(3 F, width) values of each attribute at each corner of some faces."""
        mesh, quantization = self.mesh, self.quantization
        normals, normal_faces = self._normals
        vertices = mesh.faces[faces].ravel()
        points = mesh.positions[vertices]
        columns: Columns = {"POSITION": (points - self.origin).astype(np.float32)}
        columns["NORMAL"] = normals[normal_faces[faces].ravel()].astype(np.float32)
        if mesh.uvs is not None and mesh.uv_faces is not None:
            rows = mesh.uv_faces[faces].ravel()
            for number, (uv_set, uvs) in enumerate(self._uv_sets.items()):
                turned = np.stack([uvs[rows, 0], 1.0 - uvs[rows, 1]], axis=1)
                columns[f"TEXCOORD_{number}"] = (
                    turned.astype(np.float32)
                    if quantization is None
                    else quantization.uvs(uv_set, turned)
                )
            for number, name in self._further_sets.items():
                item = mesh.uv_sets[name]
                u, v = item.uvs[item.faces[faces].ravel()].T
                further = np.stack([u, 1.0 - v], axis=1).astype(np.float32)
                columns.setdefault(f"TEXCOORD_{number}", further)
            if self._has_tangents:
                tangents = self._tangents_for(*self._normal_map_place(material))
                columns["TANGENT"] = _sound_tangents(
                    tangents[faces].reshape(-1, 4), columns["NORMAL"].astype(np.float64)
                )
        has_colors = self.materials is None or self.materials.has_vertex_colors
        if mesh.colors is not None and mesh.colors.shape[1] in (3, 4) and has_colors:
            columns["COLOR_0"] = np.clip(mesh.colors[vertices], 0.0, 1.0)
        if frame is not None:
            self._place(columns, points, frame)
        if frame is not None and frame.joints is not None:
            columns |= self._bound(vertices, frame.joints)
        if frame is not None and is_mirroring(frame.linear):
            columns = {
                name: rows.reshape(len(faces), 3, -1)[:, ::-1].reshape(rows.shape)
                for name, rows in columns.items()
            }
        if quantization is not None:
            if frame is None:
                columns["POSITION"] = quantization.positions.codes(points)
            elif frame.grid is not None:
                columns["POSITION"] = frame.grid.codes(columns["POSITION"].astype(np.float64))
            for name, codes in _CODES.items():
                if name in columns:
                    is_turned = quantization.is_octahedral and codes is unit_codes
                    columns[name] = (octahedral_codes if is_turned else codes)(columns[name])
        return columns

    def _place(self, columns: Columns, points: FloatArray, frame: Frame) -> None:
        """Move the positions, normals and tangents of corners into the space of a node."""
        linear = frame.linear
        moved = pm.matmul(points, linear.T) + frame.matrix[:3, 3]
        columns["POSITION"] = moved.astype(np.float32)
        normals = pm.matmul(columns["NORMAL"].astype(np.float64), normal_map(linear).T)
        columns["NORMAL"] = _unit(normals, np.array([[0.0, 0.0, 1.0]])).astype(np.float32)
        if "TANGENT" in columns:
            tangents = columns["TANGENT"].astype(np.float64)
            directions = pm.matmul(tangents[:, :3], linear.T)
            sign = -1.0 if is_mirroring(linear) else 1.0
            columns["TANGENT"] = signed_tangents(directions, tangents[:, 3:], sign)

    def _bound(self, vertices: IntArray, joints: IntArray) -> Columns:
        """Columns of joints and weights, in sets of four; a free vertex has the first joint."""
        deformation = self.mesh.deformation
        if deformation is None or not deformation.weights[vertices].any():
            return {}
        numbers = joints[deformation.joints[vertices]]
        weights = np.where(numbers >= 0, deformation.weights[vertices], 0.0)
        width = max(int(np.count_nonzero(weights, axis=1).max()), 1)
        found, weights = largest_weights(np.maximum(numbers, 0), weights, width)
        weights[~weights.any(axis=1), 0] = 1.0
        room = ((0, 0), (0, -width % 4))
        found, weights = np.pad(found, room), np.pad(weights, room)
        dtype = np.uint8 if len(joints) <= 256 or found.max() < 256 else np.uint16
        columns: Columns = {}
        for number in range(found.shape[1] // 4):
            chosen = slice(4 * number, 4 * number + 4)
            columns[f"JOINTS_{number}"] = found[:, chosen].astype(dtype)
            columns[f"WEIGHTS_{number}"] = weights[:, chosen].astype(np.float32)
        return columns

    def _morphs(self, vertices: IntArray, rows: IntArray, frame: Frame) -> Iterator[Columns]:
        """Yield the displacements of some vertices, and those of the normals in some rows."""
        deformation = self.mesh.deformation
        morphs = () if deformation is None else deformation.morphs[: frame.n_morphs]
        for morph in morphs:
            moves = pm.matmul(morph.rows(self.mesh.n_vertices)[vertices], frame.linear.T)
            columns: Columns = {"POSITION": moves.astype(np.float32)}
            if frame.has_morph_normals:
                used, turned = self._turned(morph)
                lookup = np.full(len(self._normals[0]), -1)
                lookup[used] = np.arange(len(used))
                found = lookup[rows]
                at = [pm.matmul(side[found], normal_map(frame.linear).T) for side in turned]
                zero = np.zeros((1, 3))
                turns = _unit(at[1], zero) - _unit(at[0], zero)
                columns["NORMAL"] = np.where(found[:, None] < 0, 0.0, turns).astype(np.float32)
            yield columns
        for _ in range(frame.n_morphs - len(morphs)):
            zeros = np.zeros((len(vertices), 3), np.float32)
            yield {"POSITION": zeros, **({"NORMAL": zeros} if frame.has_morph_normals else {})}

    def _turned(self, morph: Morph) -> tuple[IntArray, tuple[FloatArray, FloatArray]]:
        """Rows of normals that a morph target turns, and (n, 3) normals at rest and displaced."""
        mesh, (_, normal_faces) = self.mesh, self._normals
        is_moved = np.zeros(mesh.n_vertices, np.bool_)
        is_moved[morph.vertices] = True
        touched = np.flatnonzero(is_moved[mesh.faces].any(axis=1))
        used = np.unique(normal_faces[touched])
        if len(used) == 0:
            used, touched = np.zeros(1, np.int32), np.zeros(0, np.intp)
        rest = self._areas[used]
        moved = mesh.positions + morph.rows(mesh.n_vertices)
        change = area_vectors(moved, mesh.faces[touched])
        change -= area_vectors(mesh.positions, mesh.faces[touched])
        rows = np.searchsorted(used, normal_faces[touched]).ravel()
        return used, (rest, rest + row_sums(rows, np.repeat(change, 3, axis=0), len(used)))

    @cached_property
    def _areas(self) -> FloatArray:
        """(N, 3) float64: sums of the area vectors of the faces around each normal."""
        normals, normal_faces = self._normals
        vectors = area_vectors(self.mesh.positions, self.mesh.faces)
        return row_sums(normal_faces.ravel(), np.repeat(vectors, 3, axis=0), len(normals))

    @cached_property
    def _normals(self) -> tuple[FloatArray, IntArray]:
        normals, normal_faces = shading_normals(self.mesh)
        return _unit(normals, np.array([[0.0, 0.0, 1.0]])), normal_faces

    @cached_property
    def _uv_sets(self) -> dict[int, FloatArray]:
        assert self.mesh.uvs is not None
        if self.materials is None:
            return {0: self.mesh.uvs}
        known = {**self.materials.uv_sets, 0: self.mesh.uvs}
        return {uv_set: known[uv_set] for uv_set in uv_numbers(self.materials)}

    @cached_property
    def _further_sets(self) -> dict[int, str]:
        """Names of the mesh's further sets, by their numbers; materials may use the same."""
        mesh = self.mesh
        written = {
            number: uvs[mesh.uv_faces]
            for number, uvs in enumerate(self._uv_sets.values())
            if number
        }
        names: dict[int, str] = {}
        for name in mesh.uv_sets:
            corners = mesh.corner_uvs(name)
            alike = (n for n, known in written.items() if np.array_equal(known, corners))
            number = next((n for n in alike if n not in names), None)
            if number is None:
                number = max(len(self._uv_sets) - 1, *names, 0) + 1
            names[number] = name
        return names

    def uv_set_names(self) -> dict[str, Any]:
        """Fields of a mesh that name its further sets, where their attributes do not."""
        if self.mesh.uvs is None:
            return {}
        numbered = {f"TEXCOORD_{i}": as_text(name) for i, name in self._further_sets.items()}
        extras = {attribute: name for attribute, name in numbered.items() if attribute != name}
        return {"extras": extras} if extras else {}

    @cached_property
    def _has_tangents(self) -> bool:
        """Whether any material has a normal map, or may; all of a mesh has tangents or nothing."""
        if not self.may_have_tangents:
            return False
        if self.materials is None:
            return True
        return any(self.materials.sources("normal"))

    def _normal_map_place(self, material: int) -> tuple[int, Placing]:
        """UV set of a normal map, and how it lies on that if it is turned or mirrored."""
        if self.materials is None:
            return 0, UNPLACED
        source = self.materials.materials[material].channels.get("normal")
        if source is None or source.image is None:
            return 0, UNPLACED
        image = source.image
        axes = image_axes(np.array(image.placing)[:, :2])
        return image.uv_set, UNPLACED if (axes == np.eye(2)).all() else image.placing

    def _tangents_for(self, uv_set: int, placing: Placing) -> Float32Array:
        """(F, 3, 4) tangents of the image on a set of uvs, however it is placed."""
        if self.mesh.tangents is not None:
            return self.mesh.tangents
        key = uv_set, placing
        if key not in self._tangents:
            mesh = self.mesh
            if uv_set and self.materials is not None:
                mesh = mesh.replace(uvs=self.materials.uv_sets[uv_set])
            if placing != UNPLACED and mesh.uvs is not None:
                matrix = np.array(placing)
                mesh = mesh.replace(uvs=pm.matmul(mesh.uvs, matrix[:, :2].T) + matrix[:, 2])
            self._tangents[key] = corner_tangents(mesh)
        return self._tangents[key]


def _sound_tangents(tangents: Float32Array, normals: FloatArray) -> Float32Array:
    """Unit tangents with w of 1 or -1; where there is none, some perpendicular to the normal."""
    # The coordinate axis that is least along the normal spans a plane with it.
    axes = np.eye(3)[np.abs(normals).argmin(axis=1)]
    perpendicular = _unit(np.cross(axes, normals), axes)
    directions = _unit(tangents[:, :3].astype(np.float64), perpendicular)
    signs = np.where(tangents[:, 3:] < 0.0, -1.0, 1.0)
    return np.concatenate([directions, signs], axis=1).astype(np.float32)


def _unit(vectors: FloatArray, instead: FloatArray) -> FloatArray:
    """Vectors of length 1; the rows of `instead` where there is no direction."""
    lengths = pm.norm(vectors, axis=1, keepdims=True)
    # 1e-6: what float32 leaves of a unit vector, which stays as it is, bit for bit.
    divisors = np.where((np.abs(lengths - 1.0) <= 1e-6) | (lengths == 0.0), 1.0, lengths)
    unit: FloatArray = np.where(lengths > 0.0, vectors / divisors, instead)
    return unit
