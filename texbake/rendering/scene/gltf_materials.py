"""Materials of glTF files as those of a scene, with their textures in slots.

Base color is the factor times the texture (and COLOR_0). Roughness is the green and metalness the
blue channel of one texture; occlusion is the red channel of another. The alpha of the base color is
the opacity, used as `alphaMode` specifies.

In glTF the origin of texture coordinates is at the upper left with v down. Here it is at the lower
left with v up, and texture transforms are converted accordingly.
"""

from __future__ import annotations

import math
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, shortened
from texbake.mesh.files.gltf_document import Document
from texbake.mesh.files.gltf_materials import (
    GltfMaterial,
    GltfSource,
    GltfTexture,
    image_or_reason,
    image_path,
    image_source,
    read_material,
)
from texbake.records import dataclass
from texbake.rendering.scene.material import Material, NormalMap, Transmission
from texbake.rendering.scene.textures import Constant, ImageTexture, Slot
from texbake.texture.image import Image, decode_image, require_whole


@dataclass(frozen=True, eq=False)
class SceneMaterial:
    """A material, and the sets of texture coordinates that its textures use."""

    material: Material  # its slots name the sets but the first, as `set_name` does
    # Number of the set that is the first of the mesh: that of the normal map, which tangents belong
    # to, else that of the first texture
    uv_set: int
    further: tuple[int, ...]  # numbers of the other sets
    has_textures: bool


