"""Materials of glTF files, with every channel that `gltf_channels` lists.

The factor of an occlusion is its strength: 1 + strength (texel - 1). That of a normal map is its
scale, which acts on x and y. A texture that cannot be read is noted, and the channel keeps its
factor.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021, section 3.9, and the
extensions KHR_texture_transform, EXT_texture_webp and KHR_materials_emissive_strength.
"""

from __future__ import annotations

import base64
import math
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import unquote

import numpy as np

from texbake.errors import FileError, FileFormatError
from texbake.files import PathLike
from texbake.mesh.files.gltf import placed_nodes, primitive_uvs, triangle_count
from texbake.mesh.files.gltf_channels import EMISSIVE_STRENGTH, GLTF_CHANNELS, GltfChannel
from texbake.mesh.files.gltf_document import Document, read_document
from texbake.mesh.files.source import map_file
from texbake.mesh.materials import (
    UNPLACED,
    ChannelImage,
    ChannelSource,
    Materials,
    MeshMaterial,
    Placing,
)
from texbake.mesh.mesh import FloatArray, Mesh

_WRAPS = {33071: "clamp", 33648: "mirror", 10497: "repeat"}
_REPEAT = 10497
_NEAREST = 9728
_ALPHA_MODES = {"OPAQUE": "opaque", "MASK": "mask", "BLEND": "blend"}
_UNNAMED = "material"
# v down to v up, and back.
FLIP = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])


def read_gltf_materials(path: PathLike, mesh: Mesh) -> Materials | None:
    """Read the materials of a glTF file; None where no primitive has one, nor vertex colors.

    Raises
    ------
    FileError
        The file is missing or cannot be read.
    FileFormatError
        It is damaged.
    """
    document = read_document(path)
    # The groups of the mesh are its primitives, in this order.
    primitives = [
        primitive
        for node, _ in placed_nodes(document)
        if "mesh" in node
        for primitive in document.objects(document.item("meshes", node["mesh"]), "primitives")
        if triangle_count(document, primitive)
    ]
    used = [primitive.get("material") for primitive in primitives]
    if mesh.face_groups is None or len(used) != len(mesh.group_names):
        return None
    if all(index is None for index in used) and mesh.colors is None:
        return None
    order = list(dict.fromkeys(used))
    numbers = {index: i for i, index in enumerate(order)}
    of_groups = np.array([numbers[index] for index in used], dtype=np.int32)
    reader = _MaterialReader(document)
    materials = tuple(reader.material(index) for index in order)
    uv_sets = reader.uv_sets(materials, primitives, mesh)
    return Materials(
        face_materials=of_groups[mesh.face_groups],
        materials=tuple(material.on_uv_sets({0, *uv_sets}) for material in materials),
        uv_sets=uv_sets,
        has_vertex_colors=mesh.colors is not None,
        missing=tuple(reader.missing),
    )


