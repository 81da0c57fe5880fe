"""Materials of the faces of a mesh that comes from a glTF file.

The factor of an occlusion is its strength: 1 + strength (texel - 1). That of a normal map is its
scale, which acts on x and y. A texture that cannot be read is noted, and the channel keeps its
factor. Extensions that texbake does not know better are carried along, as they are.

Based on: Khronos Group, KHR_materials_anisotropy, KHR_materials_diffuse_transmission,
KHR_materials_dispersion, KHR_materials_ior, KHR_materials_iridescence and KHR_materials_volume.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import field, replace
from typing import Any
from urllib.parse import unquote

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, shortened
from texbake.files import PathLike
from texbake.mesh.files.channels import FILE_CHANNELS, FileChannel
from texbake.mesh.files.conversion import as_text, media_type
from texbake.mesh.files.gltf import indices, scene_nodes
from texbake.mesh.files.gltf_document import FLIP, Document, read_document
from texbake.mesh.files.gltf_materials import (
    OF_TEXTURE,
    GltfSource,
    GltfTexture,
    image_or_reason,
    image_source,
    material_index,
    read_material,
    read_texture,
    unread_extensions,
)
from texbake.mesh.files.gltf_primitives import primitive_uvs, triangle_count
from texbake.mesh.materials import (
    ChannelImage,
    ChannelSource,
    Materials,
    MeshMaterial,
    MissingParts,
    Placing,
    materials_by_face,
)
from texbake.mesh.mesh import FloatArray, Mesh, require_few_sets
from texbake.records import dataclass

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


_MOST_VARIANTS = 256


def read_gltf_materials(path: PathLike, mesh: Mesh) -> Materials | None:
    """Read the materials of a glTF file; None where no primitive has one, nor vertex colors."""
    document = read_document(path)
    # The groups of the mesh are its primitives, in this order.
    of_meshes: dict[int, list[dict[str, Any]]] = {}
    primitives: list[dict[str, Any]] = []
    for node in scene_nodes(document).nodes:
        if "mesh" in node:
            source, index = document.item("meshes", node["mesh"]), node["mesh"]
            if index not in of_meshes:
                items = document.objects(source, "primitives")
                of_meshes[index] = [item for item in items if triangle_count(document, item)]
            primitives += of_meshes[index]
    reader = _MaterialReader(document)
    names = _variant_names(reader)
    rows: dict[int, tuple[int | None, ...]] = {}
    same: dict[tuple[int | None, ...], tuple[int | None, ...]] = {}  # each row once in memory
    for primitive in primitives:
        if id(primitive) not in rows:
            row = _shown_materials(reader, primitive, len(names))
            rows[id(primitive)] = same.setdefault(row, row)
    found = materials_by_face(mesh, [rows[id(primitive)] for primitive in primitives])
    if found is None or (all(set(shown) == {None} for shown in same) and mesh.colors is None):
        return None
    shown, face_materials = found
    order = [default for default, *_ in shown]
    order += sorted({i for _, *others in shown for i in others if i is not None} - set(order))
    places = {index: place for place, index in reversed(list(enumerate(order)))}
    of_others = range(len(shown), len(order))
    variants = tuple(
        (name, (*(places[row[1 + k]] for row in shown), *of_others)) for k, name in enumerate(names)
    )
    on_all_sets = Materials(
        face_materials=face_materials,
        materials=tuple(reader.material(index) for index in order),
        has_vertex_colors=mesh.colors is not None,
        variants=variants,
    )
    unread = Counter(
        part
        for index in dict.fromkeys(order)
        for part in unread_extensions(document, index)
        if part not in CARRIED
    )
    for part, n in unread.items():
        reader.missing.add("", f"{shortened(part)} of {n} material{'s' * (n > 1)} is not read")
    uv_sets = reader.uv_sets(on_all_sets.image_uv_sets - {0}, primitives, mesh)
    materials = tuple(material.on_uv_sets({0, *uv_sets}) for material in on_all_sets.materials)
    return replace(on_all_sets, materials=materials, uv_sets=uv_sets, **reader.missing.fields())


def _variant_names(reader: _MaterialReader) -> list[str]:
    """Names of the variants of a file."""
    document, items = reader.document, []
    try:
        extensions = document.mapping(document.content, "extensions")
        items = document.objects(document.mapping(extensions, VARIANTS), "variants")
    except FileFormatError as error:
        reader.missing.add("", f"variants are not read: {error}")
    if len(items) > _MOST_VARIANTS:
        reader.missing.add("", f"{_MOST_VARIANTS} of {len(items):,} variants are read")
    named = enumerate(items[:_MOST_VARIANTS])
    return [as_text(str(item.get("name") or f"variant {i}")) for i, item in named]


def _shown_materials(
    reader: _MaterialReader, primitive: dict[str, Any], n_variants: int
) -> tuple[int | None, ...]:
    """Indices of a primitive's materials: by default, and in each variant."""
    document = reader.document
    shown = [material_index(document, primitive)] * (1 + n_variants)
    try:
        extensions = document.mapping(primitive, "extensions")
        for mapping in document.objects(document.mapping(extensions, VARIANTS), "mappings"):
            index = document.integer(mapping, "material")
            document.item("materials", index)
            for number in indices(document, mapping, "variants"):
                if 0 <= number < n_variants:
                    shown[1 + number] = index
    except FileFormatError as error:
        reader.missing.add("", f"materials of variants are not read: {error}")
    return tuple(shown)


