"""Writing binary glTF 2.0: a primitive per group and material, with tangents and textures.

Corners become vertices of a GPU stream: corners of a primitive whose attributes all agree, bit for
bit, become one vertex. Triangles keep their order within a primitive, except in a compressed file,
where neighbors follow one another. The format has no place for names of primitives, so each group
is a mesh and a node with its name. Names of further sets of texture coordinates are in the `extras`
of the meshes.

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
import numpy.typing as npt

from texbake.errors import OptionError, UvError
from texbake.files import PathLike
from texbake.mesh.files.conversion import far_origin, float32_positions
from texbake.mesh.files.gltf_asset import GltfAsset
from texbake.mesh.files.gltf_material_write import add_material, uv_numbers
from texbake.mesh.files.gltf_quantization import EXTENSION, Quantization
from texbake.mesh.files.gltf_vertices import CornerVertices
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import Mesh

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
    """Write a mesh as binary glTF, textures embedded as they are.

    `normal_map`: PNG or JPEG file, in tangent space, +Y; `emissive`: PNG or JPEG file in sRGB.
    """
    textures = (normal_map, base_color, orm, emissive)
    meshes = [mesh, *(levels or ())]
    shares = _coverages(len(meshes), coverages)
    if materials is not None:
        _check_materials(mesh, materials, alone=len(meshes) == 1 and not any(textures))
    elif any(isinstance(texture, str | os.PathLike) for texture in textures):
        for level in meshes:
            _check_uvs(level)
    name = Path(path).stem if name is None else name
    asset = GltfAsset(compress=bool(compress))
    quantization = None
    if compress if quantize is None else quantize:
        quantization = Quantization.of(meshes, materials)
        asset.require(EXTENSION)
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


def _check_uvs(mesh: Mesh) -> None:
    if mesh.uvs is None:
        raise UvError(
            f"{mesh.name}: it has no texture coordinates, which a texture needs; "
            f"make some with: texbake unwrap {mesh.name} -o OUT"
        )


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
        _check_uvs(mesh)


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
    place: dict[str, Any] = {}
    if quantization is not None:
        place = quantization.place()
    elif vertices.origin.any():
        place["translation"] = vertices.origin.tolist()
    numbers = {} if materials is None else uv_numbers(materials)
    uv_matrices = {} if quantization is None else quantization.uv_matrices()
    written: dict[int, int] = {}
    nodes = []
    with np.errstate(over="ignore"):
        for group, faces in _groups(mesh, name):
            primitives = []
            for of_faces, part in _by_material(faces, materials):
                if of_faces not in written:
                    written[of_faces] = 0
                    if materials is not None:
                        material = materials.materials[of_faces]
                        written[of_faces] = add_material(asset, material, numbers, uv_matrices)
                columns, indices = vertices.stream(part, of_faces, compress=asset.is_compressed)
                primitives.append(asset.add_primitive(columns, indices, written[of_faces]))
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


def _by_material(
    faces: npt.NDArray[np.intp], materials: Materials | None
) -> Iterator[tuple[int, npt.NDArray[np.intp]]]:
    """Yield each material of some faces, and those that have it."""
    if materials is None:
        yield 0, faces
        return
    of_faces = materials.face_materials[faces]
    for material in np.unique(of_faces).tolist():
        yield material, faces[of_faces == material]
