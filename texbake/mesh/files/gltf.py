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
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import MeshError
from texbake.files import PathLike
from texbake.mesh.files.gltf_document import read_document
from texbake.mesh.files.gltf_nodes import mesh_matrix, placed_nodes
from texbake.mesh.files.gltf_primitive import Piece, read_primitive
from texbake.mesh.join import offset_joined
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
    names: list[str] = []
    pieces: list[Piece] = []
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
            names.append(name if len(primitives) == 1 else f"{name} {i}")
            pieces.append(piece)
    if not any(len(piece.faces) for piece in pieces):
        raise MeshError(f"{path}: it has no faces; a mesh needs at least one triangle")
    return _joined(pieces, tuple(names), Path(path).name)


def _joined(pieces: list[Piece], names: tuple[str, ...], name: str) -> Mesh:
    """One mesh of all pieces, one group a piece."""
    fields: dict[str, Any] = {
        "positions": np.concatenate([piece.positions for piece in pieces]),
        "faces": offset_joined([(piece.faces, len(piece.positions)) for piece in pieces]),
        "face_groups": np.repeat(np.arange(len(pieces)), [len(piece.faces) for piece in pieces]),
        "group_names": names,
        "name": name,
    }
    for values, corners, width in (("uvs", "uv_faces", 2), ("normals", "normal_faces", 3)):
        arrays = [getattr(piece, values) for piece in pieces]
        if all(array is None for array in arrays):
            continue
        zero = np.zeros((1, width))
        fields[values] = np.concatenate([zero if array is None else array for array in arrays])
        fields[corners] = offset_joined(
            [
                (0 * piece.corners, 1) if array is None else (piece.corners, len(array))
                for piece, array in zip(pieces, arrays, strict=True)
            ]
        )
    if all(piece.tangents is not None for piece in pieces):
        fields["tangents"] = np.concatenate(
            [piece.tangents[piece.corners] for piece in pieces if piece.tangents is not None]
        )
    if any(piece.colors is not None for piece in pieces):
        fields["colors"] = np.concatenate([_rgba(piece) for piece in pieces])
    return Mesh(**fields)


def _rgba(piece: Piece) -> npt.NDArray[np.float32]:
    """(V, 4) colors of a piece, opaque white where it has none."""
    colors = np.ones((len(piece.positions), 4), np.float32)
    if piece.colors is not None:
        colors[:, : piece.colors.shape[1]] = piece.colors
    return colors
