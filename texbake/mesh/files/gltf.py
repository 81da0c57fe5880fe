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

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import MeshError
from texbake.files import PathLike
from texbake.mesh.files.gltf_document import Document, read_document
from texbake.mesh.join import offset_joined
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.weld import weld_rows

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
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
    pieces: list[_Piece] = []
    n_corners = 0
    for node, matrix in _placed_nodes(document):
        mesh = document.item("meshes", node["mesh"])
        name = str(node.get("name") or mesh.get("name") or f"mesh {node['mesh']}")
        primitives = document.objects(mesh, "primitives")
        for i, primitive in enumerate(primitives):
            piece = _read_primitive(document, primitive, matrix)
            if piece is None:
                continue
            # Instances could ask for more than the file has; indices are 32-bit.
            n_corners += max(piece.faces.size, len(piece.positions))
            if n_corners > _MAX_CORNERS:
                document.fail("it places more triangles than 32-bit indices can count")
            names.append(name if len(primitives) == 1 else f"{name} {i}")
            pieces.append(piece)
    if not any(len(piece.faces) for piece in pieces):
        raise MeshError(f"{path}: it has no faces; a mesh needs at least one triangle")
    return _joined(pieces, tuple(names), Path(path).name)


@dataclass(frozen=True)
class _Piece:
    """A primitive as placed by a node. `corners` (F, 3) index all attributes but positions."""

    positions: FloatArray
    faces: IntArray
    corners: IntArray
    uvs: FloatArray | None
    normals: FloatArray | None
    tangents: npt.NDArray[np.float32] | None
    colors: npt.NDArray[np.float32] | None


def _placed_nodes(document: Document) -> Iterator[tuple[dict[str, Any], FloatArray]]:
    """Nodes of the scene that have a mesh, depth first, with their (4, 4) matrix to the world."""
    nodes = document.items("nodes")
    if not nodes:
        for i in range(len(document.items("meshes"))):
            yield {"mesh": i}, np.eye(4)
        return
    pending = [(root, np.eye(4)) for root in reversed(_roots(document, nodes))]
    seen = set()
    while pending:
        index, parent = pending.pop()
        node = document.item("nodes", index)
        if index in seen:
            document.fail(f"nodes[{index}] stands twice in the scene")
        seen.add(index)
        matrix = parent @ _local_matrix(document, node)
        if "mesh" in node:
            yield node, np.eye(4) if "skin" in node else matrix
        pending += [(child, matrix) for child in reversed(_indices(document, node, "children"))]


def _roots(document: Document, nodes: list[dict[str, Any]]) -> list[int]:
    """Indices of the nodes at the top: of the scene, else of the first, else of the whole file."""
    if document.items("scenes"):
        return _indices(
            document, document.item("scenes", document.content.get("scene", 0)), "nodes"
        )
    children = {child for node in nodes for child in _indices(document, node, "children")}
    return [i for i in range(len(nodes)) if i not in children]


def _indices(document: Document, owner: dict[str, Any], key: str) -> list[int]:
    indices = owner.get(key, [])
    if not isinstance(indices, list) or not all(isinstance(index, int) for index in indices):
        document.fail(f"{key!r} is not a list of indices")
    return indices


def _local_matrix(document: Document, node: dict[str, Any]) -> FloatArray:
    """(4, 4) matrix of a node, from its columns or its translation, rotation and scale."""
    columns = document.numbers(node, "matrix", 16)
    if columns is not None:
        return columns.reshape(4, 4).T
    matrix = np.eye(4)
    rotation = document.numbers(node, "rotation", 4)
    if rotation is not None:
        length = float(np.linalg.norm(rotation))
        x, y, z, w = rotation / length if length > 0.0 else (0.0, 0.0, 0.0, 1.0)
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    scale = document.numbers(node, "scale", 3)
    if scale is not None:
        matrix[:3, :3] *= scale
    translation = document.numbers(node, "translation", 3)
    if translation is not None:
        matrix[:3, 3] = translation
    return matrix


