"""Writing binary glTF 2.0: one primitive a group, with tangents and textures, ready for a renderer.

Corners become vertices of a GPU stream: those of a group that agree, bit for bit, in all attributes
are one vertex. Triangles keep their order. The format has no place for names of primitives, so each
group is a mesh and a node of its name.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake import __version__
from texbake.errors import FileError, FileFormatError, MeshError, OptionError, UvError
from texbake.files import PathLike, replacing
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.normals import shading_normals
from texbake.mesh.tangents import corner_tangents
from texbake.mesh.weld import weld_rows
from texbake.metadata import CONVENTION, SPACE, from_description
from texbake.png import SIGNATURE, png_description

_JPEG_START = b"\xff\xd8\xff"
_VERTICES, _INDICES = 34962, 34963  # what a buffer view is bound to
_FLOAT, _UINT16, _UINT32 = 5126, 5123, 5125
_REPEAT, _LINEAR, _TRILINEAR = 10497, 9729, 9987
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
# Distance from the origin, in diagonals, from which on float32 would lose more than 13 of its 24
# bits to it: the node then carries the place, and positions are about it.
_FAR = 8192.0

FloatColumns = npt.NDArray[np.float32]


def write_glb(
    mesh: Mesh,
    path: PathLike,
    *,
    normal_map: PathLike | None = None,
    base_color: PathLike | Sequence[float] | None = None,
    name: str | None = None,
) -> None:
    """Write a mesh as binary glTF, textures embedded as they are.

    Parameters
    ----------
    mesh
        Its shading normals are written; with texture coordinates also the tangents it has, else
        those of MikkTSpace. A corner without a normal gets (0, 0, 1), one without a tangent some
        unit vector perpendicular to its normal.
    normal_map
        PNG or JPEG file, in tangent space, +Y.
    base_color
        PNG or JPEG file in sRGB, or three or four linear factors in [0, 1].
    name
        Of the mesh and the material; by default that of the file.

    Raises
    ------
    UvError
        A texture is given, and the mesh has no texture coordinates.
    OptionError
        A texture is neither PNG nor JPEG, the normal map says that it is in another space or
        convention, or a factor is out of range.
    MeshError
        A coordinate is beyond the float32 that the format holds.
    FileError
        A texture cannot be read, or the file cannot be written.
    FileFormatError
        A texture is damaged, or the file would pass the 4 GiB that the format allows.
    """
    if mesh.uvs is None and (normal_map is not None or isinstance(base_color, str | os.PathLike)):
        raise UvError(
            f"{mesh.name}: it has no texture coordinates, which a texture needs; "
            f"make some with: texbake unwrap {mesh.name} -o OUT"
        )
    name = Path(path).stem if name is None else name
    asset = _Asset()
    asset.add_material(name, normal_map, base_color)
    origin = _far_origin(mesh)
    with np.errstate(over="ignore"):
        for group, columns in _groups(mesh, name, origin):
            if not all(np.isfinite(values).all() for values in columns.values()):
                raise MeshError(f"{mesh.name}: a coordinate is beyond float32; scale it down first")
            asset.add_group(group, columns, origin)
    asset.write(path)


class _Asset:
    """The JSON of an asset and the parts of its buffer, grown together."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._n_bytes = 0
        self._json: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": f"texbake {__version__}"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            **{kind: [] for kind in ("nodes", "meshes", "materials", "accessors", "bufferViews")},
        }

    def add_material(
        self,
        name: str,
        normal_map: PathLike | None,
        base_color: PathLike | Sequence[float] | None,
    ) -> None:
        """Add the material that all groups share, with its textures."""
        surface: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 0.5}
        material = {"name": _text(name), "pbrMetallicRoughness": surface}
        if normal_map is not None:
            _check_normal_map(normal_map)
            material["normalTexture"] = {"index": self._add_texture(normal_map)}
        if isinstance(base_color, str | os.PathLike):
            surface["baseColorTexture"] = {"index": self._add_texture(base_color)}
        elif base_color is not None:
            surface["baseColorFactor"] = _factors(base_color)
        self._json["materials"].append(material)

    def add_group(self, name: str, columns: dict[str, FloatColumns], origin: FloatArray) -> None:
        """Add a mesh of one primitive; `columns` hold each attribute at each corner."""
        firsts = weld_rows(np.concatenate(list(columns.values()), axis=1))
        kept, indices = np.unique(firsts, return_inverse=True)
        attributes = {
            attribute: self._add_accessor(values[kept], _VERTICES, bounded=attribute == "POSITION")
            for attribute, values in columns.items()
        }
        # The greatest index of a type restarts a primitive, so 65535 vertices fit 16 bits.
        index_type = np.uint16 if len(kept) <= 65535 else np.uint32
        primitive = {
            "attributes": attributes,
            "indices": self._add_accessor(indices.astype(index_type).reshape(-1, 1), _INDICES),
            "material": 0,
        }
        node: dict[str, Any] = {"name": _text(name), "mesh": len(self._json["meshes"])}
        if origin.any():
            node["translation"] = origin.tolist()
        self._json["scenes"][0]["nodes"].append(len(self._json["nodes"]))
        self._json["nodes"].append(node)
        self._json["meshes"].append({"name": _text(name), "primitives": [primitive]})

    def write(self, path: PathLike) -> None:
        """Write the file, whole or not at all."""
        content = {**self._json, "buffers": [{"byteLength": self._n_bytes}]}
        text = json.dumps(content, separators=(",", ":")).encode("ascii")
        text += b" " * (-len(text) % 4)
        n_bytes = 12 + 8 + len(text) + 8 + self._n_bytes
        if n_bytes >= 1 << 32:
            raise FileFormatError(f"{path}: {n_bytes} bytes are more than a GLB holds; simplify it")
        with replacing(path) as temporary, temporary.open("wb") as file:
            file.write(struct.pack("<4sIIII", b"glTF", 2, n_bytes, len(text), 0x4E4F534A))
            file.write(text)
            file.write(struct.pack("<II", self._n_bytes, 0x004E4942))
            file.writelines(self._parts)

    def _add_accessor(self, values: npt.NDArray[Any], target: int, *, bounded: bool = False) -> int:
        """Add the rows of an array, and return the index of the accessor that reads them."""
        component = {"float32": _FLOAT, "uint16": _UINT16, "uint32": _UINT32}[values.dtype.name]
        accessor: dict[str, Any] = {
            "bufferView": self._add_view(values.tobytes(), target),
            "componentType": component,
            "count": len(values),
            "type": _TYPES[values.shape[1]],
        }
        if bounded:
            accessor["min"] = values.min(axis=0).tolist()
            accessor["max"] = values.max(axis=0).tolist()
        self._json["accessors"].append(accessor)
        return len(self._json["accessors"]) - 1

    def _add_view(self, data: bytes, target: int | None = None) -> int:
        view = {"buffer": 0, "byteOffset": self._n_bytes, "byteLength": len(data)}
        self._json["bufferViews"].append(view if target is None else {**view, "target": target})
        padding = bytes(-len(data) % 4)  # everything begins at a multiple of its component's size
        self._parts += [data, padding]
        self._n_bytes += len(data) + len(padding)
        return len(self._json["bufferViews"]) - 1

    def _add_texture(self, path: PathLike) -> int:
        data, media_type = _image_file(path)
        images = self._json.setdefault("images", [])
        images.append({"bufferView": self._add_view(data), "mimeType": media_type})
        sampler = {
            "magFilter": _LINEAR,
            "minFilter": _TRILINEAR,
            "wrapS": _REPEAT,
            "wrapT": _REPEAT,
        }
        self._json["samplers"] = [sampler]
        textures = self._json.setdefault("textures", [])
        textures.append({"sampler": 0, "source": len(images) - 1})
        return len(textures) - 1


