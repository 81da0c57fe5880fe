"""Writing materials with all of their channels into a glTF asset.

Images are embedded as they are, so each channel must be where glTF reads it: roughness in green,
and so on, as `gltf_channels` lists. Channels of one texture share an image.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021, section 3.9, and its
extensions KHR_texture_transform, EXT_texture_webp, KHR_texture_basisu, KHR_materials_unlit and
KHR_materials_emissive_strength.
"""

from __future__ import annotations

import math
from itertools import groupby
from typing import Any

import numpy as np

from texbake.errors import OptionError
from texbake.mesh.files.conversion import as_text
from texbake.mesh.files.gltf_asset import GltfAsset
from texbake.mesh.files.gltf_channels import EMISSIVE_STRENGTH, GLTF_CHANNELS, GltfChannel
from texbake.mesh.materials import UNPLACED, ChannelImage, ChannelSource, MeshMaterial

_WRAPS = {"clamp": 33071, "mirror": 33648, "repeat": 10497}
_NEAREST, _LINEAR, _TRILINEAR = 9728, 9729, 9987
_TRANSFORM = "KHR_texture_transform"
_UNLIT = "KHR_materials_unlit"
# First bytes of image files, where they begin, the media type, and the extension that allows it.
_FORMATS = (
    (b"\x89PNG\r\n\x1a\n", 0, "image/png", None),
    (b"\xff\xd8\xff", 0, "image/jpeg", None),
    (b"WEBP", 8, "image/webp", "EXT_texture_webp"),
    (b"\xabKTX 20\xbb", 0, "image/ktx2", "KHR_texture_basisu"),
)
# v down to v up, and back.
_FLIP = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])