def _read_primitive(
    document: Document, primitive: dict[str, Any], matrix: FloatArray
) -> _Piece | None:
    """Triangles of a primitive in the world, or None where it has none."""
    mode = primitive.get("mode", _TRIANGLES)
    attributes = document.mapping(primitive, "attributes")
    if mode not in (_TRIANGLES, _STRIP, _FAN) or "POSITION" not in attributes:
        return None
    positions = _attribute(document, attributes, "POSITION", (3,), None)
    assert positions is not None
    n = len(positions)
    corners = _triangles(_corner_indices(document, primitive, n), mode)
    linear = matrix[:3, :3]
    mirrored = float(np.linalg.det(linear)) < 0.0
    if mirrored:
        corners = corners[:, ::-1]
    firsts = weld_rows(positions + 0.0)
    kept, vertices = np.unique(firsts, return_inverse=True)
    uvs = _attribute(document, attributes, "TEXCOORD_0", (2,), n)
    normals = _attribute(document, attributes, "NORMAL", (3,), n)
    tangents = _attribute(document, attributes, "TANGENT", (4,), n)
    colors = _attribute(document, attributes, "COLOR_0", (3, 4), n)
    return _Piece(
        positions=positions[kept] @ linear.T + matrix[:3, 3],
        faces=vertices.astype(np.int32)[corners],
        corners=corners,
        uvs=None if uvs is None else np.stack([uvs[:, 0], 1.0 - uvs[:, 1]], axis=1),
        normals=None if normals is None else _turned_normals(normals, linear),
        tangents=None if tangents is None else _turned_tangents(tangents, linear, mirrored),
        colors=None if colors is None else colors[kept].astype(np.float32),
    )


def _attribute(
    document: Document,
    attributes: dict[str, Any],
    name: str,
    widths: tuple[int, ...],
    count: int | None,
) -> FloatArray | None:
    """(count, width) float64 values of an attribute, or None where the primitive has none."""
    if name not in attributes:
        return None
    values = document.accessor(attributes[name])
    if values.shape[1] not in widths:
        document.fail(f"{name} has {values.shape[1]} components, not {widths[0]}")
    if count is not None and len(values) != count:
        document.fail(f"{name} counts {len(values)}, where there are {count} positions")
    return values.astype(np.float64)


def _corner_indices(
    document: Document, primitive: dict[str, Any], n_vertices: int
) -> npt.NDArray[np.int64]:
    if "indices" not in primitive:
        return np.arange(n_vertices)
    indices = document.accessor(primitive["indices"])
    if indices.shape[1] != 1 or indices.dtype.kind != "u":
        document.fail("indices are not unsigned integers")
    if len(indices) and indices.max() >= n_vertices:
        document.fail(f"an index is out of range ({indices.max()}; there are {n_vertices})")
    return indices[:, 0].astype(np.int64)


def _triangles(indices: npt.NDArray[np.int64], mode: int) -> IntArray:
    """(F, 3) corners of a list, a strip or a fan; an incomplete triangle at the end is dropped."""
    if mode == _TRIANGLES:
        triangles = indices[: len(indices) // 3 * 3].reshape(-1, 3)
    else:
        i = np.arange(max(len(indices) - 2, 0))
        odd = i % 2
        places = (i, i + 1 + odd, i + 2 - odd) if mode == _STRIP else (i + 1, i + 2, 0 * i)
        triangles = indices[np.stack(places, axis=1)]
    return triangles.astype(np.int32)


def _turned_normals(normals: FloatArray, linear: FloatArray) -> FloatArray:
    """Normals under a linear map, by its inverse transpose up to a positive factor."""
    rows = linear[[1, 2, 0]], linear[[2, 0, 1]]
    cofactors = np.cross(*rows)  # determinant times inverse transpose, defined also where that is 0
    sign = -1.0 if float(np.linalg.det(linear)) < 0.0 else 1.0
    return normals @ (sign * cofactors).T


def _turned_tangents(
    tangents: FloatArray, linear: FloatArray, mirrored: bool
) -> npt.NDArray[np.float32]:
    directions = tangents[:, :3] @ linear.T
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    # 1e-6: what float32 leaves of a unit vector, which stays as it is, bit for bit.
    scaled = (np.abs(lengths - 1.0) > 1e-6) & (lengths > 0.0)
    directions = np.divide(directions, lengths, out=directions, where=scaled)
    # w is the sign of the bitangent; what rounds to neither is no tangent space, and counts as 1.
    signs = np.where(tangents[:, 3:] < 0.0, -1.0, 1.0) * (-1.0 if mirrored else 1.0)
    return np.concatenate([directions, signs], axis=1).astype(np.float32)


def _joined(pieces: list[_Piece], names: tuple[str, ...], name: str) -> Mesh:
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


def _rgba(piece: _Piece) -> npt.NDArray[np.float32]:
    """(V, 4) colors of a piece, opaque white where it has none."""
    colors = np.ones((len(piece.positions), 4), np.float32)
    if piece.colors is not None:
        colors[:, : piece.colors.shape[1]] = piece.colors
    return colors
