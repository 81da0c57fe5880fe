"""Materials of OBJ files, in the .mtl files that they name: read, and written with their images.

Kd and Ke are linear here, and where there is an image, it alone is the color. Of the options of
images only `-clamp` is read; `Tr` is skipped, because programs do not agree on whether 0 or 1 is
opaque. Roughness and metallic are Pr and Pm; normal maps are those of `norm`.

Of a channel, its image or its factor is written, never both, and an image has one channel in it, as
`texbake.texture.material_images` makes it.

Based on: Wavefront Technologies, "Object Files (.obj)", appendix B1, and "MTL material format",
1995; Dirk Guenther, "MTL extension for physically based rendering", Clara.io, 2015.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from texbake.errors import FileError, FileFormatError, quoted, shortened, warn_of
from texbake.files import PathLike, appearing_together, is_file, read_bytes, replacing
from texbake.limits import file_beside, real_path
from texbake.mesh.files.channels import FILE_CHANNELS
from texbake.mesh.files.obj import F, find_lines, polygon_sizes, read_marks, read_obj_text
from texbake.mesh.files.obj_write import plain_name, write_obj
from texbake.mesh.files.source import BYTE_ORDER_MARK, decode_name
from texbake.mesh.materials import (
    CHANNELS,
    ChannelImage,
    ChannelSource,
    Materials,
    MeshMaterial,
    MissingParts,
)
from texbake.mesh.mesh import Mesh
from texbake.mesh.polygons import polygon_of_triangles

_LIBRARY = re.compile(rb"^[^\S\r\n]*mtllib[^\S\r\n]+([^\r\n]+)", re.MULTILINE)
_STATEMENT = re.compile(rb"^[^\S\r\n]*([A-Za-z_]+)[^\S\r\n]+([^\r\n]+)", re.MULTILINE)
# Channels by the statements of their values, and by those of their images, in lower case.
VALUES = {where.mtl.lower(): where.name for where in FILE_CHANNELS.values() if where.mtl}
IMAGES = {
    where.mtl_image.lower(): where.name for where in FILE_CHANNELS.values() if where.mtl_image
}
# Statements of images that change the appearance but are left out, and the nearest channels.
_LEFT_OUT = {
    "map_bump": "normal", "bump": "normal", "map_ks": "specular", "map_ns": "roughness",
    "disp": "displacement", "refl": "environment", "decal": "base-color",
}  # fmt: skip
_RED = (0,)
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
# Options of a map, by how many words follow them at most.
_OPTION_WORDS = {
    "-blendu": 1, "-blendv": 1, "-boost": 1, "-bm": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1,
    "-mm": 2, "-o": 3, "-s": 3, "-t": 3, "-texres": 1, "-type": 1,
}  # fmt: skip


# Content and name of each image that has been read, by its real path.
Images = dict[str, tuple[bytes, str]]


def read_obj_materials(path: PathLike, mesh: Mesh) -> Materials | None:
    """Materials of an OBJ file, `default` before the first `usemtl`; None without any."""
    data = read_obj_text(path)
    if re.search(rb"usemtl", data.data) is None:
        return None
    lines = find_lines(data)
    uses = [
        (decode_name(name) or "default", start)
        for keyword, name, start in read_marks(data, lines)
        if keyword == b"usemtl"
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
    faces = polygons[polygon_of_triangles(polygon_sizes(data, lines))]
    missing = MissingParts()
    known = _read_libraries(Path(path), data.data, missing)
    return Materials(
        face_materials=faces,
        materials=tuple(known.get(name, MeshMaterial(name=name)) for name in ids),
        **missing.fields(),
    )


def _read_libraries(path: Path, data: memoryview, missing: MissingParts) -> dict[str, MeshMaterial]:
    """Materials by their names; the first library that has a name counts."""
    known: dict[str, MeshMaterial] = {}
    images: Images = {}
    for library in library_names(path, data):
        try:
            known = _read_library(file_beside(path, library), missing, images) | known
        except FileFormatError:
            raise
        except FileError as error:
            missing.add("", f"{error}; its materials are left out")
    return known


def library_names(path: Path, data: bytes | memoryview) -> list[str]:
    """Return the names of the .mtl files that an OBJ file needs, one for each file."""
    names: dict[str, str] = {}
    spelled: dict[str, None] = {}
    for statement in dict.fromkeys(match[1].strip() for match in _LIBRARY.finditer(data)):
        name = decode_name(statement)
        # One name with spaces in it, or several without.
        spelled.update(dict.fromkeys([name] if is_file(path.parent / name) else name.split()))
    for name in spelled:
        names.setdefault(real_path(path, name), name)
    return list(names.values())


def library_statements(path: Path) -> Iterator[tuple[str, str]]:
    """Yield the keyword of each statement of a .mtl file, and the rest of its line."""
    for match in _STATEMENT.finditer(read_bytes(path).removeprefix(BYTE_ORDER_MARK)):
        yield match[1].decode(), decode_name(match[2].strip())


def _read_library(path: Path, missing: MissingParts, images: Images) -> dict[str, MeshMaterial]:
    known: dict[str, dict[str, ChannelSource]] = {}
    name = "default"
    for word, words in library_statements(path):
        statement = word.lower()
        if word == "newmtl":
            name = words
            known[name] = {}
        elif statement in VALUES or statement in IMAGES:
            channels = known.setdefault(name, {})
            channel = VALUES.get(statement) or IMAGES[statement]
            before = channels.get(channel, ChannelSource(CHANNELS[channel].default))
            if statement in IMAGES:
                try:
                    channels[channel] = _mapped(path, channel, words, images, before.factor)
                except FileError as error:
                    line = f"{shortened(name)}: {error}; the material keeps its factors"
                    missing.add(channel, line, image=Path(map_name(words)[0]).name)
            elif before.image is None:
                channels[channel] = ChannelSource(_numbers(path, word, words, len(before.factor)))
        elif statement in _LEFT_OUT:
            image = quoted(Path(map_name(words)[0]).name)
            missing.add(_LEFT_OUT[statement], f"{shortened(name)}: left out {word} {image}")
    return {
        name: MeshMaterial(
            name=name,
            channels=channels,
            alpha_mode="blend" if channels.get("alpha", _OPAQUE) != _OPAQUE else "opaque",
        )
        for name, channels in known.items()
    }


_OPAQUE = ChannelSource((1.0,))


def _numbers(path: Path, statement: str, words: str, width: int) -> tuple[float, ...]:
    """Parse the numbers of a statement; one alone stands for all of a color."""
    if "," in words and "." not in words:
        warn_of(path, "decimal commas are read as decimal points")
        words = words.replace(",", ".")
    try:
        numbers = [float(word) for word in words.split()]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, width) or not np.isfinite(numbers).all():
        wanted = "a color of three numbers" if width == 3 else "a number"
        raise FileFormatError(f"{path}: {statement} {quoted(words)} is not {wanted}; correct it")
    return tuple(numbers * width if len(numbers) == 1 else numbers)


def _mapped(
    path: Path, channel: str, words: str, images: Images, fallback: tuple[float, ...]
) -> ChannelSource:
    """Read the image that a statement names, if it has not been read."""
    name, wrap = map_name(words)
    alone = Path(name).name
    if not is_file(path.parent / name) and is_file(path.parent / alone):
        name = alone  # the folders are those of the machine that wrote it
    file = file_beside(path, name)
    key = real_path(path, name)
    if key not in images:
        images[key] = read_bytes(file), str(file)
    data, label = images[key]
    kind = CHANNELS[channel]
    image = ChannelImage(
        data=data,
        name=label,
        components=_RED if len(kind.default) == 1 else (0, 1, 2),
        wraps=(wrap, wrap),
    )
    return ChannelSource((1.0,) * len(kind.default), image, fallback=fallback)


def map_name(words: str) -> tuple[str, str]:
    """Name and wrapping of a map statement: options, then the name of a file, spaces and all."""
    wrap, rest = "repeat", words
    while (parts := rest.split(maxsplit=1)) and parts[0] in _OPTION_WORDS:
        option, rest = parts[0], parts[1] if len(parts) > 1 else ""
        for _ in range(_OPTION_WORDS[option]):
            value, _, after = rest.partition(" ")
            if _OPTION_WORDS[option] > 1 and not _NUMBER.fullmatch(value):
                break
            if option == "-clamp" and value == "on":
                wrap = "clamp"
            rest = after.lstrip()
    return rest.replace("\\", "/"), wrap


MTL_CHANNELS = ("base-color", "emissive", "alpha", "roughness", "metallic", "normal")
"""Channels that .mtl files have, in the order in which they are written."""


@appearing_together()
def write_obj_materials(mesh: Mesh, path: PathLike, materials: Materials) -> tuple[Path, ...]:
    """Write an OBJ file, its .mtl file and images, together; return their paths."""
    path = Path(path)
    library = path.with_suffix(".mtl")
    names = _unique_names(materials)
    images = _image_names(materials, path.stem)
    lines: list[str] = []
    for name, material in zip(names, materials.materials, strict=True):
        lines += [f"newmtl {name}", *_statements(material, images), ""]
    contents = {path.with_name(file): data for data, file in images.items()}
    contents[library] = "\n".join(lines).encode("utf-8", "replace")
    for file, content in contents.items():
        with replacing(file) as temporary:
            temporary.write_bytes(content)
    write_obj(
        mesh,
        path,
        library=library.name,
        face_materials=materials.face_materials,
        material_names=names,
    )
    return path, *contents


def _unique_names(materials: Materials) -> list[str]:
    names: list[str] = []
    for material in materials.materials:
        name = plain_name(material.name) or "material"
        number = 1
        while name in names:
            number += 1
            name = f"{plain_name(material.name) or 'material'} {number}"
        names.append(name)
    return names


def _image_names(materials: Materials, stem: str) -> dict[bytes, str]:
    """File names of images, each after the first channel that has it."""
    names: dict[bytes, str] = {}
    for material in materials.materials:
        for channel in MTL_CHANNELS:
            image = _image(material, channel)
            if image is None or image.data in names:
                continue
            suffix = Path(image.name).suffix.lower()
            name, number = f"{stem}_{channel}{suffix}", 1
            while name in names.values():
                number += 1
                name = f"{stem}_{channel}_{number}{suffix}"
            names[image.data] = name
    return names


def _image(material: MeshMaterial, channel: str) -> ChannelImage | None:
    source = material.channels.get(channel)
    return None if source is None else source.image


def _statements(material: MeshMaterial, images: dict[bytes, str]) -> Iterator[str]:
    """Yield the statements of a material."""
    for channel in MTL_CHANNELS:
        source = material.channels.get(channel)
        if source is not None and source.image is None and FILE_CHANNELS[channel].mtl:
            yield " ".join([FILE_CHANNELS[channel].mtl, *map(repr, source.factor)])
    for channel in MTL_CHANNELS:
        image = _image(material, channel)
        if image is not None:
            clamp = ["-clamp", "on"] if image.wraps == ("clamp", "clamp") else []
            yield " ".join([FILE_CHANNELS[channel].mtl_image, *clamp, images[image.data]])