@dataclass(eq=False)
class _MaterialReader:
    """Reads the materials of a document, each image once.

    Attributes
    ----------
    document : Document
    missing : list of (str, str)
        What could not be read, as in `Materials`; appended to.
    """

    document: Document
    missing: list[tuple[str, str]] = field(default_factory=list)
    _images: dict[Any, bytes | str] = field(default_factory=dict)

    def material(self, index: int | None) -> MeshMaterial:
        """Read the material with an index; None means glTF's default material."""
        document = self.document
        source = {} if index is None else document.item("materials", index)
        name = str(source.get("name") or (_UNNAMED if index is None else f"{_UNNAMED} {index}"))
        mode = source.get("alphaMode", "OPAQUE")
        if mode not in _ALPHA_MODES:
            document.fail(f"the alphaMode {mode!r} of {name!r} is not known")
        extensions = document.mapping(source, "extensions")
        channels = {}
        for where in GLTF_CHANNELS:
            owner = extensions if where.is_extension else source
            if where.is_extension and where.owner not in extensions:
                continue
            if where.name == "alpha" and mode == "OPAQUE":
                continue
            holder = document.mapping(owner, where.owner) if where.owner else owner
            found = self._source(where, holder, name)
            if found is not None:
                channels[where.name] = found
        self._add_strength(channels, extensions)
        return MeshMaterial(
            name=name,
            channels=channels,
            alpha_mode=_ALPHA_MODES[mode],
            alpha_cutoff=self._number(source, "alphaCutoff", 0.5),
            is_double_sided=bool(source.get("doubleSided", False)),
            is_unlit="KHR_materials_unlit" in extensions,
        )

    def uv_sets(
        self, materials: tuple[MeshMaterial, ...], primitives: list[dict[str, Any]], mesh: Mesh
    ) -> dict[int, FloatArray]:
        """Read the sets of texture coordinates after the first that images lie on."""
        numbers = {
            source.image.uv_set
            for material in materials
            for source in material.channels.values()
            if source.image is not None
        } - {0}
        sets = {}
        for number in sorted(numbers):
            rows = [primitive_uvs(self.document, primitive, number) for primitive in primitives]
            firsts = [primitive_uvs(self.document, primitive, 0) for primitive in primitives]
            # Where only some primitives have the first set, the others have one row of it.
            lengths = [1 if first is None else len(first) for first in firsts]
            if mesh.uvs is None or sum(lengths) != len(mesh.uvs):
                line = f"images lie on TEXCOORD_{number}, and the mesh has no TEXCOORD_0"
                self.missing.append(("", f"{line}; they are left out"))
                continue
            sets[number] = np.concatenate(
                [
                    np.zeros((length, 2)) if row is None or len(row) != length else row
                    for row, length in zip(rows, lengths, strict=True)
                ]
            )
        return sets

    def _source(
        self, where: GltfChannel, holder: dict[str, Any], material: str
    ) -> ChannelSource | None:
        """Read where a channel comes from; None where it changes nothing."""
        info = self.document.mapping(holder, where.texture)
        image = None
        if where.texture in holder:
            image = self._image(where, info, material)
        if where.name == "normal":
            scale = self._number(info, "scale", 1.0, is_signed=True)
            return None if image is None else ChannelSource((scale, scale, 1.0), image)
        if where.name == "occlusion":
            strength = min(self._number(info, "strength", 1.0), 1.0)
            return None if image is None else ChannelSource((strength,), image, 1.0 - strength)
        values = where.defaults
        if len(values) > 1:
            numbers = self.document.numbers(holder, where.factor, len(values))
            values = values if numbers is None else tuple(numbers.tolist())
        else:
            values = (self._number(holder, where.factor, values[0]),)
        factor = tuple(values[i] for i in where.factor_components)
        if min(factor) < 0.0:
            self.document.fail(f"{where.factor!r} is below 0")
        if where.name == "emissive" and not any(factor):
            return None
        return ChannelSource(factor, image)

    def _add_strength(self, channels: dict[str, ChannelSource], extensions: dict[str, Any]) -> None:
        """Multiply what a material emits by its strength."""
        found = channels.get("emissive")
        if found is not None and EMISSIVE_STRENGTH in extensions:
            owner = self.document.mapping(extensions, EMISSIVE_STRENGTH)
            strength = self._number(owner, "emissiveStrength", 1.0)
            factor = tuple(value * strength for value in found.factor)
            channels["emissive"] = ChannelSource(factor, found.image)

    def _image(
        self, where: GltfChannel, info: dict[str, Any], material: str
    ) -> ChannelImage | None:
        """Read the texture of a textureInfo object; None, and a note, where it is missing."""
        document = self.document
        moved = document.mapping(document.mapping(info, "extensions"), "KHR_texture_transform")
        texture = document.item("textures", info.get("index"))
        webp = document.mapping(document.mapping(texture, "extensions"), "EXT_texture_webp")
        index = webp.get("source", texture.get("source"))
        if index not in self._images:
            self._images[index] = self._bytes(index)
        data = self._images[index]
        if isinstance(data, str):
            line = f"{material}: {data}; the material keeps its factors"
            self.missing.append((where.name, line))
            return None
        sampler = {}
        if "sampler" in texture:
            sampler = document.item("samplers", texture["sampler"])
        wraps = [_WRAPS.get(sampler.get(key, _REPEAT), "repeat") for key in ("wrapS", "wrapT")]
        return ChannelImage(
            data=data,
            name=f"{document.path}: images[{index}]",
            components=where.components,
            wraps=(wraps[0], wraps[1]),
            placing=_placing(document, moved),
            uv_set=document.integer(moved if "texCoord" in moved else info, "texCoord", 0),
            is_nearest=sampler.get("magFilter") == _NEAREST,
        )

    def _bytes(self, index: Any) -> bytes | str:
        """Content of an image, or why there is none."""
        if index is None:
            return "a texture has no image in a format that is read"
        try:
            return image_bytes(self.document, index)
        except FileFormatError:
            raise
        except FileError as error:
            return str(error)

    def _number(
        self, owner: dict[str, Any], key: str, default: float, *, is_signed: bool = False
    ) -> float:
        value = owner.get(key, default)
        if (
            not isinstance(value, int | float)
            or isinstance(value, bool)
            or not math.isfinite(value)
            or (value < 0.0 and not is_signed)
        ):
            self.document.fail(f"{key!r} is {value!r}, which is not a valid number")
        return float(value)


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
    (a, b, c), (d, e, f), _ = (FLIP @ matrix @ FLIP).tolist()
    return (a, b, c), (d, e, f)
