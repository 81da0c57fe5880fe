"""What a model file says besides its surface: materials, images, UV sets, the unit and the up axis.

Nothing is decoded, and what is missing is only noted.
"""

from __future__ import annotations

import re
from base64 import b64encode
from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake.errors import FileError, TexbakeError
from texbake.files import PathLike, is_file, read_bytes
from texbake.limits import file_beside
from texbake.mesh.files.channels import CHANNEL_OF_FBX, FILE_CHANNELS
from texbake.mesh.files.mtl import IMAGES, VALUES, library_names, library_statements, map_name
from texbake.mesh.files.obj import read_obj_text
from texbake.mesh.files.obj_write import uv_set_names_beside
from texbake.mesh.files.unread_parts import unread_parts
from texbake.records import dataclass

if TYPE_CHECKING:
    from texbake.mesh.files.fbx_scene import FbxObject, FbxScene
    from texbake.mesh.files.gltf_document import Document


@dataclass(frozen=True, kw_only=True)
class MaterialContent:
    """A material of a file."""

    name: str
    # Name of the image of each channel that the file sets; None where it is a value alone.
    channels: dict[str, str | None]


@dataclass(frozen=True, kw_only=True)
class FileContents:
    """What a file says besides its surface."""

    materials: tuple[MaterialContent, ...] = ()
    # Contents of image files by their names; None where one is missing.
    images: dict[str, bytes | None]
    uv_sets: tuple[str, ...] = ()  # names of the sets of texture coordinates
    meters_per_unit: float | None = None  # None where the file does not say it
    up: str | None = None  # the axis that points up in the file, such as `+Y`
    passed_over: tuple[str, ...] = ()  # what is not part of the surface, such as `2 animations`


_CLASSES = {made.__name__: made for made in (FileContents, MaterialContent)}


def read_contents(path: PathLike) -> FileContents | None:
    """Read what a glTF, FBX, OBJ or USD file says besides its surface; None for other formats."""
    suffix = Path(path).suffix.lower()
    if suffix in (".gltf", ".glb"):
        from texbake.mesh.files.gltf_document import read_document

        document = read_document(path)
        return replace(_of_gltf(document), passed_over=unread_parts(document))
    if suffix == ".fbx":
        from texbake.mesh.files.fbx_scene import read_scene

        scene = read_scene(path)
        return replace(_of_fbx(scene), passed_over=unread_parts(scene))
    if suffix in (".usd", ".usda", ".usdc", ".usdz"):
        from texbake.mesh.files.reader_process import read_in_child

        contents: FileContents = read_in_child(path, "contents", _CLASSES)
        return contents
    return _of_obj(Path(path)) if suffix == ".obj" else None


def model_bytes(path: PathLike, images: Iterable[bytes | None]) -> int:
    """Bytes of a model file with its buffers and images, some of which it may contain."""
    total, suffix = Path(path).stat().st_size, Path(path).suffix.lower()
    if suffix in (".glb", ".usdz"):
        return total
    if suffix == ".gltf":
        from texbake.mesh.files.gltf_document import bytes_beside, read_document

        return total + bytes_beside(read_document(path))
    content = read_bytes(path) if suffix == ".fbx" else b""
    beside = (image for image in images if image and image not in content)
    # Text files hold images as base64.
    return total + sum(len(image) for image in beside if b64encode(image) not in content)


def _of_gltf(document: Document) -> FileContents:
    from texbake.mesh.files.gltf_materials import image_bytes, image_source

    names = [
        str(image.get("name") or image.get("uri", f"image {i}"))[:80]
        for i, image in enumerate(document.items("images"))
    ]
    counts = Counter(names)
    names = [name if counts[name] == 1 else f"{name} ({i})" for i, name in enumerate(names)]
    images: dict[str, bytes | None] = {}
    contents: dict[str | int | None, bytes | None] = {}
    for i, name in enumerate(names):
        source = image_source(document, i)
        if source not in contents:
            try:
                contents[source] = image_bytes(document, i)
            except TexbakeError:
                contents[source] = None
        images[name] = contents[source]
    attributes = {
        str(key)
        for mesh in document.items("meshes")
        for primitive in document.objects(mesh, "primitives")
        for key in document.mapping(primitive, "attributes")
    }
    return FileContents(
        materials=tuple(
            MaterialContent(
                name=str(material.get("name") or f"material {i}"),
                channels=_gltf_channels(document, material, names),
            )
            for i, material in enumerate(document.items("materials"))
        ),
        images=images,
        uv_sets=tuple(sorted(key for key in attributes if key.startswith("TEXCOORD_"))),
        meters_per_unit=1.0,
        up="+Y",
    )


_OWN_CHANNELS = [
    where for where in FILE_CHANNELS.values() if not where.is_extension and where.name != "alpha"
]


