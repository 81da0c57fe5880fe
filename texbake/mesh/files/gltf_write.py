"""Writing binary glTF 2.0: a primitive per group and material, with tangents and textures.

Corners become vertices of a GPU stream: corners of a primitive whose attributes all agree, bit for
bit, become one vertex. Triangles keep their order within a primitive, except in a compressed file,
where neighbors follow one another. The format has no place for names of primitives, so each group
is a mesh and a node with its name. Names of further sets of texture coordinates are in the `extras`
of the meshes, numbered without gaps. Tangents, which only normal maps need, are those of the mesh,
else those of MikkTSpace for the texture coordinates that the normal map of the material lies on.

Levels of detail are nodes outside the scene: a reader that does not know MSFT_lod shows only the
finest level.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021; Microsoft, "MSFT_lod",
Khronos vendor extension, 2018.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import MeshError, OptionError, UvError
from texbake.files import PathLike
from texbake.mesh.files.conversion import as_text, far_origin, float32_positions, require_uvs
from texbake.mesh.files.gltf_asset import GltfAsset, add_material, uv_numbers
from texbake.mesh.files.gltf_compression import (
    QUANTIZATION,
    Quantization,
    color_codes,
    ordered_triangles,
    unit_codes,
)
from texbake.mesh.materials import UNPLACED, Materials, Placing
from texbake.mesh.mesh import Float32Array, FloatArray, Int64Array, IntArray, Mesh
from texbake.mesh.normals import shading_normals
from texbake.mesh.tangents import corner_tangents, image_axes
from texbake.mesh.weld import unique_rows
from texbake.records import dataclass

# Share of the picture's area that the finest level is shown from on; each next one from a quarter
# of it, which is half the height.
_FINEST_COVERAGE = 0.25


def write_glb(
    mesh: Mesh,
    path: PathLike,
    *,
    normal_map: PathLike | None = None,
    base_color: PathLike | Sequence[float] | None = None,
    orm: PathLike | None = None,
    emissive: PathLike | None = None,
    name: str | None = None,
    materials: Materials | None = None,
    levels: Sequence[Mesh] | None = None,
    coverages: Sequence[float] | None = None,
    compress: bool | None = None,
    quantize: bool | None = None,
) -> None:
    """Write a mesh as binary glTF with PNG or JPEG textures as they are, normals in +Y."""
    textures = (normal_map, base_color, orm, emissive)
    meshes = [mesh, *(levels or ())]
    shares = _coverages(len(meshes), coverages)
    if materials is not None:
        _check_materials(mesh, materials, alone=len(meshes) == 1 and not any(textures))
    elif any(isinstance(texture, str | os.PathLike) for texture in textures):
        for level in meshes:
            require_uvs(level)
    name = Path(path).stem if name is None else name
    asset = GltfAsset(compress=bool(compress))
    quantization = None
    if compress if quantize is None else quantize:
        quantization = Quantization.of(meshes, materials)
        asset.require(QUANTIZATION)
    if materials is None:
        asset.add_material(
            name, normal_map=normal_map, base_color=base_color, orm=orm, emissive=emissive
        )
    if len(meshes) == 1:
        for node in _add_groups(asset, mesh, name, materials, quantization):
            asset.place(node)
    else:
        nodes = []
        for number, level in enumerate(meshes):
            label = f"{name}_LOD{number}"
            children = _add_groups(asset, level, label, None, quantization)
            nodes.append(asset.add_node(label, children=children))
        asset.place(nodes[0])
        asset.set_levels(nodes[0], nodes[1:], shares)
    asset.write(path)


def _coverages(n_levels: int, coverages: Sequence[float] | None) -> Sequence[float]:
    """Least share of the picture at which each level is shown."""
    if coverages is None:
        return [*(_FINEST_COVERAGE / 4**number for number in range(n_levels - 1)), 0.0]
    falling = all(a > b for a, b in pairwise(coverages))
    if len(coverages) != n_levels or not falling or not all(0.0 <= c <= 1.0 for c in coverages):
        raise OptionError(
            f"coverages: {list(coverages)} are not {n_levels} falling shares between 0 and 1, "
            "one for each level"
        )
    return coverages


def _check_materials(mesh: Mesh, materials: Materials, *, alone: bool) -> None:
    if not alone:
        raise OptionError("materials: give them without levels and without files of a material")
    if len(materials.face_materials) != mesh.n_faces:
        raise OptionError(
            f"materials: they are those of {len(materials.face_materials):,} faces; "
            f"{mesh.name} has {mesh.n_faces:,}"
        )
    for uv_set in uv_numbers(materials):
        if uv_set and uv_set not in materials.uv_sets:
            raise UvError(f"{mesh.name}: an image lies on texture coordinates {uv_set}, not there")
    if materials.has_images:
        require_uvs(mesh)


def _add_groups(
    asset: GltfAsset,
    mesh: Mesh,
    name: str,
    materials: Materials | None,
    quantization: Quantization | None,
) -> list[int]:
    """Add each group as a mesh and a node, with a primitive for each material; return the nodes."""
    origin = far_origin(mesh)
    float32_positions(mesh, origin)  # raises where it does not hold them
    vertices = CornerVertices(mesh, origin, materials, quantization)
    place: dict[str, Any] = {"translation": origin.tolist()} if origin.any() else {}
    if quantization is not None:
        place = quantization.place()
    numbers = {} if materials is None else uv_numbers(materials)
    uv_matrices = {} if quantization is None else quantization.uv_matrices()
    ids = np.zeros(mesh.n_faces, np.int32) if materials is None else materials.face_materials
    written = {0: 0} if materials is None else {}  # indices of materials in the file
    nodes = []
    with np.errstate(over="ignore"):
        for group, faces in _groups(mesh, name):
            primitives = []
            for number in np.unique(ids[faces]).tolist():
                if number not in written and materials is not None:
                    material = materials.materials[number]
                    written[number] = add_material(asset, material, numbers, uv_matrices)
                part = faces[ids[faces] == number]
                columns, indices = vertices.stream(part, number, compress=asset.is_compressed)
                primitives.append(asset.add_primitive(columns, indices, written[number]))
            index = asset.add_mesh(group, primitives, **vertices.uv_set_names())
            nodes.append(asset.add_node(group, mesh=index, **place))
    return nodes


def _groups(mesh: Mesh, name: str) -> Iterator[tuple[str, npt.NDArray[np.intp]]]:
    """Name and faces of each group that has some."""
    if mesh.face_groups is None:
        yield name, np.arange(mesh.n_faces)
        return
    order = np.argsort(mesh.face_groups, kind="stable")
    ends = np.cumsum(np.bincount(mesh.face_groups, minlength=len(mesh.group_names)))
    for group, faces in zip(mesh.group_names, np.split(order, ends[:-1]), strict=True):
        if len(faces):
            yield group, faces


FloatColumns = npt.NDArray[np.float32]
Columns = dict[str, npt.NDArray[Any]]
_CODES = {"NORMAL": unit_codes, "TANGENT": unit_codes, "COLOR_0": color_codes}


@dataclass(frozen=True, eq=False)
class CornerVertices:
    """Makes the vertices of parts of a mesh."""

    mesh: Mesh
    origin: FloatArray  # (3,) float64; of the positions that are written
    materials: Materials | None = None  # of the faces; None where they have none of their own
    quantization: Quantization | None = None  # of the file; None for float32
    _tangents: dict[tuple[int, Placing], Float32Array] = field(default_factory=dict)

    def stream(
        self, faces: npt.NDArray[np.intp], material: int, *, compress: bool
    ) -> tuple[Columns, Int64Array]:
        """Vertices of faces of one material, and the (3 F,) indices of their corners."""
        corners = self._columns(faces, material)
        if not all(np.isfinite(values).all() for values in corners.values()):
            name = self.mesh.name
            raise MeshError(f"{name}: a coordinate is beyond float32; scale it down first")
        kept, numbers = unique_rows(np.concatenate(list(corners.values()), axis=1))
        indices = numbers.astype(np.int64)
        if compress:
            indices, order = ordered_triangles(indices, len(kept))
            kept = kept[order]
        return {attribute: values[kept] for attribute, values in corners.items()}, indices

    def _columns(self, faces: npt.NDArray[np.intp], material: int) -> Columns:
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
            if self._has_normal_map:
                tangents = self._tangents_for(*self._normal_map_place(material))
                columns["TANGENT"] = _sound_tangents(
                    tangents[faces].reshape(-1, 4), columns["NORMAL"].astype(np.float64)
                )
        has_colors = self.materials is None or self.materials.has_vertex_colors
        if mesh.colors is not None and mesh.colors.shape[1] in (3, 4) and has_colors:
            columns["COLOR_0"] = np.clip(mesh.colors[vertices], 0.0, 1.0)
        if quantization is not None:
            columns["POSITION"] = quantization.positions.codes(points)
            for name, codes in _CODES.items():
                if name in columns:
                    columns[name] = codes(columns[name])
        return columns

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


def _sound_tangents(tangents: Float32Array, normals: FloatArray) -> FloatColumns:
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
