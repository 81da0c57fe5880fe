"""glTF materials: factors times textures, to slots.

Base color is the factor times the texture (and COLOR_0). Roughness is the green channel of its
texture, metalness the blue one, occlusion the red one of its own. A base color's fourth channel
covers what lies behind as `alphaMode` says.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021, section 3.9, and the
extensions KHR_materials_unlit, KHR_materials_emissive_strength and KHR_materials_ior.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

from texbake.mesh.files.gltf_document import Document
from texbake.mesh.mesh import FloatArray
from texbake.rendering.scene.gltf.textures import TextureReader
from texbake.rendering.scene.material import Material, NormalMap
from texbake.rendering.scene.textures import Slot

_ALPHA_MODES = {"OPAQUE": "opaque", "MASK": "mask", "BLEND": "blend"}


@dataclass(frozen=True, eq=False)
class ReadMaterial:
    """A material, and the number of the texture coordinates that it is looked up with."""

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
        """Material by its index; None for what glTF gives a primitive that has none."""
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
        """Texture coordinates of the first texture, and the textures that use them."""
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
            self.document.fail(f"{key!r} is {value!r}, not a number that it can be")
        return float(value)