def _groups(
    mesh: Mesh, name: str, origin: FloatArray
) -> Iterator[tuple[str, dict[str, FloatColumns]]]:
    """Name of each group that has faces, and its attributes at each corner, (3 F, width)."""
    normals, normal_faces = shading_normals(mesh)
    unit_normals = _unit(normals, np.array([[0.0, 0.0, 1.0]]))
    tangents = None
    if mesh.uvs is not None:
        tangents = corner_tangents(mesh) if mesh.tangents is None else mesh.tangents
    groups = np.zeros(mesh.n_faces, np.int32) if mesh.face_groups is None else mesh.face_groups
    names = mesh.group_names if mesh.face_groups is not None else (name,)
    order = np.argsort(groups, kind="stable")
    ends = np.cumsum(np.bincount(groups, minlength=len(names)))
    for group, faces in zip(names, np.split(order, ends[:-1]), strict=True):
        if len(faces) == 0:
            continue
        vertices = mesh.faces[faces].ravel()
        columns = {"POSITION": (mesh.positions[vertices] - origin).astype(np.float32)}
        columns["NORMAL"] = unit_normals[normal_faces[faces].ravel()].astype(np.float32)
        if mesh.uvs is not None and mesh.uv_faces is not None and tangents is not None:
            uvs = mesh.uvs[mesh.uv_faces[faces].ravel()]
            columns["TEXCOORD_0"] = np.stack([uvs[:, 0], 1.0 - uvs[:, 1]], 1).astype(np.float32)
            columns["TANGENT"] = _sound_tangents(
                tangents[faces].reshape(-1, 4), columns["NORMAL"].astype(np.float64)
            )
        if mesh.colors is not None and mesh.colors.shape[1] in (3, 4):
            columns["COLOR_0"] = np.clip(mesh.colors[vertices], 0.0, 1.0)
        yield group, columns


