"""Materials of FBX files: base color, opacity, and the images of their channels.

docs/reference/formats.md says how they are read. A texture whose set of texture coordinates a
geometry does not have lies on the first. Paths of images are mostly those of the machine that wrote
them: an image is looked for by its relative path, where that stays within the folder of the file,
then by its name in that folder. In Blender's own files `Translation` is subtracted first, the
rotation is in radians, and the scale comes last.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import field, replace
from itertools import chain
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import quoted, shortened
from texbake.files import PathLike, read_bytes
from texbake.limits import file_beside, real_path
from texbake.mesh.files.channels import CHANNEL_OF_FBX
from texbake.mesh.files.fbx import FbxPart, read_parts, uv_set_name
from texbake.mesh.files.fbx_scene import FbxObject, FbxScene, model_instances, read_scene
from texbake.mesh.materials import (
    CHANNELS,
    UNPLACED,
    ChannelImage,
    ChannelSource,
    Materials,
    MeshMaterial,
    MissingParts,
    Placing,
    is_sheared,
    materials_by_face,
)
from texbake.mesh.mesh import FloatArray, Mesh, require_few_sets
from texbake.records import dataclass

_COLORS = ("DiffuseColor", "Diffuse")


def read_fbx_materials(path: PathLike, mesh: Mesh) -> Materials | None:
    """Read the materials of an FBX file; None where no face has one."""
    scene = read_scene(path)
    parts = list(read_parts(scene, model_instances(scene)))
    # The groups of the mesh are the materials of its parts, in this order.
    used: list[FbxObject | None] = []
    for part in parts:
        used += map(part.material, np.unique(part.geometry.face_materials).tolist())
    found = materials_by_face(mesh, used)
    if found is None or not any(used):
        return None
    distinct, face_materials = found
    # Sets of texture coordinates by their names, but for the first sets.
    names = dict.fromkeys(name for part in parts for name in part.geometry.uv_sets)
    reader = _MaterialReader(scene, {name: 1 + i for i, name in enumerate(names)})
    materials = tuple(map(reader.material, distinct))
    if scene.version < 7000 and any(scene.members_of(part.model.key, "Texture") for part in parts):
        reader.missing.add("base-color", "textures of models are not read, only those of materials")
    uv_sets = _uv_sets(parts, mesh, reader.uv_numbers)
    materials = tuple(material.on_uv_sets({0, *uv_sets}) for material in materials)
    return Materials(
        face_materials=face_materials,
        materials=_without_shear(materials, mesh, uv_sets),
        uv_sets=uv_sets,
        **reader.missing.fields(),
    )


def _uv_sets(parts: list[FbxPart], mesh: Mesh, numbers: dict[str, int]) -> dict[int, FloatArray]:
    """Sets by their numbers, in the rows of the mesh; where a geometry has none, its first."""
    require_few_sets(len(numbers), mesh.name)
    sets = {}
    for name, number in numbers.items():
        rows = []
        for part in parts:
            geometry = part.geometry
            first = geometry.fields.get("uvs", np.zeros((1, 2)))
            rows.append(geometry.uv_sets.get(name, first))
        if mesh.uvs is not None and sum(map(len, rows)) == len(mesh.uvs):
            sets[number] = np.concatenate(rows)
    return sets


def _without_shear(
    materials: tuple[MeshMaterial, ...], mesh: Mesh, uv_sets: dict[int, FloatArray]
) -> tuple[MeshMaterial, ...]:
    """Place sheared images, which glTF lacks, by coordinates that are added to the sets."""
    numbers: dict[tuple[int, Placing], int] = {}

    def placed(source: ChannelSource) -> ChannelSource:
        image = source.image
        if image is None or mesh.uvs is None or not is_sheared(image.placing):
            return source
        key = (image.uv_set, image.placing)
        if key not in numbers:
            require_few_sets(len(uv_sets) + 1, mesh.name)
            matrix = np.array(image.placing)
            numbers[key] = max(uv_sets, default=0) + 1
            coordinates = uv_sets.get(image.uv_set, mesh.uvs)
            uv_sets[numbers[key]] = pm.matmul(coordinates, matrix[:, :2].T) + matrix[:, 2]
        return replace(source, image=replace(image, placing=UNPLACED, uv_set=numbers[key]))

    return tuple(
        replace(
            material, channels={name: placed(source) for name, source in material.channels.items()}
        )
        for material in materials
    )


_RED, _ALPHA = (0,), (3,)


@dataclass(frozen=True, eq=False)
class _MaterialReader:
    """Reads the materials of a scene."""

    scene: FbxScene
    uv_numbers: dict[str, int]  # sets of texture coordinates by their names, but for the first
    missing: MissingParts = field(default_factory=MissingParts)  # what could not be read

    def material(self, material: FbxObject | None) -> MeshMaterial:
        """Read a material; the default one where there is none."""
        if material is None:
            return MeshMaterial(name="default")
        channels = {}
        color = next(filter(material.properties.__contains__, _COLORS), "")
        if len(values := _floats(material.properties, color)) >= 3:
            channels["base-color"] = ChannelSource(tuple(values[:3]))
        alpha = _opacity(material, self.scene.defaults["Material"])
        if alpha < 1.0:
            channels["alpha"] = ChannelSource((alpha,))
        for name, texture in self.scene.textures_of(material.key).items():
            channel = CHANNEL_OF_FBX.get(name)
            if channel is None:
                continue
            image = self._image(material, channel, texture)
            if image is not None:
                default = CHANNELS[channel].default
                factor = channels.get(channel, ChannelSource(default)).factor
                ones = (1.0,) * len(default)
                channels[channel] = ChannelSource(ones, image, fallback=factor)
        mode = "blend" if "alpha" in channels else "opaque"
        return MeshMaterial(name=material.name, channels=channels, alpha_mode=mode)

    def _image(self, material: FbxObject, channel: str, texture: FbxObject) -> ChannelImage | None:
        """Read the image of a texture; None, and a note, where it is missing."""
        base = base_layer(self.scene, texture)
        if base is not texture:
            self.missing.add(channel, "of layered textures only the base layer is read")
        data, label = first_image(self.scene, base)
        if not data:
            which = f"its image {quoted(label)}" if label else "an image of it"
            line = f"{shortened(material.name)}: {which} is missing; the material keeps its factors"
            self.missing.add(channel, line, image=label or None)
            return None
        components = _RED if len(CHANNELS[channel].default) == 1 else (0, 1, 2)
        if channel == "alpha" and has_alpha(data):
            components = _ALPHA
        return ChannelImage(
            data=data,
            name=label,
            components=components,
            wraps=wraps(base),
            placing=placing(self.scene, base),
            uv_set=self.uv_numbers.get(uv_set_name(base), 0),
        )


def _opacity(material: FbxObject, defaults: dict[str, list[Any]]) -> float:
    """Return the opacity of a material; 1 where it says nothing.

    Programs write it as a number, or as a color that is let through, times a factor. Blender 2.79
    writes opaque materials with a color of 1 and leaves their factor to the file's default, 0.
    """
    opacity = _floats(material.properties, "Opacity")
    color = _floats(material.properties, "TransparentColor")
    factor = _floats(material.properties, "TransparencyFactor")
    if len(opacity) == 1:
        alpha = opacity[0]
    elif len(color) >= 3 or len(factor) == 1:
        factor = factor or _floats(defaults, "TransparencyFactor") or [1.0]
        alpha = 1.0 - (sum(color[:3]) / 3.0 if len(color) >= 3 else 1.0) * factor[0]
    else:
        alpha = 1.0
    return float(min(max(alpha, 0.0), 1.0))


def _floats(properties: dict[str, list[Any]], name: str) -> list[float]:
    """Return the numbers of a property; none where they are not all finite numbers."""
    values = properties.get(name, [])
    is_sound = all(isinstance(value, int | float) and math.isfinite(value) for value in values)
    return list(map(float, values)) if is_sound else []


_FILES = ("RelativeFilename", "FileName", "Filename")
_CLAMP = 1


def base_layer(scene: FbxScene, texture: FbxObject) -> FbxObject:
    """Return the lowest layer of a layered texture that is an image; another texture as it is."""
    if texture.node.name != "LayeredTexture":
        return texture
    return next(iter(scene.members_of(texture.key, "Texture")), texture)


def first_image(scene: FbxScene, texture: FbxObject) -> tuple[bytes | None, str]:
    """Content of the image of a texture, or None, and its file name, which may be empty."""
    if texture.key not in scene.first_images:
        holders = [*scene.members_of(texture.key, "Video"), texture]
        names = list(chain.from_iterable(map(image_names, holders)))
        image = next(_images(scene, holders, names), None)
        missing = PurePosixPath(next(iter(names), "")).name
        scene.first_images[texture.key] = image or (None, missing)
    return scene.first_images[texture.key]


def _images(
    scene: FbxScene, holders: list[FbxObject], names: list[str]
) -> Iterator[tuple[bytes, str]]:
    """Contents and names of the images of a texture, those in the file first."""
    for holder in holders:
        content = holder.node.child("Content")
        value = content.values[0] if content is not None and content.values else None
        if isinstance(value, bytes) and value:
            label = f"{scene.path}: {holder.name}"
            if scene.named.setdefault(label, holder.key) != holder.key:
                label += f" ({holder.key})"  # objects may have equal names
            if label not in scene.images:
                scene.images[label] = value
                with suppress(ValueError):  # text files hold base64; no image is such letters alone
                    scene.images[label] = base64.b64decode(value, validate=True)
            yield scene.images[label], label
    for name in names:
        try:
            place = file_beside(scene.path, name)
            real = real_path(scene.path, name)
            if real not in scene.images:
                scene.images[real] = read_bytes(place)
        except (OSError, ValueError):
            continue
        yield scene.images[real], str(place)


def image_names(holder: FbxObject) -> Iterator[str]:
    """Names under which the image of a texture or video is looked for in the folder of the file."""
    for entry in _FILES:
        words = PurePosixPath(holder.node.child_text(entry).replace("\\", "/"))
        if words.name:
            yield str(words)
            yield words.name


def has_alpha(data: bytes) -> bool:
    """Whether an image file says in its header that it has an alpha channel: PNG, TGA or WebP."""
    if data.startswith(b"\x89PNG"):
        return data[25:26] in (b"\4", b"\6") or b"tRNS" in data[:4096]
    if data.startswith(b"RIFF") and data[8:12] == b"WEBP":
        flag = {b"VP8X": (20, 0x10), b"VP8L": (24, 0x10)}.get(data[12:16])
        return flag is not None and bool(int.from_bytes(data[flag[0] : flag[0] + 1]) & flag[1])
    is_tga = data[1:3] in (b"\0\2", b"\0\n", b"\0\3", b"\0\x0b") and len(data) > 18
    return is_tga and bool(data[17] & 0x0F)


def wraps(texture: FbxObject) -> tuple[str, str]:
    """What lies outside the unit square along u and v."""
    properties = texture.properties
    u, v = (
        "clamp" if properties.get(f"WrapMode{axis}", [0])[:1] == [_CLAMP] else "repeat"
        for axis in "UV"
    )
    return u, v


def placing(scene: FbxScene, texture: FbxObject) -> Placing:
    """Rows of a texture's transform matrix; the identity where its numbers are no numbers."""
    move = _numbers(texture, "Translation", 0.0)
    scale = _numbers(texture, "Scaling", 1.0)
    angle = float(_numbers(texture, "Rotation", 0.0)[2])
    with np.errstate(over="ignore", invalid="ignore"):
        if scene.creator.startswith("Blender"):
            matrix = pm.matmul(pm.matmul(_scaled(scale), _turned(angle)), _moved(-move))
        else:
            turn = _about(texture, "TextureRotationPivot", _turned(math.radians(angle)))
            matrix = pm.matmul(
                pm.matmul(_moved(move), turn),
                _about(texture, "TextureScalingPivot", _scaled(scale)),
            )
    if not np.isfinite(matrix).all():
        return UNPLACED
    (a, b, c), (d, e, f), _ = (matrix + 0.0).tolist()
    return (a, b, c), (d, e, f)


def _numbers(texture: FbxObject, name: str, default: float) -> FloatArray:
    """(3,) numbers of a property."""
    values = _floats(texture.properties, name)
    return np.array(values[:3]) if len(values) >= 3 else np.full(3, default)


def _about(texture: FbxObject, name: str, matrix: FloatArray) -> FloatArray:
    """A matrix about a pivot in place of the origin."""
    pivot = _numbers(texture, name, 0.0)
    return np.asarray(pm.matmul(pm.matmul(_moved(pivot), matrix), _moved(-pivot)))


def _moved(offset: FloatArray) -> FloatArray:
    matrix: FloatArray = np.eye(3)
    matrix[:2, 2] = offset[:2]
    return matrix


def _scaled(factors: FloatArray) -> FloatArray:
    return np.diag([factors[0], factors[1], 1.0])


def _turned(angle: float) -> FloatArray:
    """Matrix of a counterclockwise rotation by radians."""
    sin, cos = pm.sin(angle), pm.cos(angle)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
