"""The nodes of a glTF scene: where each mesh stands, and how many triangles that makes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from texbake.mesh.files.gltf_document import Document
from texbake.mesh.mesh import FloatArray

TRIANGLES, STRIP, FAN = 4, 5, 6
"""Modes of primitives."""
INDICES = "indices"
MAX_PLACED = 100_000_000
"""Triangles that the nodes of a file may place, if its meshes have fewer."""


def require_placeable(document: Document) -> None:
    """Raise `FileFormatError` if the nodes of a file repeat its triangles without measure.

    No triangle is read for that: a small file could ask for more than fits into memory.
    """
    counts: dict[int, int] = {}
    n_placed = 0
    for node, _ in placed_nodes(document):
        index = node.get("mesh")
        if index is None:
            continue
        if index not in counts:
            primitives = document.objects(document.item("meshes", index), "primitives")
            counts[index] = sum(triangle_count(document, primitive) for primitive in primitives)
        n_placed += counts[index]
    if n_placed > max(MAX_PLACED, sum(counts.values())):
        document.fail(
            f"its nodes repeat {sum(counts.values()):,} triangles until there are {n_placed:,}; "
            f"more than {MAX_PLACED:,} are not read"
        )


def placed_nodes(document: Document) -> Iterator[tuple[dict[str, Any], FloatArray]]:
    """Nodes of the scene, depth first, each with its (4, 4) matrix to the world.

    A file without nodes has each of its meshes once, where it is.
    """
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
        yield node, matrix
        pending += [(child, matrix) for child in reversed(_indices(document, node, "children"))]


def mesh_matrix(node: dict[str, Any], matrix: FloatArray) -> FloatArray:
    """Matrix of a node's mesh: one with a skin stands where its joints are, not at the node."""
    return np.eye(4) if "skin" in node else matrix


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


def triangle_count(document: Document, primitive: dict[str, Any]) -> int:
    """Number of triangles that `read_primitive` finds, without reading them."""
    mode = primitive.get("mode", TRIANGLES)
    attributes = document.mapping(primitive, "attributes")
    if mode not in (TRIANGLES, STRIP, FAN) or "POSITION" not in attributes:
        return 0
    counted = primitive.get(INDICES, attributes["POSITION"])
    count = document.integer(document.item("accessors", counted), "count", 0)
    return count // 3 if mode == TRIANGLES else max(count - 2, 0)
