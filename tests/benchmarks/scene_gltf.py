"""Scenes of texbake as binary glTF for other renderers, written without texbake's own writer.

What glTF has no place for is a reason not to write the scene. A Lambert material becomes one
without specular reflection (KHR_materials_specular), which is what Lambert's law is.
"""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image as Picture

from texbake.mesh.normals import shading_normals
from texbake.mesh.tangents import corner_tangents
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.scene import apply_mapping, place_mesh
from texbake.rendering.scene.textures import ImageTexture

# Other programs choose by settings of their own how they filter along a slope.
FILTERS = {"nearest": (9728, 9728), "bilinear": (9729, 9729), "trilinear": (9729, 9987),
           "ewa": (9729, 9987)}  # fmt: skip
WRAPS = {"repeat": 10497, "mirror": 33648, "clamp": 33071}
# Slots that glTF 2.0 has nothing for.
FOREIGN = {
    "bump_map": "bump map", "displacement": "displacement", "parallax": "parallax",
    "reflection": "mirror", "refraction": "refraction", "light_map": "light map",
    "occlusion": "occlusion map, for ambient light", "gloss": "gloss map",
}  # fmt: skip


class UnwritableError(Exception):
    """glTF, or the other renderers, have no place for something in a scene."""


class Writer:
    """A file that grows: `json`, and the bytes of its one buffer."""

    def __init__(self):
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0}
        self.bytes = bytearray()

    def add(self, kind, item):
        items = self.json.setdefault(kind, [])
        if item not in items:
            items.append(item)
        return items.index(item)

    def view(self, data):
        self.bytes += b"\0" * (-len(self.bytes) % 4)
        place = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(data)}
        self.bytes += data
        return self.add("bufferViews", place)

    def rows(self, values):
        values = np.ascontiguousarray(values, np.float32)
        item = {
            "bufferView": self.view(values.tobytes()), "componentType": 5126, "count": len(values),
            "type": f"VEC{values.shape[1]}", "min": values.min(0).tolist(),
            "max": values.max(0).tolist(),
        }  # fmt: skip
        return self.add("accessors", item)

    def texture(self, pixels, texture, uvs):
        """Add (H, W, C) uint8 pixels, looked up as a texture is at (n, 2) coordinates."""
        if texture.filter not in FILTERS:
            raise UnwritableError(f"filter {texture.filter}")
        magnify, minify = FILTERS[texture.filter]
        inside = uvs.min() >= 0.0 and uvs.max() <= 1.0
        wraps = texture.wrap or ("clamp" if inside else "repeat")
        wraps = (wraps, wraps) if isinstance(wraps, str) else wraps
        if not set(wraps) <= set(WRAPS):
            raise UnwritableError("wrap border")
        data = io.BytesIO()
        Picture.fromarray(pixels).save(data, "png")
        image = {"mimeType": "image/png", "bufferView": self.view(data.getvalue())}
        sampler = {
            "magFilter": magnify, "minFilter": minify,
            "wrapS": WRAPS[wraps[0]], "wrapT": WRAPS[wraps[1]],
        }  # fmt: skip
        source = {"source": self.add("images", image), "sampler": self.add("samplers", sampler)}
        return {"index": self.add("textures", source)}

    def write(self, path):
        self.bytes += b"\0" * (-len(self.bytes) % 4)
        self.json["buffers"] = [{"byteLength": len(self.bytes)}]
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + len(self.bytes)
        path.write_bytes(
            struct.pack("<4sIIII", b"glTF", 2, total, len(text), 0x4E4F534A)
            + text
            + struct.pack("<II", len(self.bytes), 0x004E4942)
            + self.bytes
        )


def write_scene(scene, path):
    """Write the visible objects of a scene; raises `UnwritableError`."""
    file = Writer()
    nodes = [
        file.add("nodes", {"mesh": _mesh(file, item), "name": item.name})
        for item in scene.objects
        if item.visible
    ]
    file.json["scenes"] = [{"nodes": nodes}]
    used = {name for m in file.json["materials"] for name in m.get("extensions", {})}
    if used:
        file.json["extensionsUsed"] = sorted(used)
    file.write(path)


def _mesh(file, item):
    mesh, material = place_mesh(apply_mapping(item)), item.material
    normals, corners = shading_normals(mesh)
    attributes = {
        "POSITION": file.rows(mesh.positions[mesh.faces].reshape(-1, 3)),
        "NORMAL": file.rows(normals[corners].reshape(-1, 3)),
    }
    uvs = np.zeros((1, 2))
    textures = [t for t in map(_image_of, vars(material).values()) if t is not None]
    if textures:
        placings = {(t.scale, t.offset, t.rotate, t.uv_set) for t in textures}
        if len(placings) > 1 or textures[0].uv_set is not None:
            raise UnwritableError("textures that are placed differently")
        uvs = _turned(mesh.corner_uvs().reshape(-1, 2), textures[0])
        attributes["TEXCOORD_0"] = file.rows(np.column_stack([uvs[:, 0], 1.0 - uvs[:, 1]]))
    if material.normal_map is not None:
        attributes["TANGENT"] = file.rows(corner_tangents(mesh).reshape(-1, 4))
    if material.vertex_colors and mesh.colors is not None:
        attributes["COLOR_0"] = file.rows(mesh.colors[mesh.faces].reshape(-1, mesh.colors.shape[1]))
    primitive = {"attributes": attributes, "material": _material(file, material, uvs)}
    return file.add("meshes", {"primitives": [primitive]})


def _image_of(slot):
    slot = getattr(slot, "texture", slot)
    return slot if isinstance(slot, ImageTexture) else None