def _sound_tangents(tangents: npt.NDArray[np.float32], normals: FloatArray) -> FloatColumns:
    """Unit tangents with w of 1 or -1; where there is none, some perpendicular to the normal."""
    # The coordinate axis that is least along the normal spans a plane with it.
    axes = np.eye(3)[np.abs(normals).argmin(axis=1)]
    perpendicular = _unit(np.cross(axes, normals), axes)
    directions = _unit(tangents[:, :3].astype(np.float64), perpendicular)
    signs = np.where(tangents[:, 3:] < 0.0, -1.0, 1.0)
    return np.concatenate([directions, signs], axis=1).astype(np.float32)


def _unit(vectors: FloatArray, instead: FloatArray) -> FloatArray:
    """Vectors of length 1; the rows of `instead` where there is no direction."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    # 1e-6: what float32 leaves of a unit vector, which stays as it is, bit for bit.
    divisors = np.where((np.abs(lengths - 1.0) <= 1e-6) | (lengths == 0.0), 1.0, lengths)
    unit: FloatArray = np.where(lengths > 0.0, vectors / divisors, instead)
    return unit


def _far_origin(mesh: Mesh) -> FloatArray:
    """Place that the nodes carry: the origin, unless the mesh is far from it for its size."""
    bounds = mesh.bounds
    if np.abs(bounds).max() <= _FAR * mesh.diagonal:
        return np.zeros(3)
    center: FloatArray = (0.5 * bounds).sum(axis=0)
    return center


def _image_file(path: PathLike) -> tuple[bytes, str]:
    """Bytes of a PNG or JPEG file, and its media type."""
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror or error}") from error
    if data.startswith(SIGNATURE):
        png_description(path)  # raises where it is damaged
        return data, "image/png"
    if data.startswith(_JPEG_START):
        return data, "image/jpeg"
    raise OptionError(f"{path}: a GLB embeds PNG or JPEG images alone; save it as PNG")


def _check_normal_map(path: PathLike) -> None:
    """Raise `OptionError` for a normal map that says it is not in tangent space with +Y."""
    _, media_type = _image_file(path)
    if media_type != "image/png":
        return
    facts = from_description(png_description(path))
    if facts.get(SPACE, "tangent") != "tangent":
        raise OptionError(
            f"{path}: it is in {facts[SPACE]} space; glTF needs a map baked with --space tangent"
        )
    if facts.get(CONVENTION, "opengl") != "opengl":
        raise OptionError(
            f"{path}: its green channel is {facts[CONVENTION]}; "
            "glTF needs a map baked with --convention opengl"
        )


def _factors(base_color: Sequence[float]) -> list[float]:
    factors = [float(factor) for factor in base_color]
    if len(factors) not in (3, 4) or not all(0.0 <= factor <= 1.0 for factor in factors):
        raise OptionError(f"base_color: {factors} are not three or four factors between 0 and 1")
    return factors if len(factors) == 4 else [*factors, 1.0]


def _text(name: str) -> str:
    """Return a name that UTF-8 can hold."""
    return name.encode("utf-8", "replace").decode("utf-8")
