"""Base colors that mesh files give their faces: materials of OBJ with its .mtl files, and of glTF.

Based on:
    Wavefront Technologies, "Object Files (.obj)", appendix B1, and "MTL material format", 1995;
    Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021, section 3.9, and the extension
        KHR_texture_transform.

MTL does not say how colors are meant. Here Kd is linear, and where there is a `map_Kd`, it alone is
the color, because programs that write one leave arbitrary values in Kd. Options of `map_Kd` are
skipped, except for `-clamp`.
"""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from texbake.errors import FileFormatError
from texbake.files import PathLike
from texbake.mesh.files.conversion import fan_corners
from texbake.mesh.files.gltf import placed_nodes, read_primitive
from texbake.mesh.files.gltf_document import Document, read_document
from texbake.mesh.files.obj import MARK, F, find_lines, read_corners
from texbake.mesh.files.source import decode_name, map_file
from texbake.mesh.materials import UNPLACED, BaseColor, Materials, Placing
from texbake.mesh.mesh import FloatArray, Mesh

_USE = re.compile(rb"usemtl\b[^\S\r\n]*([^\r\n]*)")
_LIBRARY = re.compile(rb"^[^\S\r\n]*mtllib[^\S\r\n]+([^\r\n]+)", re.MULTILINE)
_STATEMENT = re.compile(rb"^[^\S\r\n]*(newmtl|Kd|map_Kd)[^\S\r\n]+([^\r\n]+)", re.MULTILINE)
# Options of a map, by how many words follow them at most.
_OPTION_WORDS = {
    "-blendu": 1, "-blendv": 1, "-boost": 1, "-bm": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1,
    "-mm": 2, "-o": 3, "-s": 3, "-t": 3, "-texres": 1, "-type": 1,
}  # fmt: skip


def read_obj_materials(path: PathLike, mesh: Mesh) -> Materials | None:
    """Read the materials of an OBJ file; None where no face has one.

    Faces before the first `usemtl` have the material `default`.

    Raises
    ------
    FileError
        A .mtl file or an image that it names is missing or cannot be read.
    FileFormatError
        A color is not three numbers.
    """
    data = map_file(path)
    lines = find_lines(data)
    starts = np.searchsorted(lines[F], lines[MARK]).tolist()
    uses = [
        (decode_name(match[1].strip()) or "default", start)
        for at, start in zip(lines[MARK].tolist(), starts, strict=True)
        if (match := _USE.match(data.data, at))
    ]
    if not uses:
        return None
    n_polygons = len(lines[F])
    polygons = np.zeros(n_polygons, dtype=np.int32)
    ids: dict[str, int] = {"default": 0} if uses[0][1] > 0 else {}
    stops = [start for _, start in uses[1:]]
    for (name, start), stop in zip(uses, [*stops, n_polygons], strict=True):
        if stop > start:
            polygons[start:stop] = ids.setdefault(name, len(ids))
    faces = polygons
    if n_polygons != mesh.n_faces:
        sizes, _ = read_corners(path, data, lines)
        faces = polygons[fan_corners(sizes)[1]]
    colors = _read_libraries(Path(path), data.data)
    return Materials(
        face_materials=faces, names=tuple(ids), base_colors=tuple(colors.get(name) for name in ids)
    )


def _read_libraries(path: Path, data: memoryview) -> dict[str, BaseColor]:
    """Base colors by the names of materials; the first library that has a name counts."""
    colors: dict[str, BaseColor] = {}
    for library in library_paths(path, data):
        colors = {**_read_library(library), **colors}
    return colors


def library_paths(path: Path, data: memoryview) -> Iterator[Path]:
    """Yield the paths of the .mtl files that an OBJ file names."""
    for match in _LIBRARY.finditer(data):
        name = decode_name(match[1].strip())
        # One name with spaces in it, or several without.
        names = [name] if (path.parent / name).is_file() else name.split()
        yield from (path.parent / library for library in names)


def _read_library(path: Path) -> dict[str, BaseColor]:
    colors: dict[str, BaseColor] = {}
    name = "default"
    mapped = set()
    for match in _STATEMENT.finditer(map_file(path).data):
        keyword, words = match[1], decode_name(match[2].strip())
        if keyword == b"newmtl":
            name = words
            colors[name] = BaseColor()
        elif keyword == b"map_Kd":
            colors[name] = _mapped(path, words)
            mapped.add(name)
        elif name not in mapped:
            colors[name] = BaseColor(factor=_factor(path, words))
    return colors


def _factor(path: Path, words: str) -> tuple[float, float, float]:
    try:
        numbers = [float(word) for word in words.split()]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 3) or not np.isfinite(numbers).all():
        raise FileFormatError(f"{path}: Kd {words!r} is not a color of three numbers; correct it")
    red, green, blue = numbers * 3 if len(numbers) == 1 else numbers
    return red, green, blue


def _mapped(path: Path, words: str) -> BaseColor:
    """Base color of a map_Kd statement."""
    image, wrap = map_path(path, words)
    return BaseColor(image=map_file(image).tobytes(), image_name=str(image), wrap=wrap)


def map_path(path: Path, words: str) -> tuple[Path, str]:
    """File and wrapping of a map statement: options, then the name of a file, spaces and all."""
    wrap, rest = "repeat", words
    while (parts := rest.split(maxsplit=1)) and parts[0] in _OPTION_WORDS:
        option, rest = parts[0], parts[1] if len(parts) > 1 else ""
        for _ in range(_OPTION_WORDS[option]):
            value, _, after = rest.partition(" ")
            if _OPTION_WORDS[option] > 1 and not _is_number(value):
                break
            if option == "-clamp" and value == "on":
                wrap = "clamp"
            rest = after.lstrip()
    return path.parent / rest.replace("\\", "/"), wrap


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


_WRAPS = {33071: "clamp", 33648: "mirror", 10497: "repeat"}
_REPEAT = 10497
_UNNAMED = "material"
# v down to v up, and back.
_FLIP = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])


def read_gltf_materials(path: PathLike, mesh: Mesh) -> Materials | None:
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
        image=image_bytes(document, index),
        image_name=f"{document.path}: images[{index}]",
        wrap=_WRAPS.get(sampler.get("wrapS", _REPEAT), "repeat"),
        placing=_placing(document, moved),
    )


def image_bytes(document: Document, index: Any) -> bytes:
    """Content of an image file of a document, or in it.

    Raises
    ------
    FileError
        It is missing or cannot be read.
    FileFormatError
        The document is damaged.
    """
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
