"""Where glTF materials keep their channels: one table, for reading and for writing.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021, section 3.9, and its
extensions KHR_materials_clearcoat, KHR_materials_sheen, KHR_materials_specular and
KHR_materials_transmission.
"""

from __future__ import annotations

from dataclasses import dataclass

_SURFACE = "pbrMetallicRoughness"
_CLEARCOAT = "KHR_materials_clearcoat"
_TRANSMISSION = "KHR_materials_transmission"
_SHEEN = "KHR_materials_sheen"
_SPECULAR = "KHR_materials_specular"
EMISSIVE_STRENGTH = "KHR_materials_emissive_strength"


@dataclass(frozen=True)
class GltfChannel:
    """Where a channel stands in a material.

    Attributes
    ----------
    name : str
        As in `CHANNELS`.
    owner : str
        Object in the material that holds it: an extension, `pbrMetallicRoughness`, or "" for the
        material itself.
    texture : str
        Property of its texture.
    components : tuple of int
        Components of a texel, counted from red.
    factor : str
        Property of its factor; "" if it has none, or one that means something else.
    defaults : tuple of float
        The factor where it is not given.
    factor_components : tuple of int
        Which numbers of the factor are those of the channel.
    """

    name: str
    owner: str
    texture: str
    components: tuple[int, ...]
    factor: str = ""
    defaults: tuple[float, ...] = (1.0,)
    factor_components: tuple[int, ...] = (0,)

    @property
    def is_extension(self) -> bool:
        """Whether an extension holds it."""
        return self.owner.startswith("KHR_")


_RGB = (0, 1, 2)
_WHITE = (1.0, 1.0, 1.0)
_BLACK = (0.0, 0.0, 0.0)
_NONE = (0.0,)

GLTF_CHANNELS = (
    GltfChannel(
        "base-color", _SURFACE, "baseColorTexture", _RGB, "baseColorFactor", (*_WHITE, 1.0), _RGB
    ),
    GltfChannel(
        "alpha", _SURFACE, "baseColorTexture", (3,), "baseColorFactor", (*_WHITE, 1.0), (3,)
    ),
    GltfChannel("roughness", _SURFACE, "metallicRoughnessTexture", (1,), "roughnessFactor"),
    GltfChannel("metallic", _SURFACE, "metallicRoughnessTexture", (2,), "metallicFactor"),
    GltfChannel("normal", "", "normalTexture", _RGB),
    GltfChannel("occlusion", "", "occlusionTexture", (0,)),
    GltfChannel("emissive", "", "emissiveTexture", _RGB, "emissiveFactor", _BLACK, _RGB),
    GltfChannel("clearcoat", _CLEARCOAT, "clearcoatTexture", (0,), "clearcoatFactor", _NONE),
    GltfChannel(
        "clearcoat-roughness",
        _CLEARCOAT,
        "clearcoatRoughnessTexture",
        (1,),
        "clearcoatRoughnessFactor",
        _NONE,
    ),
    GltfChannel(
        "transmission", _TRANSMISSION, "transmissionTexture", (0,), "transmissionFactor", _NONE
    ),
    GltfChannel("sheen-color", _SHEEN, "sheenColorTexture", _RGB, "sheenColorFactor", _BLACK, _RGB),
    GltfChannel(
        "sheen-roughness", _SHEEN, "sheenRoughnessTexture", (3,), "sheenRoughnessFactor", _NONE
    ),
    GltfChannel("specular", _SPECULAR, "specularTexture", (3,), "specularFactor"),
    GltfChannel(
        "specular-color",
        _SPECULAR,
        "specularColorTexture",
        _RGB,
        "specularColorFactor",
        _WHITE,
        _RGB,
    ),
)
