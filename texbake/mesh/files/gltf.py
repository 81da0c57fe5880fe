"""Reading glTF 2.0, as .glb or as .gltf with its buffers beside it or in it.

All triangles of the scene are joined into one mesh, in world space, one group to a primitive of a
node, so that a mesh that two nodes place is there twice. Vertices of a primitive at the same
position, bit for bit, become one, because the format splits them where a normal or a coordinate
differs; these keep their own indices, so that nothing is lost (but where such vertices differ in
color, which the first decides).

Skinned meshes come in the pose they are stored in, without their node's transform, and morph
targets at rest. Points and lines are skipped. Where only some primitives have texture coordinates
or normals, the others get zeros.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from texbake.errors import MeshError
from texbake.files import PathLike
from texbake.mesh.files.gltf_document import read_document
from texbake.mesh.files.gltf_nodes import mesh_matrix, placed_nodes
from texbake.mesh.files.gltf_primitive import Piece, read_primitive
from texbake.mesh.files.parts import joined_parts, with_alpha
from texbake.mesh.mesh import Mesh

_MAX_CORNERS = (1 << 31) - 1


def read_gltf(path: PathLike) -> Mesh:
    """Read a .glb or .gltf file; see the module for what becomes of a scene.

    Positions, NORMAL, TEXCOORD_0 (v turned up), TANGENT where all primitives have it, and COLOR_0.
    Groups are named after the node, else the mesh.

    Raises
    ------
    FileError
        The file, or a buffer beside it, is missing or cannot be read.
    FileFormatError
        It is not glTF 2.0, it is damaged, or it requires an extension that is not read.
    MeshError
        There are no triangles, or a coordinate is not finite.
    """
    document = read_document(path)
    parts: list[Mesh] = []
    n_corners = 0
    for node, matrix in placed_nodes(document):
        if "mesh" not in node:
            continue
        mesh = document.item("meshes", node["mesh"])
        name = str(node.get("name") or mesh.get("name") or f"mesh {node['mesh']}")
        primitives = document.objects(mesh, "primitives")
        for i, primitive in enumerate(primitives):
            piece = read_primitive(document, primitive)
            if piece is None:
                continue
            piece = piece.placed(mesh_matrix(node, matrix))
            # Instances could ask for more than the file has; indices are 32-bit.
            n_corners += max(piece.faces.size, len(piece.positions))
            if n_corners > _MAX_CORNERS:
                document.fail("it places more triangles than 32-bit indices can count")
            if len(piece.faces):
                group = name if len(primitives) == 1 else f"{name} {i}"
                parts.append(_part(piece, group, Path(path).name))
    if not parts:
        raise MeshError(f"{path}: it has no faces; a mesh needs at least one triangle")
    return joined_parts(parts, Path(path).name)


def _part(piece: Piece, group: str, name: str) -> Mesh:
    """Mesh of one group."""
    return Mesh(
        positions=piece.positions,
        faces=piece.faces,
        uvs=piece.uvs,
        uv_faces=None if piece.uvs is None else piece.corners,
        normals=piece.normals,
        normal_faces=None if piece.normals is None else piece.corners,
        tangents=None if piece.tangents is None else piece.tangents[piece.corners],
        colors=None if piece.colors is None else with_alpha(piece.colors),
        face_groups=np.zeros(len(piece.faces), np.int32),
        group_names=(group,),
        name=name,
    )