@dataclass(eq=False)
class _MaterialReader:
    """Reads the materials of a document, each image once."""

    document: Document
    missing: MissingParts = field(default_factory=MissingParts)
    # Content, or why there is none, and index of the first image that is read from a source.
    _images: dict[str | int | None, tuple[bytes | str, int | None]] = field(default_factory=dict)

    def material(self, index: int | None) -> MeshMaterial:
        """Read the material with an index; None means glTF's default material."""
        material = read_material(self.document, index)
        channels = {}
        for name, part in material.channels.items():
            if name == "alpha" and material.alpha_mode == "opaque":
                continue
            source = self._source(FILE_CHANNELS[name], part, material.name)
            if source is not None:
                channels[name] = source
        content = {} if index is None else self.document.item("materials", index)
        extensions = self.document.mapping(content, "extensions")

        def image_of(key: str, texture: GltfTexture) -> ChannelImage | None:
            image = self._image(key, (0, 1, 2), texture, material.name)
            return None if image is None or media_type(image.data) is None else image

        return MeshMaterial(
            name=material.name,
            channels=channels,
            extensions=read_extensions(self.document, extensions, image_of),
            alpha_mode=material.alpha_mode,
            alpha_cutoff=material.alpha_cutoff,
            is_double_sided=material.is_double_sided,
            is_unlit=material.is_unlit,
        )

    def uv_sets(
        self, numbers: set[int], primitives: list[dict[str, Any]], mesh: Mesh
    ) -> dict[int, FloatArray]:
        """Read sets of texture coordinates after the first."""
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
                line = f"the mesh has no TEXCOORD_0; images on TEXCOORD_{number} are left out"
                self.missing.add("", line)
                continue
            sets[number] = np.concatenate(
                [
                    np.zeros((length, 2)) if row is None or len(row) != length else row
                    for row, length in zip(rows, lengths, strict=True)
                ]
            )
        return sets

    def _source(
        self, where: FileChannel, source: GltfSource, material: str
    ) -> ChannelSource | None:
        """Return where a channel comes from; None where it changes nothing."""
        texture, factor = source.texture, source.factor
        image = (
            None
            if texture is None
            else self._image(where.name, where.components, texture, material)
        )
        if image is None and where.name in OF_TEXTURE:
            return None
        if where.name == "normal":
            return ChannelSource((*factor, *factor, 1.0), image)
        if where.name == "occlusion":
            return ChannelSource(factor, image, 1.0 - factor[0])
        return (
            None if where.name == "emissive" and not any(factor) else ChannelSource(factor, image)
        )

    def _image(
        self, channel: str, components: tuple[int, ...], texture: GltfTexture, material: str
    ) -> ChannelImage | None:
        """Read the image of a texture; None, and a note, where it is missing."""
        index = texture.image
        source = None if index is None else image_source(self.document, index)
        if source not in self._images:
            self._images[source] = image_or_reason(self.document, index), index
        data, first = self._images[source]
        if isinstance(data, str):
            line = f"{shortened(material)}: {data}; the material keeps its factors"
            uri = None if index is None else self.document.items("images")[index].get("uri")
            named = unquote(uri) if isinstance(uri, str) and not uri.startswith("data:") else None
            self.missing.add(channel, line, image=named)
            return None
        return ChannelImage(
            data=data,
            name=f"{self.document.path}: images[{first}]",
            components=components,
            wraps=texture.wraps,
            placing=_placing(texture),
            uv_set=texture.uv_set,
            is_nearest=texture.is_nearest,
        )


def _placing(texture: GltfTexture) -> Placing:
    """Rows of the matrix of a texture's transform, for coordinates with v up."""
    sin, cos = pm.sin(texture.rotation), pm.cos(texture.rotation)
    matrix: FloatArray = np.eye(3)
    matrix[:2, :2] = np.array([[cos, sin], [-sin, cos]]) * texture.scale
    matrix[:2, 2] = texture.offset
    (a, b, c), (d, e, f), _ = (pm.matmul(pm.matmul(FLIP, matrix), FLIP)).tolist()
    return (a, b, c), (d, e, f)
