"""Materials of FBX files: factors of their base colors, and images in the file or in its folder.

Paths in such files are mostly those of the machine that wrote them. An image is looked for by its
relative path, where that stays within the folder of the file, then by its name in that folder;
where it is not there either, that is noted and the material keeps its factor.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import numpy as np

from texbake.files import PathLike
from texbake.mesh.files.fbx import read_parts
from texbake.mesh.files.fbx_scene import FbxObject, FbxScene, Id, read_scene
from texbake.mesh.files.source import map_file
from texbake.mesh.materials import CHANNELS, ChannelImage, ChannelSource, Materials, MeshMaterial
from texbake.mesh.mesh import Mesh

_COLORS = ("DiffuseColor", "Diffuse")
_FILES = ("RelativeFilename", "FileName", "Filename")


def read_fbx_materials(path: PathLike, mesh: Mesh) -> Materials | None:
    """Read the materials of an FBX file; None where no face has one.

    Raises
    ------
    FileError
        An image that is there cannot be read.
    FileFormatError
        The file is damaged.
    """
    scene = read_scene(path)
    numbers: dict[Id | None, int] = {}
    found: list[FbxObject | None] = []
    of_faces = []
    for part in read_parts(scene):
        ids = part.geometry.face_materials
        used, faces = np.unique(ids, return_inverse=True)
        of_used = []
        for index in used.tolist():
            material = part.materials[index] if 0 <= index < len(part.materials) else None
            key = None if material is None else material.key
            if key not in numbers:
                numbers[key] = len(found)
                found.append(material)
            of_used.append(numbers[key])
        of_faces.append(np.array(of_used, np.int32)[faces])
    if not any(found) or sum(map(len, of_faces)) != mesh.n_faces:
        return None
    missing: list[tuple[str, str]] = []
    return Materials(
        face_materials=np.concatenate(of_faces),
        materials=tuple(_material(scene, item, missing) for item in found),
        missing=tuple(missing),
    )


# Channels by the properties that textures are connected to.
_TEXTURED = {
    "DiffuseColor": "base-color", "EmissiveColor": "emissive", "NormalMap": "normal",
    "ShininessExponent": "roughness", "ReflectionFactor": "metallic",
    "Maya|TEX_color_map": "base-color", "Maya|TEX_normal_map": "normal",
    "Maya|TEX_roughness_map": "roughness", "Maya|TEX_metallic_map": "metallic",
    "Maya|TEX_emissive_map": "emissive", "Maya|TEX_ao_map": "occlusion",
}  # fmt: skip
_RED = (0,)


def _material(
    scene: FbxScene, material: FbxObject | None, missing: list[tuple[str, str]]
) -> MeshMaterial:
    if material is None:
        return MeshMaterial(name="default")
    channels = {}
    color = _color(material)
    if color is not None:
        channels["base-color"] = ChannelSource(color)
    for name, texture in scene.property_members(material.key).items():
        channel = _TEXTURED.get(name)
        if channel is None:
            continue
        data, label = next(fbx_images(scene, texture), (b"", ""))
        if not data:
            line = f"{material.name}: an image of it is missing; the material keeps its factors"
            missing.append((channel, line))
            continue
        width = len(CHANNELS[channel].default)
        components = _RED if width == 1 else (0, 1, 2)
        image = ChannelImage(data=data, name=label, components=components)
        channels[channel] = ChannelSource((1.0,) * width, image)
    return MeshMaterial(name=material.name, channels=channels)


def _color(material: FbxObject) -> tuple[float, float, float] | None:
    """Return the diffuse color of a material; None where it has none of three numbers."""
    properties = material.properties()
    values = next((properties[name] for name in _COLORS if name in properties), [])
    if len(values) < 3 or not all(isinstance(v, int | float) for v in values[:3]):
        return None
    red, green, blue = (float(value) for value in values[:3])
    return (red, green, blue) if all(map(math.isfinite, (red, green, blue))) else None


def fbx_images(scene: FbxScene, texture: FbxObject) -> Iterator[tuple[bytes, str]]:
    """Contents and names of the images of a texture, those in the file first."""
    holders = [*scene.members_of(texture.key, "Video"), texture]
    for holder in holders:
        content = holder.node.child("Content")
        value = content.values[0] if content is not None and content.values else None
        if isinstance(value, bytes) and value:
            yield _unwrapped(value), f"{scene.path}: {holder.name}"
    folder = Path(scene.path).resolve().parent
    for holder in holders:
        for field in _FILES:
            words = PurePosixPath(holder.node.child_text(field).replace("\\", "/"))
            for place in (folder / words, folder / words.name):
                try:
                    is_there = place.resolve().is_relative_to(folder) and place.is_file()
                except (OSError, ValueError):
                    continue
                if is_there:
                    yield map_file(place).tobytes(), str(place)


def _unwrapped(content: bytes) -> bytes:
    """Return the bytes of an image, which text files hold in base64."""
    try:
        return base64.b64decode(content, validate=True)
    except ValueError:  # no image is made of letters and digits alone
        return content
