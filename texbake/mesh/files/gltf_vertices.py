"""Vertices of glTF primitives: corners of a mesh whose attributes all agree, bit for bit, are one.

Of quantized attributes the codes are compared. Further sets of texture coordinates are numbered
without gaps. Tangents, which only normal maps need, are those of the mesh, else those of MikkTSpace
for the texture coordinates that the normal map of the material lies on.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021, section 3.7.2.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import MeshError
from texbake.mesh.files.conversion import as_text
from texbake.mesh.files.gltf_compression import ordered_triangles
from texbake.mesh.files.gltf_material_write import uv_numbers
from texbake.mesh.files.gltf_quantization import Quantization, color_codes, unit_codes
from texbake.mesh.materials import UNPLACED, Materials, Placing
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.normals import shading_normals
from texbake.mesh.tangents import corner_tangents, image_axes
from texbake.mesh.weld import weld_rows

FloatColumns = npt.NDArray[np.float32]
Columns = dict[str, npt.NDArray[Any]]
_CODES = {"NORMAL": unit_codes, "TANGENT": unit_codes, "COLOR_0": color_codes}


@dataclass(frozen=True, eq=False)
class CornerVertices:
    """Makes the vertices of parts of a mesh.

    Attributes
    ----------
    origin : (3,) float64
        Of the positions that are written.
    materials
        Of the faces; None where they have none of their own.
    quantization
        Of the file; None for float32.
    """

    mesh: Mesh
    origin: FloatArray
    materials: Materials | None = None
    quantization: Quantization | None = None
    _tangents: dict[tuple[int, Placing], npt.NDArray[np.float32]] = field(default_factory=dict)

    def stream(
        self, faces: npt.NDArray[np.intp], material: int, *, compress: bool
    ) -> tuple[Columns, npt.NDArray[np.int64]]:
        """Vertices of faces of one material, and the (3 F,) indices of their corners."""
        corners = self._columns(faces, material)
        if not all(np.isfinite(values).all() for values in corners.values()):
            name = self.mesh.name
            raise MeshError(f"{name}: a coordinate is beyond float32; scale it down first")
        firsts = weld_rows(np.concatenate(list(corners.values()), axis=1))
        kept, indices = np.unique(firsts, return_inverse=True)
        if compress:
            indices, order = ordered_triangles(indices, len(kept))
            kept = kept[order]
        return {attribute: values[kept] for attribute, values in corners.items()}, indices

    def _columns(self, faces: npt.NDArray[np.intp], material: int) -> Columns:
        """(3 F, width) values of each attribute at each corner of some faces."""
        mesh = self.mesh
        normals, normal_faces = self._normals
        vertices = mesh.faces[faces].ravel()
        columns: Columns = {"POSITION": self._stored_positions(mesh.positions[vertices])}
        columns["NORMAL"] = normals[normal_faces[faces].ravel()].astype(np.float32)
        if mesh.uvs is not None and mesh.uv_faces is not None:
            rows = mesh.uv_faces[faces].ravel()
            for number, (uv_set, uvs) in enumerate(self._uv_sets.items()):
                turned = np.stack([uvs[rows, 0], 1.0 - uvs[rows, 1]], axis=1)
                columns[f"TEXCOORD_{number}"] = self._stored_uvs(uv_set, turned)
            for number, name in self._further_sets.items():
                item = mesh.uv_sets[name]
                u, v = item.uvs[item.faces[faces].ravel()].T
                further = np.stack([u, 1.0 - v], axis=1).astype(np.float32)
                columns.setdefault(f"TEXCOORD_{number}", further)
            if self._has_normal_map:
                tangents = self._tangents_for(*self._normal_map_place(material))
                columns["TANGENT"] = _sound_tangents(
                    tangents[faces].reshape(-1, 4), columns["NORMAL"].astype(np.float64)
                )
        has_colors = self.materials is None or self.materials.has_vertex_colors
        if mesh.colors is not None and mesh.colors.shape[1] in (3, 4) and has_colors:
            columns["COLOR_0"] = np.clip(mesh.colors[vertices], 0.0, 1.0)
        if self.quantization is not None:
            for name, codes in _CODES.items():
                if name in columns:
                    columns[name] = codes(columns[name])
        return columns

    def _stored_positions(self, positions: FloatArray) -> npt.NDArray[Any]:
        if self.quantization is not None:
            return self.quantization.positions.codes(positions)
        return (positions - self.origin).astype(np.float32)

    def _stored_uvs(self, uv_set: int, turned: FloatArray) -> npt.NDArray[Any]:
        if self.quantization is not None:
            return self.quantization.uvs(uv_set, turned)
        return turned.astype(np.float32)

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
    def _has_normal_map(self) -> bool:
        """Whether any material has one, or may have; a mesh has tangents everywhere or nowhere."""
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

    def _tangents_for(self, uv_set: int, placing: Placing) -> npt.NDArray[np.float32]:
        """(F, 3, 4) tangents for a normal map on a set of texture coordinates.

        Programs take given tangents as those of the image, however it is placed.
        """
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


def _sound_tangents(tangents: npt.NDArray[np.float32], normals: FloatArray) -> FloatColumns:
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
