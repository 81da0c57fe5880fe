"""Textures of FBX files: their images, how they are wrapped and moved, and layers of them.

Paths in such files are mostly those of the machine that wrote them. An image is looked for by its
relative path, where that stays within the folder of the file, then by its name in that folder.

A texture multiplies texture coordinates by `Scaling`, turns them by `Rotation`, each about a pivot
of its own, and adds `Translation`. Unity and three.js scale and add in this way too. Blender's own
files have another meaning, which its importer shares: `Translation` is subtracted first, the
rotation is in radians, and the scale comes last.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator
from itertools import chain
from pathlib import PurePosixPath

import numpy as np

from texbake.core import portable_math as pm
from texbake.files import read_bytes
from texbake.limits import file_beside, real_path
from texbake.mesh.files.fbx_scene import FbxObject, FbxScene
from texbake.mesh.materials import UNPLACED, Placing
from texbake.mesh.mesh import FloatArray

_FILES = ("RelativeFilename", "FileName", "Filename")
_CLAMP = 1


def base_layer(scene: FbxScene, texture: FbxObject) -> FbxObject:
    """Return the lowest layer of a layered texture that is an image; another texture as it is."""
    if texture.node.name != "LayeredTexture":
        return texture
    return next(iter(scene.members_of(texture.key, "Texture")), texture)


def first_image(scene: FbxScene, texture: FbxObject) -> tuple[bytes | None, str]:
    """Content of the image of a texture and what to call it.

    Where there is none, None and the file name that the texture asks for, which may be empty.
    """
    if texture.key not in scene.found:
        image = next(_images(scene, texture), None)
        scene.found[texture.key] = image or (None, _file_name(scene, texture))
    return scene.found[texture.key]


def _images(scene: FbxScene, texture: FbxObject) -> Iterator[tuple[bytes, str]]:
    """Contents and names of the images of a texture, those in the file first."""
    holders = [*scene.members_of(texture.key, "Video"), texture]
    for holder in holders:
        content = holder.node.child("Content")
        value = content.values[0] if content is not None and content.values else None
        if isinstance(value, bytes) and value:
            label = f"{scene.path}: {holder.name}"
            if scene.named.setdefault(label, holder.key) != holder.key:
                label += f" ({holder.key})"  # objects may have equal names
            if label not in scene.images:
                scene.images[label] = _unwrapped(value)
            yield scene.images[label], label
    for name in chain.from_iterable(map(image_names, holders)):
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


def _file_name(scene: FbxScene, texture: FbxObject) -> str:
    """File name of the image that a texture asks for; empty where it names none."""
    holders = (*scene.members_of(texture.key, "Video"), texture)
    return PurePosixPath(next(chain.from_iterable(map(image_names, holders)), "")).name


def _unwrapped(content: bytes) -> bytes:
    """Return the bytes of an image, which text files hold in base64."""
    try:
        return base64.b64decode(content, validate=True)
    except ValueError:  # no image is made of letters and digits alone
        return content


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
    """Rows of the matrix of a texture's transform; the identity where its numbers are no numbers.

    Rotations about other axes than that of the image are left out.
    """
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
    values = texture.properties.get(name, [])[:3]
    if len(values) < 3 or not all(isinstance(value, int | float) for value in values):
        return np.full(3, default)
    numbers = np.array([float(value) for value in values])
    return numbers if np.isfinite(numbers).all() else np.full(3, default)


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
