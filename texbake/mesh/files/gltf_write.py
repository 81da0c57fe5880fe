"""Writing binary glTF 2.0: a primitive per group and material, with tangents and textures.

Corners become vertices of a GPU stream, one where all attributes agree, bit for bit. Triangles keep
their order within a primitive, except in a compressed file. A mesh with a `Rig` goes back to the
nodes that it came from, and nodes of equal objects share a mesh. Without one, each group is a mesh
and a node with its name. Names of further sets of texture coordinates are in the `extras` of the
meshes. Tangents are those of the mesh, else those of MikkTSpace for the coordinates that the normal
map lies on.

Levels of detail are nodes outside the scene: a reader that does not know MSFT_lod shows only the
finest level.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021; Microsoft, "MSFT_lod",
Khronos vendor extension, 2018.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import OptionError, UvError, first_few, warn_of
from texbake.files import PathLike
from texbake.mesh.files.conversion import as_text, far_origin, float32_positions, require_uvs
from texbake.mesh.files.gltf_asset import GltfAsset
from texbake.mesh.files.gltf_compression import QUANTIZATION, Quantization
from texbake.mesh.files.gltf_material_write import add_material, uv_numbers
from texbake.mesh.files.gltf_mesh_materials import VARIANTS
from texbake.mesh.files.gltf_rig_write import RigWriter
from texbake.mesh.files.gltf_vertices import CornerVertices, Frame
from texbake.mesh.instances import instances
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import IndexArray, Mesh
from texbake.mesh.rig import Rig, RigObject

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
    rig: Rig | None = None,
    tangents: bool = True,
    is_coarse: bool = False,
) -> None:
    """Write a mesh as binary glTF with PNG or JPEG textures as they are, normals in +Y.

    Objects of a `rig` that match are on its nodes. Without `tangents`, readers compute them. What
    is compressed and `is_coarse` has larger steps of texture coordinates and normals.
    """
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
    wanted = compress if quantize is None else quantize
    if wanted and not Quantization.would_flatten(meshes):
        coarse = is_coarse and bool(compress)
        quantization = Quantization.of(meshes, materials, is_coarse=coarse)
        asset.require(QUANTIZATION)
    if materials is None:
        asset.add_material(
            name, normal_map=normal_map, base_color=base_color, orm=orm, emissive=emissive
        )
    if rig is not None and len(meshes) == 1 and rig.fits(mesh):
        _add_objects(asset, mesh, name, materials, quantization, rig, tangents)
    elif len(meshes) == 1:
        for node in _add_groups(asset, mesh, name, materials, quantization, tangents):
            asset.place(node)
    else:
        nodes = []
        for number, level in enumerate(meshes):
            label = f"{name}_LOD{number}"
            children = _add_groups(asset, level, label, None, quantization, tangents)
            nodes.append(asset.add_node(label, children=children))
        asset.place(nodes[0])
        asset.set_levels(nodes[0], nodes[1:], shares)
    if materials is not None and materials.variants:
        variants = [{"name": as_text(name)} for name, _ in materials.variants]
        asset.extend(VARIANTS, {"variants": variants})
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
            raise UvError(f"{mesh.name}: an image lies on missing texture coordinates {uv_set}")
    if materials.has_images:
        require_uvs(mesh)


def _add_groups(
    asset: GltfAsset,
    mesh: Mesh,
    name: str,
    materials: Materials | None,
    quantization: Quantization | None,
    tangents: bool,
) -> list[int]:
    """Add each group as a mesh and a node, with a primitive for each material; return the nodes."""
    origin = far_origin(mesh)
    float32_positions(mesh, origin)  # raises where it does not hold them
    vertices = CornerVertices(mesh, origin, materials, quantization, tangents)
    writer = _PrimitiveWriter(asset, vertices)
    place: dict[str, Any] = {"translation": origin.tolist()} if origin.any() else {}
    if quantization is not None:
        place = quantization.positions.place()
    nodes = []
    for _, group, faces in _groups(mesh, name):
        index = asset.add_mesh(group, writer.primitives(faces), **vertices.uv_set_names())
        nodes.append(asset.add_node(group, mesh=index, **place))
    return nodes


def _add_objects(
    asset: GltfAsset,
    mesh: Mesh,
    name: str,
    materials: Materials | None,
    quantization: Quantization | None,
    rig: Rig,
    tangents: bool,
) -> None:
    """Add each object of a rig as the mesh of its node, and equal ones once."""
    vertices = CornerVertices(mesh, np.zeros(3), materials, quantization, tangents)
    writer, places = _PrimitiveWriter(asset, vertices), RigWriter(asset, rig, quantization)
    extras = vertices.uv_set_names().get("extras", {})
    objects: dict[int, tuple[RigObject, str, list[IndexArray]]] = {}
    for number, group, faces in _groups(mesh, name):
        item = rig.object_of(number, mesh)
        assert item is not None
        objects.setdefault(item.node, (item, group, []))[2].append(faces)
    kinds = [[rig.objects[number] for number in kind] for kind in instances(mesh, rig, writer.ids)]
    first_of = {item.node: kind[0] for kind in kinds for item in kind}
    for item, group, parts in objects.values():
        first = first_of.get(item.node)
        if first is not None and first is not item:
            places.place_again(item, first)
            continue
        faces = np.concatenate(parts)
        frame = places.frame(item, mesh, faces, is_repeated=first is not None)
        primitives = [found for faces in parts for found in writer.primitives(faces, frame)]
        places.place(item, group, primitives, extras, frame)
    places.finish()
    for why, names in places.placed_apart.items():
        listed = ", ".join(first_few(names))
        warn_of(mesh.name, f"{listed}: written at the root of the scene, because {why}")


class _PrimitiveWriter:
    """Writes faces of a mesh as primitives, and the materials that they have."""

    def __init__(self, asset: GltfAsset, vertices: CornerVertices) -> None:
        self.asset, self.vertices = asset, vertices
        materials, quantization = vertices.materials, vertices.quantization
        self._numbers = {} if materials is None else uv_numbers(materials)
        self._uv_matrices = {} if quantization is None else quantization.uv_matrices()
        n_faces = vertices.mesh.n_faces
        self.ids = np.zeros(n_faces, np.int32) if materials is None else materials.face_materials
        # indices of materials in the file, by their numbers and the units of their thickness
        self._written: dict[tuple[int, str], int] = {}

    def primitives(self, faces: IndexArray, frame: Frame | None = None) -> list[dict[str, Any]]:
        """Add the primitives of some faces, one for each material."""
        return [self._primitive(faces, number, frame) for number in np.unique(self.ids[faces])]

    def _primitive(self, faces: IndexArray, number: int, frame: Frame | None) -> dict[str, Any]:
        asset, part = self.asset, faces[self.ids[faces] == number]
        with np.errstate(over="ignore"):
            found = self.vertices.stream(part, number, compress=asset.is_compressed, frame=frame)
        primitive = asset.add_primitive(found.columns, found.indices, self._material(number, frame))
        if found.morphs:
            primitive["targets"] = [asset.add_morph(columns) for columns in found.morphs]
        materials = self.vertices.materials
        tables = [] if materials is None else [table for _, table in materials.variants]
        if any(table[number] != number for table in tables):
            of_materials: dict[int, list[int]] = {}
            for variant, table in enumerate(tables):
                of_materials.setdefault(self._material(table[number], frame), []).append(variant)
            mappings = [{"material": i, "variants": of_it} for i, of_it in of_materials.items()]
            primitive["extensions"] = {VARIANTS: {"mappings": mappings}}
        return primitive

    def _material(self, number: int, frame: Frame | None) -> int:
        """Index of a material in the file, which it is written to when it is first used."""
        materials, units = self.vertices.materials, 1.0
        if materials is None:
            return 0
        material = materials.materials[number]
        is_thick = any("thicknessFactor" in each for each in material.extensions.values())
        quantization = self.vertices.quantization
        if is_thick and quantization is not None and (frame is None or frame.is_rigid):
            # Units of the node are those of the material, and are replaced by steps.
            own = None if frame is None else frame.grid
            units = _node_unit(frame) / quantization.positions.step if own is None else 1 / own.step
        key = number, f"{units:.5g}"  # nodes that are turned differ by rounding
        if key not in self._written:
            self._written[key] = add_material(
                self.asset, material, self._numbers, self._uv_matrices, units
            )
        return self._written[key]


def _node_unit(frame: Frame | None) -> float:
    """Length in the scene of a unit of a node, in the mean over its axes."""
    volume = 1.0 if frame is None else abs(float(pm.det(frame.linear)))
    return float(pm.power(volume, -1.0 / 3.0)) if volume > 0.0 else 1.0


def _groups(mesh: Mesh, name: str) -> Iterator[tuple[int, str, IndexArray]]:
    """Number, name and faces of each group that has some."""
    if mesh.face_groups is None:
        yield 0, name, np.arange(mesh.n_faces)
        return
    order = np.argsort(mesh.face_groups, kind="stable")
    ends = np.cumsum(np.bincount(mesh.face_groups, minlength=len(mesh.group_names)))
    parts = zip(mesh.group_names, np.split(order, ends[:-1]), strict=True)
    for number, (group, faces) in enumerate(parts):
        if len(faces):
            yield number, group, faces
