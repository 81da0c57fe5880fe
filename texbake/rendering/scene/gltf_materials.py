"""Reading glTF materials and their textures into slots.

Base color is the factor times the texture (and COLOR_0). Roughness is the green and metalness the
blue channel of one texture; occlusion is the red channel of another. The alpha of the base color is
the opacity, used as `alphaMode` specifies.

In glTF the origin of texture coordinates is at the upper left with v down. Here it is at the lower
left with v up, and texture transforms are converted accordingly.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021, section 3.9, and the
extensions KHR_materials_unlit, KHR_materials_emissive_strength and KHR_materials_ior.
"""

from __future__ import annotations

import base64
import binascii
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from texbake.errors import FileError
from texbake.mesh.files.gltf_document import Document
from texbake.mesh.files.source import require_file
from texbake.mesh.mesh import FloatArray
from texbake.rendering.scene.material import Material, NormalMap
from texbake.rendering.scene.textures import Constant, ImageTexture, Slot
from texbake.texture.image import Image, decode_image

_NEAREST = 9728

_FILTERS_WITHOUT_MIPS = (9728, 9729)

_WRAPS = {33071: "clamp", 33648: "mirror", 10497: "repeat"}

_REPEAT = 10497


@dataclass(eq=False)
class TextureReader:
    """Reads the textures of a document, each image once.

    Attributes
    ----------
    document
        The file.
    notes
        Features of the file that are not supported; appended to.
    """

    document: Document
    notes: list[str] = field(default_factory=list)
    _images: dict[tuple[int, bool], Path | Image] = field(default_factory=dict)

    def texture(
        self,
        info: dict[str, Any],
        *,
        color: bool,
        channel: int | None = None,
        factor: Constant = 1.0,
    ) -> ImageTexture:
        """Read the texture of a textureInfo object.

        Parameters
        ----------
        info
            textureInfo of a material: `index`, and optionally KHR_texture_transform.
        color
            Whether the image is coded in sRGB.
        channel, factor
            As in `ImageTexture`.
        """
        texture = self.document.item("textures", info.get("index"))
        sampler = {}
        if "sampler" in texture:
            sampler = self.document.item("samplers", texture["sampler"])
        return ImageTexture(
            image=self._image(texture, color),
            filter=_filter(sampler),
            wrap=self._wrap(sampler),
            channel=channel,
            factor=factor,
            color=color,
            **self._transform(info),
        )

    def uv_set(self, info: dict[str, Any]) -> int:
        """Return the number of the UV set that a textureInfo object uses."""
        transform = self._extension(info, "KHR_texture_transform")
        owner = transform if "texCoord" in transform else info
        return self.document.integer(owner, "texCoord", 0)

    def _wrap(self, sampler: dict[str, Any]) -> str:
        codes = [sampler.get(key, _REPEAT) for key in ("wrapS", "wrapT")]
        for code in codes:
            if code not in _WRAPS:
                self.document.fail(f"the wrap mode {code!r} is not known")
        if codes[0] != codes[1]:
            self.notes.append(
                f"a sampler wraps {_WRAPS[codes[0]]} along s and {_WRAPS[codes[1]]} along t; "
                "shown as the first in both directions"
            )
        return _WRAPS[codes[0]]

    def _transform(self, info: dict[str, Any]) -> dict[str, Any]:
        transform = self._extension(info, "KHR_texture_transform")
        if not transform:
            return {}
        scale = self.document.numbers(transform, "scale", 2)
        offset = self.document.numbers(transform, "offset", 2)
        scale = np.ones(2) if scale is None else scale
        offset = np.zeros(2) if offset is None else offset
        angle = transform.get("rotation", 0.0)
        if not isinstance(angle, int | float) or not math.isfinite(angle):
            self.document.fail("the rotation of a texture is not a number")
        # Flip v before and after: the visible sense of the rotation stays the same, and the
        # origin, now the lower left corner, moves to where (0, 1) was.
        return {
            "scale": (float(scale[0]), float(scale[1])),
            "rotate": math.degrees(angle),
            "offset": (
                float(offset[0] + math.sin(angle) * scale[1]),
                float(1.0 - offset[1] - math.cos(angle) * scale[1]),
            ),
        }

    def _extension(self, owner: dict[str, Any], name: str) -> dict[str, Any]:
        return self.document.mapping(self.document.mapping(owner, "extensions"), name)

    def _image(self, texture: dict[str, Any], color: bool) -> Path | Image:
        index: Any = self._extension(texture, "EXT_texture_webp").get(
            "source", texture.get("source")
        )
        image = self.document.item("images", index)
        if (index, color) not in self._images:
            self._images[index, color] = self._opened(index, image, color)
        return self._images[index, color]

    def _opened(self, index: int, image: dict[str, Any], color: bool) -> Path | Image:
        """Return the path of an external image, or the pixels of an embedded one."""
        uri = image.get("uri")
        where = f"{self.document.path}: images[{index}]"
        if isinstance(uri, str) and not uri.startswith("data:"):
            if "://" in uri:
                self.document.fail(f"images[{index}] is at {uri[:60]!r}; only local files are read")
            path = self.document.path.parent / unquote(uri)
            try:
                require_file(path)
            except FileError as error:
                raise FileError(f"{where}: {error}") from error
            return path
        if isinstance(uri, str):
            try:
                data = base64.b64decode(uri.partition(",")[2])
            except binascii.Error:
                self.document.fail(f"the data of images[{index}] is not base64")
        else:
            data = self.document.view_bytes(image.get("bufferView")).tobytes()
        return decode_image(data, where, color=color)