class GltfMaterialWriter:
    """Adds materials to an asset; images and textures that they share are added once.

    Parameters
    ----------
    asset : GltfAsset
    """

    def __init__(self, asset: GltfAsset) -> None:
        self._asset = asset
        self._images: dict[str, int] = {}
        self._samplers: dict[tuple[str, str, bool], int] = {}
        self._textures: dict[tuple[int, int], int] = {}

    def add(self, material: MeshMaterial) -> int:
        """Add a material, and return its index.

        Raises
        ------
        OptionError
            An image is in a format that glTF does not have, a channel is not where glTF reads it,
            or an image is placed with a shear.
        """
        made: dict[str, Any] = {"name": as_text(material.name)}
        for _, slot in groupby(GLTF_CHANNELS, key=lambda where: (where.owner, where.texture)):
            self._add_slot(made, list(slot), material)
        if material.alpha_mode != "opaque":
            made["alphaMode"] = material.alpha_mode.upper()
        if material.alpha_mode == "mask":
            made["alphaCutoff"] = material.alpha_cutoff
        if material.is_double_sided:
            made["doubleSided"] = True
        if material.is_unlit:
            made.setdefault("extensions", {})[_UNLIT] = {}
        for name in made.get("extensions", {}):
            self._asset.use(name)
        return self._asset.add("materials", made)

    def _add_slot(
        self, made: dict[str, Any], slot: list[GltfChannel], material: MeshMaterial
    ) -> None:
        """Add the channels of one texture, with their factors."""
        sources = {
            where: material.channels[where.name]
            for where in slot
            if where.name in material.channels
        }
        if not sources:
            # glTF takes a metallic for 1 where it is not given, and we for 0.
            if slot[0].texture == "metallicRoughnessTexture":
                made.setdefault("pbrMetallicRoughness", {})["metallicFactor"] = 0.0
            return
        holder = made
        owner = slot[0].owner
        if owner:
            parent = made.setdefault("extensions", {}) if slot[0].is_extension else made
            holder = parent.setdefault(owner, {})
        factors: dict[str, list[float]] = {}
        for where, source in sources.items():
            if where.factor:
                numbers = factors.setdefault(where.factor, list(where.defaults))
                for component, value in zip(where.factor_components, source.factor, strict=True):
                    numbers[component] = value
        if slot[0].name == "emissive":
            strength = max(1.0, *factors[slot[0].factor])
            factors[slot[0].factor] = [v / strength for v in factors[slot[0].factor]]
            if strength > 1.0:
                extension = made.setdefault("extensions", {})
                extension[EMISSIVE_STRENGTH] = {"emissiveStrength": strength}
        for name, numbers in factors.items():
            holder[name] = numbers if len(numbers) > 1 else numbers[0]
        if "metallicFactor" not in holder and slot[0].texture == "metallicRoughnessTexture":
            holder["metallicFactor"] = 0.0
        image = self._common_image(sources)
        if image is not None:
            holder[slot[0].texture] = self._texture_info(image, slot[0], sources.get(slot[0]))

    def _common_image(self, sources: dict[GltfChannel, ChannelSource]) -> ChannelImage | None:
        """Return the image of a texture, which all of its channels must share."""
        images = {where: source.image for where, source in sources.items() if source.image}
        if not images:
            return None
        first = next(iter(images.values()))
        for where, image in images.items():
            if image.components != where.components:
                raise OptionError(
                    f"{image.name}: glTF reads {where.name} from other components of an image; "
                    "pack it first"
                )
            same = (image.name, image.placing, image.wraps, image.uv_set, image.is_nearest)
            if same != (first.name, first.placing, first.wraps, first.uv_set, first.is_nearest):
                names = " and ".join(where.name for where in images)
                raise OptionError(
                    f"{image.name}: glTF reads {names} from one image; pack them first"
                )
        return first

    def _texture_info(
        self, image: ChannelImage, where: GltfChannel, source: ChannelSource | None
    ) -> dict[str, Any]:
        info: dict[str, Any] = {"index": self._texture(image)}
        if image.uv_set:
            info["texCoord"] = image.uv_set
        if source is not None and where.name == "normal" and source.factor[0] != 1.0:
            info["scale"] = source.factor[0]
        if source is not None and where.name == "occlusion" and source.factor[0] != 1.0:
            info["strength"] = source.factor[0]
        if image.placing != UNPLACED:
            info["extensions"] = {_TRANSFORM: _transform(image)}
            self._asset.use(_TRANSFORM)
        return info

    def _texture(self, image: ChannelImage) -> int:
        """Index of a texture, added if it is new."""
        kind = *image.wraps, image.is_nearest
        if kind not in self._samplers:
            wrap_s, wrap_t, is_nearest = kind
            self._samplers[kind] = self._asset.add(
                "samplers",
                {
                    "magFilter": _NEAREST if is_nearest else _LINEAR,
                    "minFilter": _NEAREST if is_nearest else _TRILINEAR,
                    "wrapS": _WRAPS[wrap_s],
                    "wrapT": _WRAPS[wrap_t],
                },
            )
        media_type, extension = _format(image)
        if image.name not in self._images:
            self._images[image.name] = self._asset.add_image(image.data, media_type)
        key = self._samplers[kind], self._images[image.name]
        if key not in self._textures:
            sampler, source = key
            texture: dict[str, Any] = {"sampler": sampler}
            if extension is None:
                texture["source"] = source
            else:
                texture["extensions"] = {extension: {"source": source}}
                self._asset.require(extension)
            self._textures[key] = self._asset.add("textures", texture)
        return self._textures[key]


def _format(image: ChannelImage) -> tuple[str, str | None]:
    """Media type of an image, and the extension that allows it in glTF."""
    for magic, start, media_type, extension in _FORMATS:
        if image.data[start : start + len(magic)] == magic:
            return media_type, extension
    raise OptionError(f"{image.name}: glTF has no images of this format; save it as PNG")


def _transform(image: ChannelImage) -> dict[str, Any]:
    """KHR_texture_transform of a placing, for coordinates with v down."""
    matrix = _FLIP @ np.array([*image.placing, (0.0, 0.0, 1.0)]) @ _FLIP
    angle = math.atan2(-matrix[1, 0], matrix[0, 0])
    sine, cosine = math.sin(angle), math.cos(angle)
    scale = (math.hypot(matrix[0, 0], matrix[1, 0]), sine * matrix[0, 1] + cosine * matrix[1, 1])
    turned = np.array([[cosine, sine], [-sine, cosine]]) * scale
    if not np.allclose(turned, matrix[:2, :2], atol=1e-9 * max(1.0, abs(matrix).max())):
        raise OptionError(f"{image.name}: glTF cannot place an image with a shear; bake it first")
    return {"offset": matrix[:2, 2].tolist(), "rotation": angle, "scale": list(scale)}
