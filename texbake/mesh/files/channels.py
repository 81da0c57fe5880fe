"""Where each format has the channels of a material: the one table for reading and for writing.

`CHANNELS` in `texbake.mesh.materials` has their defaults and color spaces, which hold for all
formats. An FBX material is read by `fbx_materials`, a USD one by `usd_materials`, one of OBJ by
`mtl`, and one of glTF by `gltf_materials`.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021, section 3.9, and its
extensions KHR_materials_clearcoat, KHR_materials_sheen, KHR_materials_specular and
KHR_materials_transmission; Pixar, "UsdPreviewSurface Specification", version 2.6; Wavefront
Technologies, "MTL material format", 1995; Dirk Guenther, "MTL extension for physically based
rendering", Clara.io, 2015.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import groupby
from types import MappingProxyType

from texbake.mesh.files.conversion import media_type
from texbake.mesh.materials import CHANNELS, ChannelImage, ChannelSource, MeshMaterial
from texbake.records import dataclass

_RGB = (0, 1, 2)
_RED, _GREEN, _BLUE, _ALPHA = (0,), (1,), (2,), (3,)
_WHITE, _BLACK, _NONE = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0), (0.0,)
_SURFACE = "pbrMetallicRoughness"
_CLEARCOAT = "KHR_materials_clearcoat"
_TRANSMISSION = "KHR_materials_transmission"
_SHEEN = "KHR_materials_sheen"
_SPECULAR = "KHR_materials_specular"
EMISSIVE_STRENGTH = "KHR_materials_emissive_strength"


@dataclass(frozen=True)
class FileChannel:
    """Where formats have a channel; what a format has no place for is empty."""

    name: str  # as in `CHANNELS`
    # Object in a glTF material that holds it: an extension, `pbrMetallicRoughness`, or "" for the
    # material itself.
    owner: str
    texture: str  # glTF's property of its texture
    components: tuple[int, ...]  # components of a texel of glTF, counted from red
    # glTF's property of its factor; "" if it has none, or one that means something else.
    factor: str = ""
    defaults: tuple[float, ...] = (1.0,)  # the factor of glTF where it is not given
    # Which numbers of the factor are those of the channel.
    factor_components: tuple[int, ...] = (0,)
    usd: str = ""  # input of UsdPreviewSurface
    usd_default: tuple[float, ...] = ()
    mtl: str = ""  # statement of .mtl files for its value
    mtl_image: str = ""  # and for its image
    fbx: tuple[str, ...] = ()  # properties of FBX materials with textures

    @property
    def is_extension(self) -> bool:
        """Whether an extension of glTF holds it."""
        return self.owner.startswith("KHR_")


_ALL = (
    FileChannel(
        "base-color", _SURFACE, "baseColorTexture", _RGB, "baseColorFactor", (*_WHITE, 1.0), _RGB,
        usd="diffuseColor", usd_default=(0.18, 0.18, 0.18), mtl="Kd", mtl_image="map_Kd",
        fbx=("DiffuseColor", "Maya|TEX_color_map"),
    ),
    FileChannel(
        "alpha", _SURFACE, "baseColorTexture", _ALPHA, "baseColorFactor", (*_WHITE, 1.0), _ALPHA,
        usd="opacity", usd_default=(1.0,), mtl="d", mtl_image="map_d",
        fbx=("TransparentColor", "TransparencyFactor", "Opacity"),
    ),
    FileChannel(
        "roughness", _SURFACE, "metallicRoughnessTexture", _GREEN, "roughnessFactor",
        usd="roughness", usd_default=(0.5,), mtl="Pr", mtl_image="map_Pr",
        fbx=("ShininessExponent", "Maya|TEX_roughness_map"),
    ),
    FileChannel(
        "metallic", _SURFACE, "metallicRoughnessTexture", _BLUE, "metallicFactor",
        usd="metallic", usd_default=_NONE, mtl="Pm", mtl_image="map_Pm",
        fbx=("ReflectionFactor", "Maya|TEX_metallic_map"),
    ),
    FileChannel(
        "normal", "", "normalTexture", _RGB, usd="normal", usd_default=(0.0, 0.0, 1.0),
        mtl_image="norm", fbx=("NormalMap", "Maya|TEX_normal_map"),
    ),
    FileChannel(
        "occlusion", "", "occlusionTexture", _RED, usd="occlusion", usd_default=(1.0,),
        fbx=("Maya|TEX_ao_map",),
    ),
    FileChannel(
        "emissive", "", "emissiveTexture", _RGB, "emissiveFactor", _BLACK, _RGB,
        usd="emissiveColor", usd_default=_BLACK, mtl="Ke", mtl_image="map_Ke",
        fbx=("EmissiveColor", "Maya|TEX_emissive_map"),
    ),
    FileChannel(
        "clearcoat", _CLEARCOAT, "clearcoatTexture", _RED, "clearcoatFactor", _NONE,
        usd="clearcoat", usd_default=_NONE,
    ),
    FileChannel(
        "clearcoat-roughness", _CLEARCOAT, "clearcoatRoughnessTexture", _GREEN,
        "clearcoatRoughnessFactor", _NONE, usd="clearcoatRoughness", usd_default=(0.01,),
    ),
    FileChannel(
        "transmission", _TRANSMISSION, "transmissionTexture", _RED, "transmissionFactor", _NONE
    ),
    FileChannel(
        "sheen-color", _SHEEN, "sheenColorTexture", _RGB, "sheenColorFactor", _BLACK, _RGB
    ),
    FileChannel(
        "sheen-roughness", _SHEEN, "sheenRoughnessTexture", _ALPHA, "sheenRoughnessFactor", _NONE
    ),
    FileChannel("specular", _SPECULAR, "specularTexture", _ALPHA, "specularFactor"),
    FileChannel(
        "specular-color", _SPECULAR, "specularColorTexture", _RGB, "specularColorFactor", _WHITE,
        _RGB,
    ),
)  # fmt: skip
FILE_CHANNELS: Mapping[str, FileChannel] = MappingProxyType({where.name: where for where in _ALL})
"""By their names, in the order in which glTF files have them."""
CHANNEL_OF_FBX: Mapping[str, str] = MappingProxyType(
    {name: where.name for where in _ALL for name in where.fbx}
)
"""Channels by the properties that textures are connected to."""


@dataclass(frozen=True)
class Slot:
    """A texture of glTF materials, and the channels that it holds."""

    owner: str
    texture: str
    channels: tuple[FileChannel, ...]

    def sources(self, material: MeshMaterial) -> Iterator[tuple[FileChannel, ChannelSource]]:
        """Yield where each channel of it comes from; the default, where the material is silent."""
        for where in self.channels:
            if where.name == "alpha" and material.alpha_mode == "opaque":
                continue
            default = ChannelSource(CHANNELS[where.name].default)
            yield where, material.channels.get(where.name, default)

    def image(self, material: MeshMaterial) -> ChannelImage | None:
        """Return the first image of its channels."""
        images = (source.image for _, source in self.sources(material))
        return next((image for image in images if image is not None), None)

    def holds(self, material: MeshMaterial) -> bool:
        """Whether glTF has the images of a material's channels, all in one and where it reads."""
        first = self.image(material)
        return first is None or (
            media_type(first.data) is not None
            and all(_is_read(where, source, first) for where, source in self.sources(material))
        )

    def fits(self, material: MeshMaterial) -> bool:
        """Whether glTF shows channels without image as the material does, not multiplied."""
        alone = (source for _, source in self.sources(material) if source.image is None)
        has_image = self.image(material) is not None
        return self.holds(material) and not (has_image and any(any(s.factor) for s in alone))


def _is_read(where: FileChannel, source: ChannelSource, first: ChannelImage) -> bool:
    """Whether glTF reads the image of a channel, if it has one, as the material does."""
    if source.image is None:
        return True
    if source.image.components != where.components or not same_place(source.image, first):
        return False
    return where.name != "normal" or is_scale(source.factor)


def is_scale(factor: tuple[float, ...]) -> bool:
    """Whether a factor of normals is a scale of glTF, which acts on x and y alike."""
    return factor == (factor[0], factor[0], 1.0)


def same_place(a: ChannelImage, b: ChannelImage) -> bool:
    """Whether two channels read an image file at the same places."""
    common = {"components": (), "name": ""}
    return replace(a, **common) == replace(b, **common)  # type: ignore[arg-type]


SLOTS = tuple(
    Slot(owner, texture, tuple(channels))
    for (owner, texture), channels in groupby(
        FILE_CHANNELS.values(), key=lambda channel: (channel.owner, channel.texture)
    )
)