def _turned(uvs, texture):
    turn = np.radians(texture.rotate)
    matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return uvs * texture.scale @ matrix.T + texture.offset


def _material(file, material, uvs):
    for name, words in FOREIGN.items():
        if getattr(material, name) is not None:
            raise UnwritableError(words)
    if material.projected:
        raise UnwritableError("projected picture")
    if material.shading == "blinn-phong":
        raise UnwritableError("Blinn-Phong shading")
    if material.shading_rate != Material().shading_rate:
        raise UnwritableError("shading at vertices")
    for slot in vars(material).values():
        slot = getattr(slot, "texture", slot)
        if hasattr(slot, "procedure") or getattr(slot, "colors", None) is not None:
            raise UnwritableError("procedure")
    pbr: dict[str, Any] = {}
    content = {
        "name": material.name, "pbrMetallicRoughness": pbr,
        "doubleSided": material.double_sided is not False,
    }  # fmt: skip
    extensions: dict[str, Any] = {}
    _add_color(file, material, uvs, content)
    if material.shading == "unlit":
        extensions["KHR_materials_unlit"] = {}
    elif material.shading == "lambert":
        pbr |= {"metallicFactor": 0.0, "roughnessFactor": 1.0}
        extensions["KHR_materials_specular"] = {"specularFactor": 0.0}
    else:
        _add_reflection(file, material, uvs, pbr)
        if material.ior != 1.5:
            extensions["KHR_materials_ior"] = {"ior": material.ior}
        _add_transmission(material, extensions)
    if material.normal_map is not None:
        normal = material.normal_map
        if normal.space not in (None, "tangent") or normal.convention == "directx":
            raise UnwritableError("normals of another space")
        found = file.texture(_pixels(normal.texture)[..., :3], normal.texture, uvs)
        content["normalTexture"] = {**found, "scale": normal.strength}
    if material.emission is not None:
        _add_emission(file, material, uvs, content, extensions)
    if extensions:
        content["extensions"] = extensions
    return file.add("materials", content)


def _add_color(file, material, uvs, content):
    color, opacity = material.base_color, material.opacity
    pbr = content["pbrMetallicRoughness"]
    alpha = opacity if isinstance(opacity, float | int) else 1.0
    image, mask = _image_of(color), _image_of(opacity)
    if mask is not None:
        if image is not None:
            raise UnwritableError("images of both color and opacity")
        value = _pixels(mask)[..., mask.channel or 0]
        rgba = np.dstack([np.full((*value.shape, 3), 255, np.uint8), value])
        pbr["baseColorTexture"] = file.texture(rgba, mask, uvs)
    if image is not None:
        pbr["baseColorTexture"] = file.texture(_pixels(image), image, uvs)
        color = image.factor
    pbr["baseColorFactor"] = [*np.broadcast_to(color, 3).tolist(), alpha]
    has_alpha = alpha < 1.0 or mask is not None or (
        image is not None and _pixels(image).shape[2] in (2, 4)
    )  # fmt: skip
    if has_alpha and material.alpha_mode != "opaque":
        content["alphaMode"] = material.alpha_mode.upper()
        if material.alpha_mode == "mask":
            content["alphaCutoff"] = material.alpha_cutoff


def _add_reflection(file, material, uvs, pbr):
    slots = {"roughness": material.roughness, "metalness": material.metalness}
    images = {name: _image_of(slot) for name, slot in slots.items()}
    factors = {}
    planes = {}
    for name, slot in slots.items():
        image = images[name]
        factors[name] = slot if image is None else image.factor
        if image is not None:
            planes[name] = _pixels(image)[..., image.channel or 0]
    if planes:
        shape = next(iter(planes.values())).shape
        packed = np.full((*shape, 3), 255, np.uint8)
        for name, channel in (("roughness", 1), ("metalness", 2)):
            if name in planes:
                packed[..., channel] = planes[name]
        image = next(item for item in images.values() if item is not None)
        pbr["metallicRoughnessTexture"] = file.texture(packed, image, uvs)
    pbr |= {
        "roughnessFactor": float(factors["roughness"]),
        "metallicFactor": float(factors["metalness"]),
    }


def _add_transmission(material, extensions):
    through = material.transmission
    if through is None:
        return
    if not isinstance(through.strength, float | int) or not isinstance(
        through.thickness, float | int
    ):
        raise UnwritableError("transmission by an image or a procedure")
    extensions["KHR_materials_transmission"] = {"transmissionFactor": through.strength}
    if through.thickness:
        volume = {
            "thicknessFactor": through.thickness,
            "attenuationColor": list(through.attenuation_color),
        }
        if through.attenuation_distance is not None:
            volume["attenuationDistance"] = through.attenuation_distance
        extensions["KHR_materials_volume"] = volume


def _add_emission(file, material, uvs, content, extensions):
    image = _image_of(material.emission)
    factor = np.broadcast_to(material.emission if image is None else image.factor, 3)
    strength = max(1.0, float(np.max(factor)))
    content["emissiveFactor"] = (np.asarray(factor, float) / strength).tolist()
    if strength > 1.0:
        extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": strength}
    if image is not None:
        content["emissiveTexture"] = file.texture(_pixels(image)[..., :3], image, uvs)


def _pixels(texture):
    """(H, W, C) uint8 of an image file, as it is."""
    if not isinstance(texture.image, str | Path):
        raise UnwritableError("image without a file")
    with Picture.open(texture.image) as picture:
        pixels = np.asarray(picture)
    if pixels.dtype != np.uint8:
        raise UnwritableError("image of more than 8 bits")
    return pixels.reshape(*pixels.shape[:2], -1)
