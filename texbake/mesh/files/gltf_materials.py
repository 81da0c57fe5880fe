"""Base colors of glTF materials, and which faces have them.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021, section 3.9, and the
extension KHR_texture_transform.
"""

from __future__ import annotations

import base64
import math
from typing import Any
from urllib.parse import unquote

import numpy as np

from texbake.files import PathLike
from texbake.mesh.files.gltf_document import Document, read_document
from texbake.mesh.files.gltf_nodes import placed_nodes
from texbake.mesh.files.gltf_primitive import read_primitive
from texbake.mesh.files.source import map_file
from texbake.mesh.materials import UNPLACED, BaseColor, Materials, Placing
from texbake.mesh.mesh import FloatArray, Mesh

_WRAPS = {33071: "clamp", 33648: "mirror", 10497: "repeat"}
_REPEAT = 10497
_UNNAMED = "material"
# v down to v up, and back.
_FLIP = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])


def read_materials(path: PathLike, mesh: Mesh) -> Materials | None:
    """Read the materials of a glTF file; None where no primitive has one.

    Raises
    ------
    FileError
        An image beside the file is missing or cannot be read.
    FileFormatError
        It is damaged, or a base color lies on other texture coordinates than the first.
    """
    document = read_document(path)
    # The groups of the mesh are its primitives, in this order.
    primitives = [
        primitive
        for node, _ in placed_nodes(document)
        if "mesh" in node
        for primitive in document.objects(document.item("meshes", node["mesh"]), "primitives")
        if read_primitive(document, primitive) is not None
    ]
    used = [primitive.get("material") for primitive in primitives]
    if all(index is None for index in used) or mesh.face_groups is None:
        return None
    order = list(dict.fromkeys(used))
    of_groups = np.array([order.index(index) for index in used], dtype=np.int32)
    found = [{} if index is None else document.item("materials", index) for index in order]
    return Materials(
        face_materials=of_groups[mesh.face_groups],
        names=_names(order, found),
        base_colors=tuple(_base_color(document, material) for material in found),
    )


def _names(order: list[Any], materials: list[dict[str, Any]]) -> tuple[str, ...]:
    return tuple(
        str(material.get("name") or (_UNNAMED if index is None else f"{_UNNAMED} {index}"))
        for index, material in zip(order, materials, strict=True)
    )


def _base_color(document: Document, material: dict[str, Any]) -> BaseColor:
    surface = document.mapping(material, "pbrMetallicRoughness")
    numbers = document.numbers(surface, "baseColorFactor", 4)
    red, green, blue, _ = (1.0, 1.0, 1.0, 1.0) if numbers is None else numbers.tolist()
    if "baseColorTexture" not in surface:
        return BaseColor(factor=(red, green, blue))
    info = document.mapping(surface, "baseColorTexture")
    moved = document.mapping(document.mapping(info, "extensions"), "KHR_texture_transform")
    if document.integer(moved if "texCoord" in moved else info, "texCoord", 0) != 0:
        document.fail("a base color lies on TEXCOORD_1, and only TEXCOORD_0 is read")
    texture = document.item("textures", info.get("index"))
    sampler = {}
    if "sampler" in texture:
        sampler = document.item("samplers", texture["sampler"])
    index = texture.get("source")
    return BaseColor(
        factor=(red, green, blue),
        image=_image_bytes(document, index),
        image_name=f"{document.path}: images[{index}]",
        wrap=_WRAPS.get(sampler.get("wrapS", _REPEAT), "repeat"),
        placing=_placing(document, moved),
    )


def _image_bytes(document: Document, index: Any) -> bytes:
    image = document.item("images", index)
    uri = image.get("uri")
    if not isinstance(uri, str):
        return document.view_bytes(image.get("bufferView")).tobytes()
    if uri.startswith("data:"):
        try:
            return base64.b64decode(uri.partition(",")[2])
        except ValueError:
            document.fail(f"the data of images[{index}] is not base64")
    if "://" in uri:
        document.fail(f"images[{index}] is at {uri[:60]!r}; only local files are read")
    return map_file(document.path.parent / unquote(uri)).tobytes()


def _placing(document: Document, moved: dict[str, Any]) -> Placing:
    """Rows of the matrix of a KHR_texture_transform object, for coordinates with v up."""
    if not moved:
        return UNPLACED
    angle = moved.get("rotation", 0.0)
    if not isinstance(angle, int | float) or not math.isfinite(angle):
        document.fail("the rotation of a texture is not a number")
    scale, offset = (document.numbers(moved, key, 2) for key in ("scale", "offset"))
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    matrix: FloatArray = np.eye(3)
    matrix[:2, :2] = turn * (1.0 if scale is None else scale)
    matrix[:2, 2] = 0.0 if offset is None else offset
    (a, b, c), (d, e, f), _ = (_FLIP @ matrix @ _FLIP).tolist()
    return (a, b, c), (d, e, f)
