"""Materials of a mesh as glTF has them.

glTF reads roughness from the green and metallic from the blue of one image, alpha from the image of
the base color. Other formats have an image for each channel; `texbake.texture.material_images` puts
these where glTF reads them. A channel without an image whose texture has one keeps its factor: the
image is taken to be 1 there, as that module makes it.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.mesh.files import gltf_document as gltf
from texbake.mesh.files.channels import EMISSIVE_STRENGTH, FILE_CHANNELS, SLOTS, Slot
from texbake.mesh.files.conversion import as_text
from texbake.mesh.files.gltf_asset import GltfAsset
from texbake.mesh.materials import (
    CHANNELS,
    UNPLACED,
    ChannelImage,
    Materials,
    MeshMaterial,
    Placing,
    is_sheared,
)
from texbake.mesh.mesh import FloatArray

_TRANSFORM = "KHR_texture_transform"


def uv_numbers(materials: Materials) -> dict[int, int]:
    """Numbers that the file gives to sets of texture coordinates: 0, 1, 2 without a gap."""
    used = materials.image_uv_sets | {0}
    return {uv_set: number for number, uv_set in enumerate(sorted(used))}


def add_material(
    asset: GltfAsset,
    material: MeshMaterial,
    numbers: Mapping[int, int],
    uv_matrices: Mapping[int, FloatArray],
    units: float = 1.0,
) -> int:
    """Add a material whose unit of length is so many `units` of the mesh, and return its index."""
    extensions: dict[str, Any] = {}
    content: dict[str, Any] = {"name": as_text(material.name), "pbrMetallicRoughness": {}}
    for slot in SLOTS:
        is_extension = slot.channels[0].is_extension
        if is_extension and not any(where.name in material.channels for where in slot.channels):
            continue
        owner = content
        if slot.owner:
            owner = (extensions if is_extension else content).setdefault(slot.owner, {})
        if not slot.holds(material):
            raise OptionError(
                f"{material.name}: glTF has no place for the image of its "
                f"{' and '.join(where.name for where, _ in slot.sources(material))}; "
                "rearrange it with texbake.gltf_images"
            )
        image = slot.image(material)
        if image is not None:
            owner[slot.texture] = _texture_info(asset, material, slot, image, numbers, uv_matrices)
    _add_factors(content, extensions, material)
    if material.alpha_mode != "opaque":
        content["alphaMode"] = material.alpha_mode.upper()
    if material.alpha_mode == "mask":
        content["alphaCutoff"] = material.alpha_cutoff
    if material.is_double_sided:
        content["doubleSided"] = True
    if material.is_unlit:
        extensions["KHR_materials_unlit"] = {}
    for name, properties in material.extensions.items():
        extensions[name] = {
            key: _placed_texture(asset, material, value, numbers, uv_matrices)
            if isinstance(value, ChannelImage)
            else (units * value if key == "thicknessFactor" else value)
            for key, value in properties.items()
        }
    if extensions:
        content["extensions"] = extensions
        for extension in extensions:
            asset.use(extension)
    return asset.append_material(content)


def _add_factors(
    content: dict[str, Any], extensions: dict[str, Any], material: MeshMaterial
) -> None:
    """Set the factors that differ from those that glTF assumes."""
    for where in FILE_CHANNELS.values():
        owners = extensions if where.is_extension else content
        if not where.factor or (where.is_extension and where.owner not in extensions):
            continue
        owner = owners[where.owner] if where.owner else content
        source = material.channels.get(where.name)
        factor = CHANNELS[where.name].default if source is None else source.factor
        if where.name == "alpha" and material.alpha_mode == "opaque":
            factor = (1.0,)
        if where.name == "emissive" and max(factor) > 1.0:
            extensions[EMISSIVE_STRENGTH] = {"emissiveStrength": max(factor)}
            factor = tuple(value / max(factor) for value in factor)
        if CHANNELS[where.name].is_bounded:
            factor = tuple(min(max(value, 0.0), 1.0) for value in factor)
        if len(where.defaults) == 1:
            if factor != where.defaults:
                owner[where.factor] = factor[0]
            continue
        values = list(owner.get(where.factor, where.defaults))
        for component, value in zip(where.factor_components, factor, strict=True):
            values[component] = value
        if tuple(values) != where.defaults:
            owner[where.factor] = values


def _texture_info(
    asset: GltfAsset,
    material: MeshMaterial,
    slot: Slot,
    image: ChannelImage,
    numbers: Mapping[int, int],
    uv_matrices: Mapping[int, FloatArray],
) -> dict[str, Any]:
    info = _placed_texture(asset, material, image, numbers, uv_matrices)
    for where, source in slot.sources(material):
        if where.name == "normal" and source.factor[0] != 1.0:
            info["scale"] = source.factor[0]
        if where.name == "occlusion" and source.factor[0] != 1.0:
            info["strength"] = source.factor[0]
    return info


def _placed_texture(
    asset: GltfAsset,
    material: MeshMaterial,
    image: ChannelImage,
    numbers: Mapping[int, int],
    uv_matrices: Mapping[int, FloatArray],
) -> dict[str, Any]:
    """Add a texture, and return the object that says which and how it lies on the surface."""
    texture = asset.add_texture(image.data, wraps=image.wraps, is_nearest=image.is_nearest)
    info: dict[str, Any] = {"index": texture}
    if numbers[image.uv_set]:
        info["texCoord"] = numbers[image.uv_set]
    if image.placing != UNPLACED or image.uv_set in uv_matrices:
        asset.use(_TRANSFORM)
        stored = uv_matrices.get(image.uv_set, np.eye(3))
        info["extensions"] = {_TRANSFORM: _transform(material, image.placing, stored)}
    return info


def _transform(material: MeshMaterial, placing: Placing, stored: FloatArray) -> dict[str, Any]:
    """KHR_texture_transform object of a matrix for coordinates with v up, after another one."""
    matrix = pm.matmul(
        pm.matmul(pm.matmul(gltf.FLIP, np.array([*placing, (0.0, 0.0, 1.0)])), gltf.FLIP), stored
    )
    (a, b, x), (c, d, y), _ = matrix.tolist()
    # [a b; c d] = [cos sin; -sin cos] diag(scale)
    angle = pm.arctan2(-c, a) if (a, c) != (0.0, 0.0) else pm.arctan2(b, d)
    if is_sheared(((a, b, x), (c, d, y))):
        raise OptionError(f"{material.name}: an image is sheared, which glTF cannot do")
    cos, sin = pm.cos(angle), pm.sin(angle)
    found: dict[str, Any] = {"offset": [x, y], "scale": [a * cos - c * sin, b * sin + d * cos]}
    if angle:
        found["rotation"] = angle
    return found
