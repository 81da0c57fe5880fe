"""Materials as they are in a glTF file, in all channels of `channels`.

`read_material` reads a material as it is in the file, for meshes and for scenes. It names images by
their index, and `image_bytes` reads those that are used. A `KHR_texture_transform` applies to
coordinates with v down.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021, section 3.9, and the
extensions KHR_materials_clearcoat, KHR_materials_emissive_strength, KHR_materials_ior,
KHR_materials_sheen, KHR_materials_specular, KHR_materials_transmission, KHR_materials_unlit,
KHR_materials_volume, KHR_texture_transform and EXT_texture_webp.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from texbake.errors import FileError, FileFormatError, quoted
from texbake.files import read_bytes
from texbake.limits import file_beside, real_path
from texbake.mesh.files.channels import EMISSIVE_STRENGTH, FILE_CHANNELS, FileChannel
from texbake.mesh.files.gltf_document import LINEAR, NEAREST, WRAPS, Document
from texbake.records import dataclass

_NO_IMAGE = "a texture has no image in a supported format"
# Material extensions that are read, and their parts that are not.
_EXTENSIONS = {
    EMISSIVE_STRENGTH,
    "KHR_materials_unlit",
    *(where.owner for where in FILE_CHANNELS.values() if where.is_extension),
}
_LEFT_OUT = {("KHR_materials_clearcoat", "clearcoatNormalTexture")}
# Channels whose textureInfo holds a number of their own, and its name.
OF_TEXTURE = {"normal": "scale", "occlusion": "strength"}


@dataclass(frozen=True)
class GltfTexture:
    """What a textureInfo object says, with its texture and its sampler."""

    # Index into `images`; None where the texture has none in a format that is read.
    image: int | None
    # What lies outside the unit square along u and v: `repeat`, `mirror` or `clamp`. A number that
    # is none of glTF's counts as `repeat`, its default.
    wraps: tuple[str, str] = ("repeat", "repeat")
    is_nearest: bool = False  # whether a texel is one color up to its edges where it is magnified
    has_mip_levels: bool = True  # whether mip levels may be used where it is minified
    uv_set: int = 0  # number of the set of texture coordinates
    # The texture coordinates, v down, are scaled, then rotated, then moved.
    scale: tuple[float, float] = (1.0, 1.0)
    rotation: float = 0.0  # in radians
    offset: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class GltfSource:
    """Where the values of a channel come from."""

    # Linear. That of `normal` is its scale, and that of `occlusion` its strength, 1 at most; that
    # of `emissive` includes the emissive strength.
    factor: tuple[float, ...]
    texture: GltfTexture | None = None


@dataclass(frozen=True, kw_only=True)
class GltfVolume:
    """The volume behind a surface, as KHR_materials_volume has it."""

    thickness: GltfSource = GltfSource((0.0,))  # in units of the mesh; 0 is a thin sheet
    attenuation_color: tuple[float, float, float] = (1.0, 1.0, 1.0)  # of white light, linear
    attenuation_distance: float | None = None  # after which light has that color; None if never


@dataclass(frozen=True, kw_only=True)
class GltfMaterial:
    """A material."""

    name: str  # `material` and its index, where it has no name of its own
    # All of `FILE_CHANNELS` but those of extensions that the material does not use.
    channels: Mapping[str, GltfSource]
    alpha_mode: str = "opaque"  # `opaque`, `mask` or `blend`
    alpha_cutoff: float = 0.5
    is_double_sided: bool = False
    is_unlit: bool = False
    ior: float = 1.5  # index of refraction
    volume: GltfVolume = GltfVolume()


def material_index(document: Document, primitive: dict[str, Any]) -> int | None:
    """Index of a primitive's material, checked; None where it has glTF's default material."""
    index: int | None = primitive.get("material")
    if index is not None:
        document.item("materials", index)
    return index


def read_material(document: Document, index: int | None) -> GltfMaterial:
    """Read the material with an index; None means glTF's default material."""
    source = {} if index is None else document.item("materials", index)
    name = str(source.get("name") or ("material" if index is None else f"material {index}"))
    mode = source.get("alphaMode", "OPAQUE")
    if mode not in ("OPAQUE", "MASK", "BLEND"):
        document.fail(f"the alphaMode {quoted(mode)} of {quoted(name)} is not known")
    extensions = document.mapping(source, "extensions")
    return GltfMaterial(
        name=name,
        channels={
            where.name: _source(document, where, source, extensions)
            for where in FILE_CHANNELS.values()
            if not where.is_extension or where.owner in extensions
        },
        alpha_mode=mode.lower(),
        alpha_cutoff=document.number(source, "alphaCutoff", 0.5),
        is_double_sided=bool(source.get("doubleSided", False)),
        is_unlit="KHR_materials_unlit" in extensions,
        ior=document.number(document.mapping(extensions, "KHR_materials_ior"), "ior", 1.5),
        volume=_volume(document, document.mapping(extensions, "KHR_materials_volume")),
    )