def _gltf_channels(
    document: Document, material: dict[str, Any], names: list[str]
) -> dict[str, str | None]:
    from texbake.mesh.files.gltf_materials import read_texture

    channels: dict[str, str | None] = {}
    for where in _OWN_CHANNELS:
        owner = document.mapping(material, where.owner) if where.owner else material
        if where.texture in owner:
            image = read_texture(document, document.mapping(owner, where.texture)).image
            channels[where.name] = None if image is None else names[image]
        elif where.factor in owner:
            channels[where.name] = None
    if material.get("alphaMode", "OPAQUE") != "OPAQUE":
        channels["opacity"] = channels.get("base-color")
    for extension in document.mapping(material, "extensions"):
        channels[str(extension).removeprefix("KHR_materials_")] = None
    return channels


def _titles(channels: Mapping[str, str]) -> dict[str, str]:
    return {key: "opacity" if name == "alpha" else name for key, name in channels.items()}


# Channels by statements of .mtl files, with those that materials do not have.
_MTL_VALUES = _titles({**VALUES, "ks": "specular", "tr": "alpha", "ns": "roughness"})
_MTL_IMAGES = _titles({
    **IMAGES, "map_ks": "specular", "map_ns": "roughness", "bump": "bump", "map_bump": "bump",
    "disp": "displacement",
})  # fmt: skip


def _of_obj(path: Path) -> FileContents:
    data = read_obj_text(path).tobytes()
    materials: list[MaterialContent] = []
    images: dict[str, bytes | None] = {}
    for name in library_names(path, data):
        try:
            library = file_beside(path, name)
        except FileError:  # it is not in the folder
            continue
        _add_library(library, materials, images)
    has_uvs = re.search(rb"^vt\s", data, re.MULTILINE) is not None
    return FileContents(
        materials=tuple(materials),
        images=images,
        uv_sets=("vt", *uv_set_names_beside(path)) if has_uvs else (),
    )


def _add_library(
    path: Path, materials: list[MaterialContent], images: dict[str, bytes | None]
) -> None:
    """Add the materials of a .mtl file."""
    for keyword, words in library_statements(path) if is_file(path) else ():
        statement = keyword.lower()
        channel = {**_MTL_VALUES, **_MTL_IMAGES}.get(statement)
        if statement == "newmtl":
            materials.append(MaterialContent(name=words, channels={}))
        elif channel is not None and materials:
            channels = materials[-1].channels
            if statement in _MTL_VALUES:
                channels.setdefault(channel, None)
                continue
            name = map_name(words)[0]
            channels[channel] = label = Path(name).name
            if images.setdefault(label, None) is None:
                with suppress(FileError):
                    images[label] = read_bytes(file_beside(path, name))


# Channels by properties, with those that materials do not have.
_FBX_CHANNELS = _titles({
    **CHANNEL_OF_FBX, "SpecularColor": "specular", "Bump": "bump",
    "DisplacementColor": "displacement",
})  # fmt: skip
_AXES = "XYZ"


def _of_fbx(scene: FbxScene) -> FileContents:
    images: dict[str, bytes | None] = {}
    objects = list(scene.objects.values())
    materials = [
        MaterialContent(name=item.name, channels=_fbx_channels(scene, item, images))
        for item in objects
        if item.node.name == "Material"
    ]
    layers = [layer for item in objects for layer in item.node.named("LayerElementUV")]
    names = dict.fromkeys(
        layer.child_text("Name") or f"UV set {layer.values[:1]}" for layer in layers
    )
    unit = next(iter(scene.settings.get("UnitScaleFactor", ())), None)
    axis = next(iter(scene.settings.get("UpAxis", ())), None)
    sign = next(iter(scene.settings.get("UpAxisSign", ())), 1)
    return FileContents(
        materials=tuple(materials),
        images=images,
        uv_sets=tuple(names),
        meters_per_unit=0.01 * unit if isinstance(unit, int | float) and unit > 0.0 else None,
        up=f"{'-' if sign == -1 else '+'}{_AXES[axis]}" if axis in (0, 1, 2) else None,
    )


def _fbx_channels(
    scene: FbxScene, material: FbxObject, images: dict[str, bytes | None]
) -> dict[str, str | None]:
    from texbake.mesh.files.fbx_materials import base_layer, first_image

    channels: dict[str, str | None] = {
        channel: None for name, channel in _FBX_CHANNELS.items() if name in material.properties
    }
    for name, member in scene.textures_of(material.key).items():
        texture = base_layer(scene, member)
        data, found = first_image(scene, texture)
        named = texture.node.child_text("RelativeFilename").replace("\\", "/")
        label = Path(named or texture.name if data is None else found).name
        images[label] = data
        channels[_FBX_CHANNELS.get(name, name)] = label
    return channels
