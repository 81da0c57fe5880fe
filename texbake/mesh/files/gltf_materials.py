"""Materials of glTF files, as those of a mesh, with every channel that `gltf_channels` lists.

The factor of an occlusion is its strength: 1 + strength (texel - 1). That of a normal map is its
scale, which acts on x and y. A texture that cannot be read is noted, and the channel keeps its
factor.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import unquote

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import shortened
from texbake.files import PathLike
from texbake.mesh.files.gltf_channels import GLTF_CHANNELS, GltfChannel
from texbake.mesh.files.gltf_document import Document, read_document
from texbake.mesh.files.gltf_material_read import (
    GltfSource,
    GltfTexture,
    image_or_reason,
    image_source,
    material_index,
    read_material,
    unread_parts,
)
from texbake.mesh.files.gltf_nodes import placed_nodes, triangle_count
from texbake.mesh.files.gltf_primitives import primitive_uvs
from texbake.mesh.materials import (
    ChannelImage,
    ChannelSource,
    Materials,
    MeshMaterial,
    MissingParts,
    Placing,
)
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.uv_sets import require_few_sets

# v down to v up, and back.
FLIP = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])


def read_gltf_materials(path: PathLike, mesh: Mesh) -> Materials | None:
    """Read the materials of a glTF file; None where no primitive has one, nor vertex colors."""
    document = read_document(path)
    # The groups of the mesh are its primitives, in this order.
    of_meshes: dict[int, list[dict[str, Any]]] = {}
    primitives: list[dict[str, Any]] = []
    for node in placed_nodes(document).nodes:
        if "mesh" in node:
            primitives += _primitives(document, node["mesh"], of_meshes)
    used = [material_index(document, primitive) for primitive in primitives]
    if mesh.face_groups is None or len(used) != len(mesh.group_names):
        return None
    if all(index is None for index in used) and mesh.colors is None:
        return None
    order = list(dict.fromkeys(used))
    numbers = {index: i for i, index in enumerate(order)}
    of_groups = np.array([numbers[index] for index in used], dtype=np.int32)
    reader = _MaterialReader(document)
    materials = tuple(reader.material(index) for index in order)
    unread = Counter(part for index in order for part in unread_parts(document, index))
    for part, n in unread.items():
        reader.missing.add("", f"{shortened(part)} of {n} material{'s' * (n > 1)} is not read")
    uv_sets = reader.uv_sets(materials, primitives, mesh)
    return Materials(
        face_materials=of_groups[mesh.face_groups],
        materials=tuple(material.on_uv_sets({0, *uv_sets}) for material in materials),
        uv_sets=uv_sets,
        has_vertex_colors=mesh.colors is not None,
        missing=tuple(reader.missing.lines),
        missing_images=tuple(reader.missing.images),
    )


def _primitives(
    document: Document, index: Any, known: dict[int, list[dict[str, Any]]]
) -> list[dict[str, Any]]:
    """Return the primitives of a mesh that have triangles; `known` has those of other meshes."""
    mesh = document.item("meshes", index)
    if index not in known:
        primitives = document.objects(mesh, "primitives")
        known[index] = [item for item in primitives if triangle_count(document, item)]
    return known[index]


@dataclass(eq=False)
class _MaterialReader:
    """Reads the materials of a document, each image once.

    Attributes
    ----------
    missing : MissingParts
        What could not be read.
    """

    document: Document
    missing: MissingParts = field(default_factory=MissingParts)
    # Content, or why there is none, and index of the first image that is read from a source.
    _images: dict[str | int | None, tuple[bytes | str, int | None]] = field(default_factory=dict)

    def material(self, index: int | None) -> MeshMaterial:
        """Read the material with an index; None means glTF's default material."""
        material = read_material(self.document, index)
        channels = {}
        for where in GLTF_CHANNELS:
            if where.name == "alpha" and material.alpha_mode == "opaque":
                continue
            if where.name in material.channels:
                source = self._source(where, material.channels[where.name], material.name)
                if source is not None:
                    channels[where.name] = source
        return MeshMaterial(
            name=material.name,
            channels=channels,
            alpha_mode=material.alpha_mode,
            alpha_cutoff=material.alpha_cutoff,
            is_double_sided=material.is_double_sided,
            is_unlit=material.is_unlit,
        )

    def uv_sets(
        self, materials: tuple[MeshMaterial, ...], primitives: list[dict[str, Any]], mesh: Mesh
    ) -> dict[int, FloatArray]:
        """Read the sets of texture coordinates after the first that images lie on."""
        numbers = {
            source.image.uv_set
            for material in materials
            for source in material.channels.values()
            if source.image is not None
        } - {0}
        require_few_sets(len(numbers), str(self.document.path))
        if not numbers:
            return {}
        firsts = [primitive_uvs(self.document, primitive, 0) for primitive in primitives]
        # Where only some primitives have the first set, the others have one row of it.
        lengths = [1 if first is None else len(first) for first in firsts]
        sets = {}
        for number in sorted(numbers):
            rows = [primitive_uvs(self.document, primitive, number) for primitive in primitives]
            if mesh.uvs is None or sum(lengths) != len(mesh.uvs):
                line = f"images lie on TEXCOORD_{number}, and the mesh has no TEXCOORD_0"
                self.missing.add("", f"{line}; they are left out")
                continue
            sets[number] = np.concatenate(
                [
                    np.zeros((length, 2)) if row is None or len(row) != length else row
                    for row, length in zip(rows, lengths, strict=True)
                ]
            )
        return sets

    def _source(
        self, where: GltfChannel, source: GltfSource, material: str
    ) -> ChannelSource | None:
        """Return where a channel comes from; None where it changes nothing."""
        image = None
        if source.texture is not None:
            image = self._image(where, source.texture, material)
        if where.name in ("normal", "occlusion"):
            if image is None:
                return None
            (factor,) = source.factor
            if where.name == "normal":
                return ChannelSource((factor, factor, 1.0), image)
            return ChannelSource((factor,), image, 1.0 - factor)
        if where.name == "emissive" and not any(source.factor):
            return None
        return ChannelSource(source.factor, image)

    def _image(
        self, where: GltfChannel, texture: GltfTexture, material: str
    ) -> ChannelImage | None:
        """Read the image of a texture; None, and a note, where it is missing."""
        index = texture.image
        source = None if index is None else image_source(self.document, index)
        if source not in self._images:
            self._images[source] = image_or_reason(self.document, index), index
        data, first = self._images[source]
        if isinstance(data, str):
            line = f"{shortened(material)}: {data}; the material keeps its factors"
            self.missing.add(where.name, line, image=self._image_name(index))
            return None
        return ChannelImage(
            data=data,
            name=f"{self.document.path}: images[{first}]",
            components=where.components,
            wraps=texture.wraps,
            placing=_placing(texture),
            uv_set=texture.uv_set,
            is_nearest=texture.is_nearest,
        )

    def _image_name(self, index: int | None) -> str | None:
        """Name of the file of an image; None where it has none of its own."""
        uri = None if index is None else self.document.items("images")[index].get("uri")
        return unquote(uri) if isinstance(uri, str) and not uri.startswith("data:") else None


def _placing(texture: GltfTexture) -> Placing:
    """Rows of the matrix of a texture's transform, for coordinates with v up."""
    sin, cos = pm.sin(texture.rotation), pm.cos(texture.rotation)
    matrix: FloatArray = np.eye(3)
    matrix[:2, :2] = np.array([[cos, sin], [-sin, cos]]) * texture.scale
    matrix[:2, 2] = texture.offset
    (a, b, c), (d, e, f), _ = (pm.matmul(pm.matmul(FLIP, matrix), FLIP)).tolist()
    return (a, b, c), (d, e, f)