@dataclass(eq=False)
class MaterialReader:
    """Reads the materials of a document that are asked for, each once, and each image once."""

    document: Document  # the file
    # Lines about images that are missing or damaged; appended to. Their channels keep their
    # factors.
    missing: list[str] = field(default_factory=list)
    _first_set: int = 0
    _name: str = ""  # of the material that is being read
    _known: dict[int | None, SceneMaterial] = field(default_factory=dict)
    # If an image is missing or damaged, its value is a line that says why.
    _images: dict[tuple[str | int | None, bool], Path | Image | str] = field(default_factory=dict)

    def material(self, index: int | None, *, vertex_colors: bool = False) -> SceneMaterial:
        """Read the material with an index; None means glTF's default material."""
        if index not in self._known:
            self._known[index] = self._read(read_material(self.document, index))
        found = self._known[index]
        if not vertex_colors:
            return found
        return replace(found, material=replace(found.material, vertex_colors=True))

    def _read(self, source: GltfMaterial) -> SceneMaterial:
        sources = {name: source.channels[name] for name in _TEXTURES}
        textures = [item.texture for item in sources.values() if item.texture is not None]
        if any(source.channels.get("transmission", GltfSource((0.0,))).factor):
            through = (source.channels["transmission"], source.volume.thickness)
            textures += [item.texture for item in through if item.texture is not None]
        normal = sources["normal"].texture
        first = normal if normal is not None else next(iter(textures), None)
        self._first_set = 0 if first is None else first.uv_set
        self._name = source.name
        opacity = sources["alpha"].factor[0]
        material = Material(
            name=source.name,
            shading="unlit" if source.is_unlit else "metallic-roughness",
            alpha_mode=source.alpha_mode,
            alpha_cutoff=min(source.alpha_cutoff, 1.0),
            double_sided=source.is_double_sided,
            base_color=self._slot(sources["base-color"], color=True),
            opacity=None if source.alpha_mode == "opaque" or opacity == 1.0 else opacity,
            **({} if source.is_unlit else self._surface(source)),
        )
        further = {texture.uv_set for texture in textures} - {self._first_set}
        return SceneMaterial(material, self._first_set, tuple(sorted(further)), bool(textures))

    def _surface(self, source: GltfMaterial) -> dict[str, Any]:
        """Slots of what reflects light, which an unlit material does not read."""
        sources = source.channels
        emission = sources["emissive"]
        slots: dict[str, Any] = {
            "ior": source.ior,
            "transmission": self._transmission(source),
            "roughness": self._slot(sources["roughness"], channel=1),
            "metalness": self._slot(sources["metallic"], channel=2),
            "emission": self._slot(emission, color=True) if any(emission.factor) else None,
        }
        normal, occlusion = sources["normal"], sources["occlusion"]
        bumps, shade = self._texture(normal.texture), self._texture(occlusion.texture, channel=0)
        if bumps is not None:
            slots["normal_map"] = NormalMap(
                texture=bumps, space="tangent", convention="opengl", strength=normal.factor[0]
            )
        if shade is not None:
            slots["occlusion"] = shade
            slots["occlusion_strength"] = occlusion.factor[0]
        return slots

    def _transmission(self, source: GltfMaterial) -> Transmission | None:
        """How much is seen through a surface, and through what volume; None for nothing."""
        through, volume = source.channels.get("transmission"), source.volume
        if through is None or not any(through.factor):
            return None
        return Transmission(
            strength=self._slot(through, channel=0),
            thickness=self._slot(volume.thickness, channel=1),
            attenuation_color=volume.attenuation_color,
            attenuation_distance=volume.attenuation_distance,
        )

    def _slot(self, source: GltfSource, *, color: bool = False, channel: int | None = None) -> Slot:
        """A slot of a channel: its factor, times its texture where it has one."""
        factor: Constant
        if len(source.factor) == 3:
            red, green, blue = source.factor
            factor = (red, green, blue)
        else:
            (factor,) = source.factor
        texture = self._texture(source.texture, color=color, channel=channel, factor=factor)
        return factor if texture is None else texture

    def _texture(
        self,
        texture: GltfTexture | None,
        *,
        color: bool = False,
        channel: int | None = None,
        factor: Constant = 1.0,
    ) -> ImageTexture | None:
        """Return a texture; None if there is none, or if its image is missing or damaged."""
        image = None if texture is None else self._image(texture.image, color)
        if texture is None or image is None:
            return None
        along_s, along_t = texture.wraps
        (scale_u, scale_v), (offset_u, offset_v) = texture.scale, texture.offset
        return ImageTexture(
            image=image,
            filter=_filter(texture),
            wrap=along_s if along_s == along_t else texture.wraps,
            channel=channel,
            factor=factor,
            color=color,
            # v is flipped before and after: the visible sense of the rotation stays the same, and
            # the origin, now the lower left corner, moves to where (0, 1) was.
            scale=(scale_u, scale_v),
            rotate=math.degrees(texture.rotation),
            offset=(
                offset_u + pm.sin(texture.rotation) * scale_v,
                1.0 - offset_v - pm.cos(texture.rotation) * scale_v,
            ),
            uv_set=None if texture.uv_set == self._first_set else set_name(texture.uv_set),
        )

    def _image(self, index: int | None, color: bool) -> Path | Image | None:
        """Return the image of an index; None, with a line in `missing`, if there is none."""
        source = None if index is None else image_source(self.document, index)
        if (source, color) not in self._images:
            self._images[source, color] = self._open_image(index, color)
        found = self._images[source, color]
        if isinstance(found, str):
            self.missing.append(f"{shortened(self._name)}: {found}; the material keeps its factors")
            return None
        return found

    def _open_image(self, index: int | None, color: bool) -> Path | Image | str:
        """Return an image's path beside the file, its pixels in the file, or why there is none."""
        data = image_or_reason(self.document, index)
        if index is None or isinstance(data, str):
            return str(data)
        path, where = image_path(self.document, index), f"{self.document.path}: images[{index}]"
        try:
            if path is None:
                return decode_image(data, where, color=color)
            require_whole(data, where)
        except FileFormatError as error:
            return str(error)
        return path


# Textures of channels as glTF calls them, in the order in which they choose the first set. Metallic
# and roughness are in one texture, and alpha is in that of the base color.
_TEXTURES = {
    "base-color": "baseColorTexture",
    "alpha": "baseColorTexture",
    "normal": "normalTexture",
    "roughness": "metallicRoughnessTexture",
    "metallic": "metallicRoughnessTexture",
    "emissive": "emissiveTexture",
    "occlusion": "occlusionTexture",
}


def set_name(number: int) -> str:
    """Name of a set of texture coordinates, as the attributes of glTF have it."""
    return f"TEXCOORD_{number}"


def _filter(texture: GltfTexture) -> str:
    """Name the filter. NEAREST magnification selects nearest filtering at any size."""
    if texture.is_nearest:
        return "nearest"
    return "trilinear" if texture.has_mip_levels else "bilinear"
