"""Reading glTF 2.0, as .glb or as .gltf with its buffers beside it or in it.

All triangles of the scene are joined into one mesh, in world space, one group for each primitive
of a node, so that a mesh that two nodes place is there twice. `gltf_primitives` says what becomes
of vertices.

Skinned meshes come in the pose they are stored in, without their node's transform, and morph
targets at rest. Where only some primitives have texture coordinates or normals, the others get
zeros.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

from texbake.errors import MeshError
from texbake.files import PathLike
from texbake.mesh.files.gltf_document import Document, read_document
from texbake.mesh.files.gltf_nodes import (
    INDICES,
    TRIANGLES,
    SceneNodes,
    check_instance_count,
    further_sets,
    scene_nodes,
)
from texbake.mesh.files.gltf_primitives import PrimitiveRequest, read_primitives
from texbake.mesh.files.source import short_name, without_cycle_search
from texbake.mesh.files.unread_parts import warn_of_gltf
from texbake.mesh.join import MeshPart, join_parts
from texbake.mesh.mesh import Mesh, check_corner_count, require_few_sets


def read_gltf(path: PathLike) -> Mesh:
    """Read a .glb or .gltf file; see the module for how a scene is converted.

    Positions, NORMAL, TEXCOORD_n (v turned up), TANGENT where all primitives have it, and COLOR_0.
    Groups are named after the node, else the mesh.
    """
    with without_cycle_search():
        placed = scene_nodes(read_document(path))
        check_instance_count(placed)
        parts = _read_parts(placed)
    if not parts:
        raise MeshError(f"{path}: it has no faces; a mesh needs at least one triangle")
    warn_of_gltf(placed.document)
    pieces, names, nodes = zip(*parts, strict=True)
    require_few_sets(len({name for piece in pieces for name in piece.uv_sets}), Path(path).name)
    matrices = placed.mesh_matrices(placed.matrices())[list(nodes)]
    groups = list(zip(names, nodes, strict=True))
    return join_parts(pieces, Path(path).name, matrices, groups=groups)


def _read_parts(placed: SceneNodes) -> list[tuple[MeshPart, str, int]]:
    """Read the primitives of a scene's nodes, each with a name and the place of its node.

    The arrays of equal ones are read once.
    """
    document = placed.document
    requests: dict[Any, PrimitiveRequest] = {}
    keys: dict[int, list[Any]] = {}  # of the primitives of each mesh
    for node in placed.nodes:
        if "mesh" not in node or (type(node["mesh"]) is int and node["mesh"] in keys):
            continue
        mesh = document.item("meshes", node["mesh"])
        keys[node["mesh"]] = []
        for primitive in document.objects(mesh, "primitives"):
            key = _array_key(document, primitive)
            keys[node["mesh"]].append(key)
            if key not in requests:
                further = further_sets(document, primitive)
                requests[key] = PrimitiveRequest(primitive, further=tuple(further))
    pieces = dict(zip(requests, read_primitives(document, list(requests.values())), strict=True))
    parts = []
    n_corners = 0
    for i, node in enumerate(placed.nodes):
        if "mesh" not in node:
            continue
        mesh = document.item("meshes", node["mesh"])
        name = short_name(node.get("name") or mesh.get("name") or f"mesh {node['mesh']}")
        of_mesh = keys[node["mesh"]]
        for number, key in enumerate(of_mesh):
            piece = pieces[key]
            if piece is None:
                continue
            # Instances could ask for more than the file has; indices are 32-bit.
            n_corners += max(piece.faces.size, len(piece.positions))
            check_corner_count(n_corners, document.path)
            ending = "" if len(of_mesh) == 1 else f" {number}"
            if piece.uv_sets:
                names = _uv_set_names(mesh, requests[key].further)
                sets = {set_name: piece.uv_sets[name] for set_name, name in names.items()}
                piece = replace(piece, uv_sets=sets)
            parts.append((piece, name + ending, i))
    return parts


def _array_key(document: Document, primitive: dict[str, Any]) -> Any:
    """Return a key that primitives with the same arrays share."""
    attributes = document.mapping(primitive, "attributes")
    numbers = [primitive.get("mode", TRIANGLES), primitive.get(INDICES, -1)]
    numbers += attributes.values()
    if "extensions" in primitive or set(map(type, numbers)) != {int}:
        return id(primitive)
    return (*attributes, *numbers)


def _uv_set_names(mesh: dict[str, Any], numbers: Collection[int]) -> dict[str, str]:
    """Attributes of sets of texture coordinates by the names of the sets.

    Files of texbake have names in the `extras` of a mesh, by the names of the attributes:
    `"extras": {"TEXCOORD_1": "lightmap"}`.
    """
    extras = mesh.get("extras")
    names: dict[str, str] = {}
    for number in numbers:
        attribute = f"TEXCOORD_{number}"
        name = extras.get(attribute) if isinstance(extras, dict) else None
        is_sound = isinstance(name, str) and name.strip() and name.isprintable()
        names[str(name) if is_sound and name not in names else attribute] = attribute
    return names