def _filter(sampler: dict[str, Any]) -> str:
    """Name the filter. NEAREST magnification selects nearest filtering at any size."""
    if sampler.get("magFilter") == _NEAREST:
        return "nearest"
    return "bilinear" if sampler.get("minFilter") in _FILTERS_WITHOUT_MIPS else "trilinear"


_ALPHA_MODES = {"OPAQUE": "opaque", "MASK": "mask", "BLEND": "blend"}


@dataclass(frozen=True, eq=False)
class ReadMaterial:
    """A material, and the number of the UV set that its textures use."""

    material: Material
    uv_set: int
    has_textures: bool


@dataclass(eq=False)
class MaterialReader:
    """Reads the materials of a document, each once."""

    document: Document
    textures: TextureReader
    _known: dict[int | None, ReadMaterial] = field(default_factory=dict)

    def material(self, index: int | None, *, vertex_colors: bool = False) -> ReadMaterial:
        """Read the material with an index; None means glTF's default material."""
        if index not in self._known:
            source = {} if index is None else self.document.item("materials", index)
            name = str(source.get("name") or ("material" if index is None else f"material {index}"))
            self._known[index] = self._read(source, name)
        found = self._known[index]
        if not vertex_colors:
            return found
        return replace(found, material=replace(found.material, vertex_colors=True))

    def _read(self, source: dict[str, Any], name: str) -> ReadMaterial:
        pbr = self.document.mapping(source, "pbrMetallicRoughness")
        infos = {
            key: self.document.mapping(owner, key)
            for owner, key in (
                (pbr, "baseColorTexture"),
                (source, "normalTexture"),
                (pbr, "metallicRoughnessTexture"),
                (source, "emissiveTexture"),
                (source, "occlusionTexture"),
            )
            if key in owner
        }
        uv_set, infos = self._of_one_uv_set(infos, name)
        mode = source.get("alphaMode", "OPAQUE")
        if mode not in _ALPHA_MODES:
            self.document.fail(f"the alphaMode {mode!r} of {name!r} is not known")
        unlit = "KHR_materials_unlit" in self.document.mapping(source, "extensions")
        material = Material(
            name=name,
            shading="unlit" if unlit else "metallic-roughness",
            alpha_mode=_ALPHA_MODES[mode],
            alpha_cutoff=min(self._number(source, "alphaCutoff", 0.5), 1.0),
            double_sided=bool(source.get("doubleSided", False)),
            **self._base(pbr, infos, mode),
            **({} if unlit else self._surface(source, pbr, infos)),
        )
        return ReadMaterial(material, uv_set, bool(infos))

    def _of_one_uv_set(
        self, infos: dict[str, dict[str, Any]], name: str
    ) -> tuple[int, dict[str, dict[str, Any]]]:
        """Return the UV set of the first texture, and the textures that use the same set."""
        sets = {key: self.textures.uv_set(info) for key, info in infos.items()}
        chosen = next(iter(sets.values()), 0)
        for key, uv_set in sets.items():
            if uv_set != chosen:
                self.textures.notes.append(
                    f"{key} of {name!r} lies on TEXCOORD_{uv_set}, others on TEXCOORD_{chosen}; "
                    "it is left out"
                )
        return chosen, {key: info for key, info in infos.items() if sets[key] == chosen}

    def _base(
        self, pbr: dict[str, Any], infos: dict[str, dict[str, Any]], mode: str
    ) -> dict[str, Any]:
        factor = self._factors(pbr, "baseColorFactor", 4)
        red, green, blue, alpha = (1.0, 1.0, 1.0, 1.0) if factor is None else factor.tolist()
        color: Slot = (red, green, blue)
        if "baseColorTexture" in infos:
            color = self.textures.texture(
                infos["baseColorTexture"], color=True, factor=(red, green, blue)
            )
        return {"base_color": color, "opacity": None if mode == "OPAQUE" or alpha == 1.0 else alpha}

    def _surface(
        self, source: dict[str, Any], pbr: dict[str, Any], infos: dict[str, dict[str, Any]]
    ) -> dict[str, Any]:
        slots: dict[str, Any] = {
            "roughness": self._number(pbr, "roughnessFactor", 1.0),
            "metalness": self._number(pbr, "metallicFactor", 1.0),
            "emission": self._emission(source, infos),
        }
        if "metallicRoughnessTexture" in infos:
            info = infos["metallicRoughnessTexture"]
            for slot, channel in ("roughness", 1), ("metalness", 2):
                slots[slot] = self.textures.texture(
                    info, color=False, channel=channel, factor=slots[slot]
                )
        if "normalTexture" in infos:
            info = infos["normalTexture"]
            slots["normal_map"] = NormalMap(
                texture=self.textures.texture(info, color=False),
                space="tangent",
                convention="opengl",
                strength=self._number(info, "scale", 1.0, signed=True),
            )
        if "occlusionTexture" in infos:
            info = infos["occlusionTexture"]
            slots["occlusion"] = self.textures.texture(info, color=False, channel=0)
            slots["occlusion_strength"] = min(self._number(info, "strength", 1.0), 1.0)
        ior = self.document.mapping(
            self.document.mapping(source, "extensions"), "KHR_materials_ior"
        )
        if ior:
            slots["ior"] = self._number(ior, "ior", 1.5)
        return slots

    def _emission(self, source: dict[str, Any], infos: dict[str, dict[str, Any]]) -> Slot | None:
        factor = self._factors(source, "emissiveFactor", 3)
        if factor is None or not factor.any():
            return None
        extension = self.document.mapping(
            self.document.mapping(source, "extensions"), "KHR_materials_emissive_strength"
        )
        red, green, blue = (factor * self._number(extension, "emissiveStrength", 1.0)).tolist()
        if "emissiveTexture" not in infos:
            return red, green, blue
        return self.textures.texture(
            infos["emissiveTexture"], color=True, factor=(red, green, blue)
        )

    def _factors(self, owner: dict[str, Any], key: str, n: int) -> FloatArray | None:
        values = self.document.numbers(owner, key, n)
        if values is not None and values.min() < 0.0:
            self.document.fail(f"{key!r} is below 0")
        return values

    def _number(
        self, owner: dict[str, Any], key: str, default: float, *, signed: bool = False
    ) -> float:
        value = owner.get(key, default)
        if (
            not isinstance(value, int | float)
            or isinstance(value, bool)
            or not math.isfinite(value)
            or (value < 0.0 and not signed)
        ):
            self.document.fail(f"{key!r} is {value!r}, which is not a valid number")
        return float(value)
