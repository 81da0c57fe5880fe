"""Materials of a mesh from glTF files and to them, with all channels of `gltf_material_read`.

The factor of an occlusion is its strength: 1 + strength (texel - 1). That of a normal map is its
scale, which acts on x and y. A texture that cannot be read is noted, and the channel keeps its
factor.

glTF reads roughness from the green and metallic from the blue of one image, alpha from the image of
the base color. Other formats have an image for each channel; `texbake.texture.material_images` puts
these where glTF reads them. A channel without an image whose texture has one keeps its factor: the
image is taken to be 1 there, as that module makes it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any
from urllib.parse import unquote

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import OptionError, shortened
from texbake.files import PathLike
from texbake.mesh.files.channels import FILE_CHANNELS, FileChannel
from texbake.mesh.files.conversion import as_text, media_type
from texbake.mesh.files.gltf_asset import GltfAsset
from texbake.mesh.files.gltf_document import Document, read_document
from texbake.mesh.files.gltf_material_read import (
    EMISSIVE_STRENGTH,
    GltfSource,
    GltfTexture,
    image_or_reason,
    image_source,
    material_index,
    read_material,
    unread_extensions,
)
from texbake.mesh.files.gltf_nodes import scene_nodes, triangle_count
from texbake.mesh.files.gltf_primitives import primitive_uvs
from texbake.mesh.materials import (
    CHANNELS,
    UNPLACED,
    ChannelImage,
    ChannelSource,
    Materials,
    MeshMaterial,
    MissingParts,
    Placing,
    is_sheared,
)
from texbake.mesh.mesh import FloatArray, Mesh, require_few_sets

_TRANSFORM = "KHR_texture_transform"
# v down to v up, and back.
FLIP = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])


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
                found = document.objects(source, "primitives")
                of_meshes[index] = [item for item in found if triangle_count(document, item)]
            primitives += of_meshes[index]
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
    unread = Counter(part for index in order for part in unread_extensions(document, index))
    for part, n in unread.items():
        reader.missing.add("", f"{shortened(part)} of {n} material{'s' * (n > 1)} is not read")
    uv_sets = reader.uv_sets(materials, primitives, mesh)
    return Materials(
        face_materials=of_groups[mesh.face_groups],
        materials=tuple(material.on_uv_sets({0, *uv_sets}) for material in materials),
        uv_sets=uv_sets,
        has_vertex_colors=mesh.colors is not None,
        **reader.missing.fields(),
    )


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
        for where in FILE_CHANNELS.values():
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
        self, where: FileChannel, source: GltfSource, material: str
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
        self, where: FileChannel, texture: GltfTexture, material: str
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
        pm.matmul(pm.matmul(FLIP, np.array([*placing, (0.0, 0.0, 1.0)])), FLIP), stored
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


@dataclass(frozen=True)
class Slot:
    """A texture of glTF materials, and the channels that it holds."""

    owner: str
    texture: str
    channels: tuple[FileChannel, ...]

    def sources(self, material: MeshMaterial) -> Iterator[tuple[FileChannel, ChannelSource]]:
        """Yield where each channel of it comes from; the default, where the material is silent."""
        for where in self.channels:
            if where.name == "alpha" and material.alpha_mode == "opaque":
                continue
            default = ChannelSource(CHANNELS[where.name].default)
            yield where, material.channels.get(where.name, default)

    def image(self, material: MeshMaterial) -> ChannelImage | None:
        """Return the first image of its channels."""
        images = (source.image for _, source in self.sources(material))
        return next((image for image in images if image is not None), None)

    def holds(self, material: MeshMaterial) -> bool:
        """Whether glTF has the images of a material's channels, all in one and where it reads."""
        first = self.image(material)
        return first is None or (
            media_type(first.data) is not None
            and all(_is_read(where, source, first) for where, source in self.sources(material))
        )

    def fits(self, material: MeshMaterial) -> bool:
        """Whether glTF also shows the channels that have no image as the material does.

        It would multiply them by what the image holds.
        """
        alone = (source for _, source in self.sources(material) if source.image is None)
        has_image = self.image(material) is not None
        return self.holds(material) and not (has_image and any(any(s.factor) for s in alone))


def _is_read(where: FileChannel, source: ChannelSource, first: ChannelImage) -> bool:
    """Whether glTF reads the image of a channel, if it has one, as the material does."""
    if source.image is None:
        return True
    if source.image.components != where.components or not same_place(source.image, first):
        return False
    return where.name != "normal" or is_scale(source.factor)


def is_scale(factor: tuple[float, ...]) -> bool:
    """Whether a factor of normals is a scale of glTF, which acts on x and y alike."""
    return factor == (factor[0], factor[0], 1.0)


def same_place(a: ChannelImage, b: ChannelImage) -> bool:
    """Whether two channels read an image file at the same places."""
    common = {"components": (), "name": ""}
    return replace(a, **common) == replace(b, **common)  # type: ignore[arg-type]


SLOTS = tuple(
    Slot(owner, texture, tuple(channels))
    for (owner, texture), channels in groupby(
        FILE_CHANNELS.values(), key=lambda channel: (channel.owner, channel.texture)
    )
)
