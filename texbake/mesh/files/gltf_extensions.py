"""Extensions of glTF materials that texbake carries along: numbers and images, as they are.

Based on: Khronos Group, KHR_materials_anisotropy, KHR_materials_diffuse_transmission,
KHR_materials_dispersion, KHR_materials_ior, KHR_materials_iridescence and KHR_materials_volume.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from texbake.errors import FileFormatError
from texbake.mesh.files.gltf_document import Document
from texbake.mesh.files.gltf_materials import GltfTexture, read_texture
from texbake.mesh.materials import ChannelImage

CARRIED: Mapping[str, tuple[str, ...]] = {
    "KHR_materials_anisotropy": (
        "anisotropyStrength", "anisotropyRotation", "anisotropyTexture",
    ),
    "KHR_materials_diffuse_transmission": (
        "diffuseTransmissionFactor", "diffuseTransmissionTexture",
        "diffuseTransmissionColorFactor", "diffuseTransmissionColorTexture",
    ),
    "KHR_materials_dispersion": ("dispersion",),
    "KHR_materials_ior": ("ior",),
    "KHR_materials_iridescence": (
        "iridescenceFactor", "iridescenceTexture", "iridescenceIor",
        "iridescenceThicknessMinimum", "iridescenceThicknessMaximum",
        "iridescenceThicknessTexture",
    ),
    "KHR_materials_volume": (
        "thicknessFactor", "thicknessTexture", "attenuationDistance", "attenuationColor",
    ),
}  # fmt: skip
"""Names of extensions, and the properties of each."""
VARIANTS = "KHR_materials_variants"


def read_extensions(
    document: Document,
    extensions: dict[str, Any],
    image_of: Callable[[str, GltfTexture], ChannelImage | None],
) -> dict[str, dict[str, Any]]:
    """Read the extensions of a material that texbake carries along, without damaged properties."""
    found: dict[str, dict[str, Any]] = {}
    for name in CARRIED.keys() & extensions.keys():
        content = document.mapping(extensions, name)
        values = found.setdefault(name, {})
        for key in CARRIED[name]:
            value = content.get(key)
            if key.endswith("Texture"):
                try:
                    texture = read_texture(document, document.mapping(content, key))
                except FileFormatError:
                    continue
                value = image_of(key, texture)
            elif not _is_sound(value):
                value = None
            if value is not None:
                values[key] = value
    return {name: found[name] for name in sorted(found)}


def _is_sound(value: Any) -> bool:
    numbers = value if isinstance(value, list) and len(value) <= 4 else [value]
    return all(type(each) in (int, float) and math.isfinite(each) for each in numbers)
