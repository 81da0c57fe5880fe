"""Writing binary glTF 2.0: one primitive per group, with tangents and textures.

Corners become vertices of a GPU stream: corners of a group whose attributes all agree, bit for bit,
become one vertex. Triangles keep their order, except in a compressed file, where neighbors follow
one another. The format has no place for names of primitives, so each group is a mesh and a node
with its name.

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

from texbake.errors import MeshError, OptionError, UvError
from texbake.files import PathLike
from texbake.mesh.files.conversion import far_origin
from texbake.mesh.files.gltf_asset import GltfAsset
from texbake.mesh.files.gltf_compression import ordered_triangles
from texbake.mesh.files.gltf_material_write import GltfMaterialWriter
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.normals import shading_normals
from texbake.mesh.tangents import corner_tangents
from texbake.mesh.weld import weld_rows

# Share of the picture's area that the finest level is shown from on; each next one from a quarter
# of it, which is half the height.
_FINEST_COVERAGE = 0.25

FloatColumns = npt.NDArray[np.float32]


def write_glb(
    mesh: Mesh,
    path: PathLike,
    *,
    normal_map: PathLike | None = None,
    base_color: PathLike | Sequence[float] | None = None,
    orm: PathLike | None = None,
    emissive: PathLike | None = None,
    name: str | None = None,
    levels: Sequence[Mesh] | None = None,
    coverages: Sequence[float] | None = None,
    compress: bool | None = None,
    materials: Materials | None = None,
) -> None:
    """Write a mesh as binary glTF, textures embedded as they are.

    Parameters
    ----------
    mesh
        Its shading normals are written; with texture coordinates also the tangents it has, else
        those of MikkTSpace. A corner without a normal gets (0, 0, 1), one without a tangent some
        unit vector perpendicular to its normal.
    normal_map
        PNG or JPEG file, in tangent space, +Y.
    base_color
        PNG or JPEG file in sRGB, or three or four linear factors in [0, 1].
    orm
        PNG or JPEG file: occlusion in red, roughness in green, metalness in blue, linear.
    emissive
        PNG or JPEG file in sRGB.
    name
        Of the mesh and the material; by default that of the file.
    levels
        Coarser meshes that replace this one where it is small in the picture, the finest first.
    coverages
        Least share of the picture's area at which each level is shown, falling, `mesh` first. By
        default a quarter, and a quarter of that for each further level; the last goes down to 0.
    compress
        Compress vertices and triangles by EXT_meshopt_compression: no value changes, but triangles
        are reordered. Programs without the extension cannot open such a file.

    materials
        Of the faces, with all their channels, in place of the textures above. Images are embedded
        as they are; see `gltf_material_write` for what glTF asks of them.

    Raises
    ------
    UvError
        A texture is given, and a mesh has no texture coordinates.
    OptionError
        A texture is neither PNG nor JPEG, the normal map says that it is in another space or
        convention, a factor is out of range, or the coverages do not fit the levels.
    MeshError
        A coordinate is beyond the float32 that the format holds.
    FileError
        A texture cannot be read, or the file cannot be written.
    FileFormatError
        A texture is damaged, or the file would pass the 4 GiB that the format allows.
    DependencyError
        `compress` is set, and meshoptimizer does not load.
    """
    textures = (normal_map, base_color, orm, emissive)
    has_textures = any(isinstance(texture, str | os.PathLike) for texture in textures) or (
        materials is not None and materials.has_images
    )
    meshes = [mesh, *(levels or ())]
    shares = _coverages(len(meshes), coverages)
    for level in meshes:
        if level.uvs is None and has_textures:
            raise UvError(
                f"{level.name}: it has no texture coordinates, which a texture needs; "
                f"make some with: texbake unwrap {level.name} -o OUT"
            )
    name = Path(path).stem if name is None else name
    asset = GltfAsset(compress=bool(compress))
    if materials is None:
        asset.add_material(
            name, normal_map=normal_map, base_color=base_color, orm=orm, emissive=emissive
        )
    else:
        writer = GltfMaterialWriter(asset)
        for material in materials.materials:
            writer.add(material)
    if len(meshes) == 1:
        for node in _add_groups(asset, mesh, name, materials, compress=bool(compress)):
            asset.place(node)
    else:
        nodes = []
        for number, level in enumerate(meshes):
            label = f"{name}_LOD{number}"
            children = _add_groups(asset, level, label, None, compress=bool(compress))
            nodes.append(asset.add_node(label, children=children))
        asset.place(nodes[0])
        asset.set_levels(nodes[0], nodes[1:], shares)
    asset.write(path)


def _coverages(n_levels: int, coverages: Sequence[float] | None) -> Sequence[float]:
    """Least share of the picture at which each level is shown."""
    if coverages is None:
        return [*(_FINEST_COVERAGE / 4.0**number for number in range(n_levels - 1)), 0.0]
    falling = all(a > b for a, b in pairwise(coverages))
    if len(coverages) != n_levels or not falling or not all(0.0 <= c <= 1.0 for c in coverages):
        raise OptionError(
            f"coverages: {list(coverages)} are not {n_levels} falling shares between 0 and 1, "
            "one for each level"
        )
    return coverages


def _add_groups(
    asset: GltfAsset, mesh: Mesh, name: str, materials: Materials | None, *, compress: bool
) -> list[int]:
    """Add each group as a mesh and a node; return the nodes."""
    origin = far_origin(mesh)
    place: dict[str, Any] = {"translation": origin.tolist()} if origin.any() else {}
    nodes = []
    with np.errstate(over="ignore"):
        for group, material, corners in _groups(mesh, name, materials, origin):
            if not all(np.isfinite(values).all() for values in corners.values()):
                raise MeshError(f"{mesh.name}: a coordinate is beyond float32; scale it down first")
            firsts = weld_rows(np.concatenate(list(corners.values()), axis=1))
            kept, indices = np.unique(firsts, return_inverse=True)
            if compress:
                indices, order = ordered_triangles(indices, len(kept))
                kept = kept[order]
            columns = {attribute: values[kept] for attribute, values in corners.items()}
            made = asset.add_mesh(group, columns, indices, material)
            nodes.append(asset.add_node(group, mesh=made, **place))
    return nodes


def _groups(
    mesh: Mesh, name: str, materials: Materials | None, origin: FloatArray
) -> Iterator[tuple[str, int, dict[str, FloatColumns]]]:
    """Faces of one group and one material: their names, material and attributes.

    Attributes are those of each corner, (3 F, width).
    """
    normals, normal_faces = shading_normals(mesh)
    unit_normals = _unit(normals, np.array([[0.0, 0.0, 1.0]]))
    tangents = None
    if mesh.uvs is not None:
        tangents = corner_tangents(mesh) if mesh.tangents is None else mesh.tangents
    keeps_colors = materials is None or materials.has_vertex_colors
    for group, material, faces in _parts(mesh, name, materials):
        vertices = mesh.faces[faces].ravel()
        columns = {"POSITION": (mesh.positions[vertices] - origin).astype(np.float32)}
        columns["NORMAL"] = unit_normals[normal_faces[faces].ravel()].astype(np.float32)
        if mesh.uvs is not None and mesh.uv_faces is not None and tangents is not None:
            uvs = mesh.uvs[mesh.uv_faces[faces].ravel()]
            columns["TEXCOORD_0"] = _turned_down(uvs)
            columns["TANGENT"] = _sound_tangents(
                tangents[faces].reshape(-1, 4), columns["NORMAL"].astype(np.float64)
            )
            for number, coordinates in {} if materials is None else materials.uv_sets.items():
                further = coordinates[mesh.uv_faces[faces].ravel()]
                columns[f"TEXCOORD_{number}"] = _turned_down(further)
        if keeps_colors and mesh.colors is not None and mesh.colors.shape[1] in (3, 4):
            columns["COLOR_0"] = np.clip(mesh.colors[vertices], 0.0, 1.0)
        yield group, material, columns


def _parts(
    mesh: Mesh, name: str, materials: Materials | None
) -> Iterator[tuple[str, int, npt.NDArray[np.intp]]]:
    """Name, material and faces of each group that has faces, one for each of its materials."""
    groups = np.zeros(mesh.n_faces, np.int32) if mesh.face_groups is None else mesh.face_groups
    names = mesh.group_names if mesh.face_groups is not None else (name,)
    n_materials = 1 if materials is None else len(materials.materials)
    keys = groups.astype(np.int64) * n_materials
    if materials is not None:
        keys += materials.face_materials
    order = np.argsort(keys, kind="stable")
    used, firsts = np.unique(keys[order], return_index=True)
    n_of_groups = np.bincount(used // n_materials, minlength=len(names))
    for key, faces in zip(used.tolist(), np.split(order, firsts[1:]), strict=True):
        group, material = divmod(key, n_materials)
        label = names[group]
        if materials is not None and n_of_groups[group] > 1:
            label = f"{label} {materials.names[material]}"
        yield label, material, faces


def _turned_down(uvs: FloatArray) -> FloatColumns:
    return np.stack([uvs[:, 0], 1.0 - uvs[:, 1]], axis=1).astype(np.float32)


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
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    # 1e-6: what float32 leaves of a unit vector, which stays as it is, bit for bit.
    divisors = np.where((np.abs(lengths - 1.0) <= 1e-6) | (lengths == 0.0), 1.0, lengths)
    unit: FloatArray = np.where(lengths > 0.0, vectors / divisors, instead)
    return unit