def _volume(document: Document, holder: dict[str, Any]) -> GltfVolume:
    color = document.numbers(holder, "attenuationColor", 3)
    red, green, blue = (1.0, 1.0, 1.0) if color is None else np.clip(color, 0.0, 1.0).tolist()
    distance = document.number(holder, "attenuationDistance", 0.0)
    info = document.mapping(holder, "thicknessTexture")
    texture = read_texture(document, info) if "thicknessTexture" in holder else None
    return GltfVolume(
        thickness=GltfSource((document.number(holder, "thicknessFactor", 0.0),), texture),
        attenuation_color=(red, green, blue),
        attenuation_distance=distance if distance > 0.0 else None,
    )


def unread_extensions(document: Document, index: int | None) -> tuple[str, ...]:
    """Name the extensions of a material that are not read, and such textures of the others."""
    source = {} if index is None else document.item("materials", index)
    extensions = document.mapping(source, "extensions")
    return tuple(
        part
        for name in extensions
        for part in (
            [key for key in document.mapping(extensions, name) if (name, key) in _LEFT_OUT]
            if name in _EXTENSIONS
            else [name]
        )
    )


def _source(
    document: Document, where: FileChannel, source: dict[str, Any], extensions: dict[str, Any]
) -> GltfSource:
    """Read the factor and the texture of a channel."""
    owner = extensions if where.is_extension else source
    holder = document.mapping(owner, where.owner) if where.owner else owner
    info = document.mapping(holder, where.texture)
    texture = read_texture(document, info) if where.texture in holder else None
    if where.name in OF_TEXTURE:
        is_signed = where.name == "normal"
        number = document.number(info, OF_TEXTURE[where.name], 1.0, is_signed=is_signed)
        return GltfSource((number if is_signed else min(number, 1.0),), texture)
    factor = _factor(document, where, holder)
    if where.name == "emissive":
        owner = document.mapping(extensions, EMISSIVE_STRENGTH)
        strength = document.number(owner, "emissiveStrength", 1.0)
        factor = tuple(value * strength for value in factor)
    return GltfSource(factor, texture)


def _factor(document: Document, where: FileChannel, holder: dict[str, Any]) -> tuple[float, ...]:
    """Those numbers of a factor that are the channel's."""
    if len(where.defaults) == 1:
        return (document.number(holder, where.factor, where.defaults[0]),)
    numbers = document.numbers(holder, where.factor, len(where.defaults))
    values = where.defaults if numbers is None else tuple(numbers.tolist())
    if min(values) < 0.0:
        document.fail(f"{quoted(where.factor)} is below 0")
    return tuple(values[i] for i in where.factor_components)


def read_texture(document: Document, info: dict[str, Any]) -> GltfTexture:
    """Read the texture of a textureInfo object."""
    texture = document.item("textures", info.get("index"))
    sampler = {}
    if "sampler" in texture:
        sampler = document.item("samplers", texture["sampler"])
    webp = document.mapping(document.mapping(texture, "extensions"), "EXT_texture_webp")
    image = webp.get("source", texture.get("source"))
    if image is not None:
        document.item("images", image)
    moved = document.mapping(document.mapping(info, "extensions"), "KHR_texture_transform")
    scale, offset = (document.numbers(moved, key, 2) for key in ("scale", "offset"))
    return GltfTexture(
        image=image,
        wraps=(_wrap(sampler.get("wrapS")), _wrap(sampler.get("wrapT"))),
        is_nearest=sampler.get("magFilter") == NEAREST,
        has_mip_levels=sampler.get("minFilter") not in (NEAREST, LINEAR),
        uv_set=document.integer(moved if "texCoord" in moved else info, "texCoord", 0),
        scale=(1.0, 1.0) if scale is None else (float(scale[0]), float(scale[1])),
        rotation=document.number(moved, "rotation", 0.0, is_signed=True),
        offset=(0.0, 0.0) if offset is None else (float(offset[0]), float(offset[1])),
    )


def _wrap(code: Any) -> str:
    return WRAPS.get(code, "repeat") if isinstance(code, int) else "repeat"


def image_path(document: Document, index: int) -> Path | None:
    """Path of an image beside the file; None for one in it."""
    uri = document.item("images", index).get("uri")
    if not isinstance(uri, str) or uri.startswith("data:"):
        return None
    if "://" in uri:
        raise FileError(f"images[{index}] is at {quoted(uri)}; only local files are read")
    return file_beside(document.path, unquote(uri))


def image_source(document: Document, index: int) -> str | int | None:
    """Return what an image is read from, its file or view, equal for images that are the same."""
    image = document.item("images", index)
    source = image.get("uri", image.get("bufferView"))
    if isinstance(source, str) and not source.startswith("data:"):
        return real_path(document.path, unquote(source))
    return source if isinstance(source, str | int) else None


def image_bytes(document: Document, index: int) -> bytes:
    """Content of an image file of a document, or in it."""
    path = image_path(document, index)
    if path is not None:
        return read_bytes(path)
    image = document.item("images", index)
    uri = image.get("uri")
    if not isinstance(uri, str):
        return document.view_bytes(image.get("bufferView")).tobytes()
    try:
        return base64.b64decode(uri.partition(",")[2])
    except ValueError:
        document.fail(f"the data of images[{index}] is not base64")


def image_or_reason(document: Document, index: int | None) -> bytes | str:
    """Content of an image, or why there is none: it is missing, empty or outside the folder."""
    if index is None:
        return _NO_IMAGE
    try:
        return image_bytes(document, index)
    except FileError as error:
        if isinstance(error, FileFormatError) and image_path(document, index) is None:
            raise
        return str(error)
