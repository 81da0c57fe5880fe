"""A glTF asset in the making: its JSON and the parts of its buffer, written as one file.

With `compress` every view of vertices and indices is coded by `gltf_compression`. As the extension
demands, a reader without it is then pointed to a second buffer, which has no bytes.

glTF reads roughness from the green and metallic from the blue of one image, alpha from the image of
the base color. Other formats have an image for each channel; `texbake.texture.material_images` puts
these where glTF reads them. A channel without an image whose texture has one keeps its factor: the
image is taken to be 1 there, as that module makes it.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake import __version__
from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, OptionError
from texbake.files import PathLike, replacing
from texbake.mesh.files import gltf_document as gltf
from texbake.mesh.files.channels import EMISSIVE_STRENGTH, FILE_CHANNELS, SLOTS, Slot
from texbake.mesh.files.conversion import (
    as_text,
    check_normal_map,
    color_factors,
    image_file,
    media_type,
)
from texbake.mesh.files.gltf_compression import (
    ATTRIBUTES,
    EXTENSION,
    TRIANGLES,
    encode_triangles,
    encode_vertices,
)
from texbake.mesh.materials import (
    CHANNELS,
    UNPLACED,
    ChannelImage,
    Materials,
    MeshMaterial,
    Placing,
    is_sheared,
)
from texbake.mesh.mesh import FloatArray, Int64Array

_VERTICES, _INDICES = 34962, 34963  # targets of a buffer view
_COMPONENTS = {dtype.name: code for code, dtype in gltf.COMPONENTS.items()}
_NEAREST_MIPS, _TRILINEAR = 9984, 9987
_WRAPS = {name: code for code, name in gltf.WRAPS.items()}
# Images that glTF itself does not name, by the extensions that do.
_IMAGE_EXTENSIONS = {"image/webp": "EXT_texture_webp", "image/ktx2": "KHR_texture_basisu"}
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


class GltfAsset:
    """A glTF asset in the making; `write` ends it."""

    def __init__(self, *, compress: bool = False) -> None:
        self.is_compressed = compress
        self._parts: list[bytes] = []
        self._n_bytes = 0
        self._n_plain = 0  # bytes of what is compressed, as they were
        self._json: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": f"texbake {__version__}"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            **{kind: [] for kind in ("nodes", "meshes", "materials", "accessors", "bufferViews")},
        }
        self._images: dict[bytes, int] = {}
        if compress:
            self.require(EXTENSION)

    def append_material(self, content: dict[str, Any]) -> int:
        """Add a material as glTF has it, and return its index."""
        self._json["materials"].append(content)
        return len(self._json["materials"]) - 1

    def add_material(
        self,
        name: str,
        *,
        normal_map: PathLike | None = None,
        base_color: PathLike | Sequence[float] | None = None,
        orm: PathLike | None = None,
        emissive: PathLike | None = None,
    ) -> None:
        """Add the material that all groups share, with its textures; see `write_glb` for those."""
        surface: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 0.5}
        material: dict[str, Any] = {"name": as_text(name), "pbrMetallicRoughness": surface}
        if normal_map is not None:
            check_normal_map(normal_map)
            material["normalTexture"] = {"index": self._add_texture_file(normal_map)}
        if isinstance(base_color, str | os.PathLike):
            surface["baseColorTexture"] = {"index": self._add_texture_file(base_color)}
        elif base_color is not None:
            surface["baseColorFactor"] = color_factors(base_color)
        if orm is not None:
            texture = {"index": self._add_texture_file(orm)}
            surface |= {"metallicFactor": 1.0, "roughnessFactor": 1.0}
            surface["metallicRoughnessTexture"] = texture
            material["occlusionTexture"] = texture
        if emissive is not None:
            material["emissiveTexture"] = {"index": self._add_texture_file(emissive)}
            material["emissiveFactor"] = [1.0, 1.0, 1.0]
        self.append_material(material)

    def add_mesh(self, name: str, primitives: list[dict[str, Any]], **fields: Any) -> int:
        """Add a mesh, and return its index."""
        self._json["meshes"].append({"name": as_text(name), "primitives": primitives, **fields})
        return len(self._json["meshes"]) - 1

    def add_primitive(
        self, columns: dict[str, npt.NDArray[Any]], indices: Int64Array, material: int
    ) -> dict[str, Any]:
        """Add the arrays of a primitive, with (3 F,) indices, and return it."""
        attributes = {
            attribute: self._add_accessor(values, _VERTICES, bounded=attribute == "POSITION")
            for attribute, values in columns.items()
        }
        # The greatest index of a type restarts a primitive, so 65535 vertices fit 16 bits.
        index_type = np.uint16 if len(columns["POSITION"]) <= 65535 else np.uint32
        return {
            "attributes": attributes,
            "indices": self._add_accessor(indices.astype(index_type).reshape(-1, 1), _INDICES),
            "material": material,
        }

    def add_node(self, name: str, **fields: Any) -> int:
        """Add a node that is in no scene yet, and return its index."""
        self._json["nodes"].append({"name": as_text(name), **fields})
        return len(self._json["nodes"]) - 1

    def place(self, node: int) -> None:
        """Put a node into the scene."""
        self._json["scenes"][0]["nodes"].append(node)

    def set_levels(self, node: int, others: list[int], coverages: Sequence[float]) -> None:
        """Say which nodes stand in for one where it is small in the picture (MSFT_lod)."""
        self.use("MSFT_lod")
        fields = self._json["nodes"][node]
        fields["extensions"] = {"MSFT_lod": {"ids": others}}
        fields["extras"] = {"MSFT_screencoverage": [float(share) for share in coverages]}

    def write(self, path: PathLike) -> None:
        """Write the file, whole or not at all."""
        buffers: list[dict[str, Any]] = [{"byteLength": self._n_bytes}]
        if self.is_compressed:
            fallback = {EXTENSION: {"fallback": True}}
            buffers.append({"byteLength": self._n_plain, "extensions": fallback})
        text = json.dumps({**self._json, "buffers": buffers}, separators=(",", ":")).encode("ascii")
        text += b" " * (-len(text) % 4)
        n_bytes = 12 + 8 + len(text) + 8 + self._n_bytes
        if n_bytes >= 1 << 32:
            raise FileFormatError(f"{path}: {n_bytes} bytes are more than a GLB holds; simplify it")
        with replacing(path) as temporary, temporary.open("wb") as file:
            file.write(struct.pack("<4sIIII", gltf.MAGIC, 2, n_bytes, len(text), gltf.JSON_CHUNK))
            file.write(text)
            file.write(struct.pack("<II", self._n_bytes, gltf.BINARY_CHUNK))
            file.writelines(self._parts)

    def use(self, extension: str) -> None:
        """Name an extension among those that the file uses."""
        used = self._json.setdefault("extensionsUsed", [])
        if extension not in used:
            used.append(extension)

    def require(self, extension: str) -> None:
        """Name an extension among those without which the file cannot be read."""
        self.use(extension)
        required = self._json.setdefault("extensionsRequired", [])
        if extension not in required:
            required.append(extension)

    def _add_accessor(self, values: npt.NDArray[Any], target: int, *, bounded: bool = False) -> int:
        """Add the rows of an array, and return the index of the accessor that reads them."""
        accessor: dict[str, Any] = {
            "bufferView": self._add_rows(values, target),
            "componentType": _COMPONENTS[values.dtype.name],
            "count": len(values),
            "type": _TYPES[values.shape[1]],
        }
        if target == _VERTICES and values.dtype.kind in "iu" and not bounded:
            accessor["normalized"] = True
        if bounded:
            accessor["min"] = values.min(axis=0).tolist()
            accessor["max"] = values.max(axis=0).tolist()
        self._json["accessors"].append(accessor)
        return len(self._json["accessors"]) - 1

    def _add_rows(self, values: npt.NDArray[Any], target: int) -> int:
        """Add the rows of an array as a buffer view, compressed if the asset is."""
        padding = 0
        if target == _VERTICES:  # whose rows are a multiple of 4 bytes
            padding = -values.itemsize * values.shape[1] % 4 // values.itemsize
            values = np.pad(values, ((0, 0), (0, padding)))
        stride = values.itemsize * values.shape[1]
        if not self.is_compressed:
            fields = {"byteStride": stride} if padding else {}
            return self._add_view(values.tobytes(), target=target, **fields)
        code: dict[str, Any] = {"byteStride": stride, "count": len(values)}
        if target == _VERTICES:
            data, code["mode"] = encode_vertices(values), ATTRIBUTES
        else:
            data, code["mode"] = encode_triangles(values, int(values.max()) + 1), TRIANGLES
        view = {"buffer": 1, "byteOffset": self._n_plain, "byteLength": values.nbytes}
        if target == _VERTICES:
            view["byteStride"] = stride
        self._n_plain += values.nbytes + -values.nbytes % 4
        place = {"buffer": 0, "byteOffset": self._n_bytes, "byteLength": len(data)}
        self._add_bytes(data)
        extension = {EXTENSION: {**place, **code}}
        self._json["bufferViews"].append({**view, "target": target, "extensions": extension})
        return len(self._json["bufferViews"]) - 1

    def _add_view(self, data: bytes, **fields: Any) -> int:
        place = {"buffer": 0, "byteOffset": self._n_bytes, "byteLength": len(data)}
        self._add_bytes(data)
        self._json["bufferViews"].append({**place, **fields})
        return len(self._json["bufferViews"]) - 1

    def _add_bytes(self, data: bytes) -> None:
        padding = bytes(-len(data) % 4)  # everything begins at a multiple of its component's size
        self._parts += [data, padding]
        self._n_bytes += len(data) + len(padding)

    def _add_texture_file(self, path: PathLike) -> int:
        data, _ = image_file(path)
        return self.add_texture(data)

    def add_texture(
        self,
        data: bytes,
        *,
        wraps: tuple[str, str] = ("repeat", "repeat"),
        is_nearest: bool = False,
    ) -> int:
        """Add a texture, and return its index; one that is there already is not added again."""
        if data not in self._images:
            images = self._json.setdefault("images", [])
            self._images[data] = len(images)
            images.append({"bufferView": self._add_view(data), "mimeType": media_type(data)})
        source = self._images[data]
        sampler = {
            "magFilter": gltf.NEAREST if is_nearest else gltf.LINEAR,
            "minFilter": _NEAREST_MIPS if is_nearest else _TRILINEAR,
            "wrapS": _WRAPS[wraps[0]],
            "wrapT": _WRAPS[wraps[1]],
        }
        texture: dict[str, Any] = {"sampler": self._index("samplers", sampler)}
        extension = _IMAGE_EXTENSIONS.get(media_type(data) or "")
        if extension is None:
            texture["source"] = source
        else:
            self.require(extension)
            texture["extensions"] = {extension: {"source": source}}
        return self._index("textures", texture)

    def _index(self, kind: str, item: dict[str, Any]) -> int:
        """Index of an item of a list, which is added where it is not there."""
        items: list[dict[str, Any]] = self._json.setdefault(kind, [])
        if item not in items:
            items.append(item)
        return items.index(item)


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
) -> int:
    """Add a material with its textures, and return its index."""
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
    texture = asset.add_texture(image.data, wraps=image.wraps, is_nearest=image.is_nearest)
    info: dict[str, Any] = {"index": texture}
    if numbers[image.uv_set]:
        info["texCoord"] = numbers[image.uv_set]
    for where, source in slot.sources(material):
        if where.name == "normal" and source.factor[0] != 1.0:
            info["scale"] = source.factor[0]
        if where.name == "occlusion" and source.factor[0] != 1.0:
            info["strength"] = source.factor[0]
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
