"""A glTF asset in the making: its JSON and the parts of its buffer, written as one file.

With `compress` every view of vertices and indices is coded by `gltf_compression`. As the extension
demands, a reader without it is then pointed to a second buffer, which has no bytes.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

from texbake import __version__
from texbake.errors import FileFormatError
from texbake.files import PathLike, replacing
from texbake.mesh.files import gltf_document as gltf
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
    OCTAHEDRAL,
    TRIANGLES,
    encode_triangles,
    encode_vertices,
)
from texbake.mesh.mesh import AnyArray, Int64Array

_VERTICES, _INDICES = 34962, 34963  # targets of a buffer view
_COMPONENTS = {dtype.name: code for code, dtype in gltf.COMPONENTS.items()}
_MOST_SPARSE = 0.6  # share of rows that are not zero, up to which displacements are sparse
_NEAREST_MIPS, _TRILINEAR = 9984, 9987
_WRAPS = {name: code for code, name in gltf.WRAPS.items()}
# Images that glTF itself does not name, by the extensions that do.
_IMAGE_EXTENSIONS = {"image/webp": "EXT_texture_webp", "image/ktx2": "KHR_texture_basisu"}
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
# Columns of integers that are not fractions.
_WHOLE = ("POSITION", "JOINTS")
_OCTAHEDRAL_WIDTHS = {"NORMAL": 3, "TANGENT": 4}


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
        self._materials: dict[str, int] = {}  # indices by their text
        if compress:
            self.require(EXTENSION)

    def append_material(self, content: dict[str, Any]) -> int:
        """Add a material as glTF has it unless it is there, and return its index."""
        number = self._materials.setdefault(json.dumps(content), len(self._materials))
        if number == len(self._json["materials"]):
            self._json["materials"].append(content)
        return number

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
        self, columns: dict[str, AnyArray], indices: Int64Array, material: int
    ) -> dict[str, Any]:
        """Add the arrays of a primitive, with (3 F,) indices, and return it."""
        is_octahedral = "NORMAL" in columns and columns["NORMAL"].shape[1] == 4
        attributes = {
            attribute: self._add_accessor(
                values,
                _VERTICES,
                bounded=attribute == "POSITION",
                is_whole=attribute.partition("_")[0] in _WHOLE,
                width=_OCTAHEDRAL_WIDTHS.get(attribute) if is_octahedral else None,
            )
            for attribute, values in columns.items()
        }
        # The greatest index of a type restarts a primitive, so 65535 vertices fit 16 bits.
        index_type = np.uint16 if len(columns["POSITION"]) <= 65535 else np.uint32
        return {
            "attributes": attributes,
            "indices": self._add_accessor(indices.astype(index_type).reshape(-1, 1), _INDICES),
            "material": material,
        }

    def add_morph(self, columns: dict[str, AnyArray]) -> dict[str, int]:
        """Add the displacements (n, 3) of a morph target; sparse where many rows are zero."""
        return {name: self._add_displacements(name, rows) for name, rows in columns.items()}

    def _add_displacements(self, name: str, rows: AnyArray) -> int:
        bounded = name == "POSITION"
        moved = np.flatnonzero(rows.any(axis=1))
        if len(moved) > _MOST_SPARSE * len(rows):
            return self._add_accessor(rows, _VERTICES, bounded=bounded)
        moved = moved if len(moved) else np.zeros(1, np.intp)
        numbers = moved.astype(np.uint16 if len(rows) <= 65535 else np.uint32)
        component = _COMPONENTS[numbers.dtype.name]
        sparse = {
            "count": len(moved),
            "indices": {
                "bufferView": self._add_view(numbers.tobytes()), "componentType": component,
            },
            "values": {"bufferView": self._add_view(rows[moved].tobytes())},
        }  # fmt: skip
        return self._add_accessor(rows, _VERTICES, bounded=bounded, sparse=sparse)

    def add_array(self, rows: AnyArray, *, bounded: bool = False) -> int:
        """Add the rows of an array that are not vertices, uncompressed."""
        view = self._add_view(np.ascontiguousarray(rows).tobytes())
        return self._add_accessor(rows, 0, bounded=bounded, bufferView=view)

    def adopt(self, content: dict[str, Any]) -> None:
        """Replace lists of the asset, such as nodes and scenes."""
        self._json |= content

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

    def extend(self, extension: str, content: dict[str, Any]) -> None:
        """Add what an extension holds for the file as a whole."""
        self.use(extension)
        self._json.setdefault("extensions", {})[extension] = content

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

    def _add_accessor(
        self,
        values: AnyArray,
        target: int,
        *,
        bounded: bool = False,
        is_whole: bool = False,
        width: int | None = None,
        **source: Any,
    ) -> int:
        """Add the rows of an array, and return the index of the accessor that reads them.

        With a `width`, they are octahedral codes of directions of so many components.
        """
        rows = source or {
            "bufferView": self._add_rows(values, target, octahedral=width is not None)
        }
        accessor: dict[str, Any] = {
            **rows,
            "componentType": _COMPONENTS[values.dtype.name],
            "count": len(values),
            "type": _TYPES[width or values.shape[1]],
        }
        if target == _VERTICES and values.dtype.kind in "iu" and not is_whole:
            accessor["normalized"] = True
        if bounded:
            accessor["min"] = values.min(axis=0).tolist()
            accessor["max"] = values.max(axis=0).tolist()
        self._json["accessors"].append(accessor)
        return len(self._json["accessors"]) - 1

    def _add_rows(self, values: AnyArray, target: int, *, octahedral: bool = False) -> int:
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
            code |= {"filter": OCTAHEDRAL} if octahedral else {}
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
