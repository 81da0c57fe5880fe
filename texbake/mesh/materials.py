"""Materials of a mesh, channel by channel, as its file gives them.

A channel is what a shading model reads at a point of the surface: a base color, a roughness, a
normal. Each is a factor, times an image where there is one. The channels are those of glTF; other
formats are read into them.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021, section 3.9, and its
extensions KHR_materials_clearcoat, KHR_materials_emissive_strength, KHR_materials_sheen,
KHR_materials_specular and KHR_materials_transmission.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import field, replace
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import MeshError, first_few, warn_of
from texbake.files import PathLike
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import (
    BoolArray,
    Float32Array,
    FloatArray,
    IndexArray,
    IntArray,
    Mesh,
    frozen,
)
from texbake.records import dataclass

# Rows of a matrix that takes (u, v, 1) to (u, v) of an image.
Placing = tuple[tuple[float, float, float], tuple[float, float, float]]
UNPLACED: Placing = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
# What rounding leaves of axes that are perpendicular, as a cosine.
_SQUARE = 1e-6


def is_sheared(placing: Placing) -> bool:
    """Whether a matrix does more than scale along u and v, turn and move."""
    (a, b, _), (c, d, _) = placing
    return abs(a * b + c * d) > _SQUARE * pm.hypot(a, c) * pm.hypot(b, d)


@dataclass(frozen=True)
class Channel:
    """A quantity that materials have at each point of a surface."""

    name: str
    default: tuple[float, ...]  # of a material that does not set it: one number, or three
    is_color: bool = False  # whether 8-bit images of it are coded in sRGB
    is_bounded: bool = True  # whether its values lie in [0, 1]


_CHANNELS = (
    Channel("base-color", (1.0, 1.0, 1.0), is_color=True),
    Channel("alpha", (1.0,)),
    Channel("metallic", (0.0,)),
    Channel("roughness", (1.0,)),
    Channel("occlusion", (1.0,)),
    Channel("emissive", (0.0, 0.0, 0.0), is_color=True, is_bounded=False),
    Channel("normal", (0.0, 0.0, 1.0), is_bounded=False),
    Channel("clearcoat", (0.0,)),
    Channel("clearcoat-roughness", (0.0,)),
    Channel("transmission", (0.0,)),
    Channel("sheen-color", (0.0, 0.0, 0.0), is_color=True),
    Channel("sheen-roughness", (0.0,)),
    Channel("specular", (1.0,)),
    Channel("specular-color", (1.0, 1.0, 1.0), is_color=True, is_bounded=False),
)
CHANNELS: Mapping[str, Channel] = MappingProxyType({channel.name: channel for channel in _CHANNELS})


@dataclass(frozen=True)
class ChannelImage:
    """What a channel reads of an image."""

    data: bytes = field(repr=False)  # the content of an image file
    name: str = "image"  # Its name in messages. Images of one name are the same.
    # components of a texel, counted from red, one for each number of the channel
    components: tuple[int, ...] = (0, 1, 2)
    # what lies outside the unit square along u and v: `repeat`, `mirror` or `clamp`
    wraps: tuple[str, str] = ("repeat", "repeat")
    placing: Placing = UNPLACED  # texture coordinates of the mesh, v up, to those of the image
    uv_set: int = 0  # which set of texture coordinates of the mesh; 0 is `Mesh.uvs`
    is_nearest: bool = False  # whether a texel is one color up to its edges, as in pixel art


class SurfaceSampler(Protocol):
    """Computes values of one or several channels at points of a surface."""

    def at(self, points: FloatArray, normals: FloatArray) -> Mapping[str, Float32Array]:
        """Return linear values (n, C) of each channel at points (n, 3) in model units."""


@dataclass(frozen=True)
class ChannelSource:
    """Where the values of a channel come from: factor times image plus offset, or a sampler."""

    # Linear, as many numbers as the channel has. For `normal` it scales the vector that the image
    # encodes.
    factor: tuple[float, ...]
    # linear once decoded; 1 without one, and (0, 0, 1) for `normal`
    image: ChannelImage | None = None
    # Added to the product. It is that of an occlusion whose strength is less than 1.
    offset: float = 0.0
    # factor if the image turns out to be damaged; by default `factor`
    fallback: tuple[float, ...] | None = field(default=None, compare=False, repr=False)
    sampler: SurfaceSampler | None = None  # computes the values instead


@dataclass(frozen=True, kw_only=True)
class MeshMaterial:
    """A material of a mesh file."""

    name: str
    # by names of `CHANNELS`; those that the file does not set are missing
    channels: Mapping[str, ChannelSource] = field(default_factory=dict)
    # `opaque`, `mask` (opaque where alpha is at least `alpha_cutoff`, else not there) or `blend`
    alpha_mode: str = "opaque"
    alpha_cutoff: float = 0.5
    is_double_sided: bool = False
    is_unlit: bool = False  # shown in its base color, whatever the light
    # Properties of glTF extensions that texbake carries along, by name; textures as `ChannelImage`.
    extensions: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def is_opaque(self) -> bool:
        """Whether nothing is seen through it, whatever its images show."""
        source = self.channels.get("transmission")
        return self.alpha_mode == "opaque" and (source is None or not any(source.factor))

    @property
    def images(self) -> tuple[ChannelImage, ...]:
        """Images of its channels and extensions."""
        channels = (s.image for s in self.channels.values() if s.image is not None)
        values = (v for extension in self.extensions.values() for v in extension.values())
        return (*channels, *(v for v in values if isinstance(v, ChannelImage)))

    @property
    def has_images(self) -> bool:
        """Whether any channel is read from an image."""
        return any(source.image is not None for source in self.channels.values())

    def on_uv_sets(self, uv_sets: Collection[int]) -> MeshMaterial:
        """Return the material without the images that lie on other texture coordinates."""
        channels = {}
        for name, source in self.channels.items():
            if source.image is None or source.image.uv_set in uv_sets:
                channels[name] = source
            elif name not in ("normal", "occlusion", "emissive"):  # whose factors may be white
                channels[name] = ChannelSource(source.factor)
        extensions = {
            name: {
                key: value
                for key, value in extension.items()
                if not isinstance(value, ChannelImage) or value.uv_set in uv_sets
            }
            for name, extension in self.extensions.items()
        }
        return replace(self, channels=channels, extensions=extensions)


@dataclass(frozen=True, kw_only=True, eq=False)
class Materials:
    """Which material each face of a mesh has."""

    face_materials: IntArray  # (F,) int32: index into `materials`
    materials: tuple[MeshMaterial, ...]
    # mapping of int to (T, 2) float64: further sets of texture coordinates, in the rows of
    # `Mesh.uvs`
    uv_sets: Mapping[int, FloatArray] = field(default_factory=dict)
    # whether the colors of the mesh's vertices are factors of base color and alpha
    has_vertex_colors: bool = False
    # what the file asks for and could not be read: a channel, or "" for all of them, and a line
    # that says so
    missing: tuple[tuple[str, str], ...] = ()
    missing_images: tuple[str, ...] = ()  # names of the images among that, as the file has them
    # Names of variants of the model (KHR_materials_variants), each with the number of the material
    # that it shows instead of each of `materials`.
    variants: tuple[tuple[str, tuple[int, ...]], ...] = ()

    def __post_init__(self) -> None:
        ids = self.face_materials
        if len(ids) and (ids.min() < 0 or ids.max() >= len(self.materials)):
            raise MeshError(
                f"materials: an index is out of range; there are {len(self.materials)} materials"
            )
        object.__setattr__(self, "face_materials", frozen(ids))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the materials."""
        return tuple(material.name for material in self.materials)

    @property
    def has_images(self) -> bool:
        """Whether any channel is read from an image."""
        return bool(self.image_uv_sets)

    @property
    def image_uv_sets(self) -> set[int]:
        """Sets of texture coordinates that images lie on."""
        return {image.uv_set for material in self.materials for image in material.images}

    def without_images(self) -> Materials:
        """Return the materials with their factors alone, for a mesh without coordinates."""
        materials = tuple(material.on_uv_sets(()) for material in self.materials)
        return replace(self, materials=materials, uv_sets={})

    def used(self) -> Materials:
        """Return the materials that faces have, also in variants, numbered without gaps."""
        shown = np.unique(self.face_materials)
        tables = np.array([table for _, table in self.variants], np.int32)
        tables = tables.reshape(len(self.variants), len(self.materials))
        numbers = np.unique(np.concatenate([shown, tables[:, shown].ravel()]))
        items = tuple(self.materials[number] for number in numbers.tolist())
        # What no face shows by default keeps its place in variants.
        tables = np.where(np.isin(numbers, shown), tables[:, numbers], numbers)
        names = (name for name, _ in self.variants)
        rows = np.searchsorted(numbers, tables).tolist()
        return replace(
            self,
            face_materials=np.searchsorted(numbers, self.face_materials).astype(np.int32),
            materials=items,
            variants=tuple((name, tuple(row)) for name, row in zip(names, rows, strict=True)),
        )

    def in_variant(self, number: int | None) -> Materials:
        """Return the materials of a variant by its number, or those shown by default, alone."""
        if not self.variants:
            return self
        ids = self.face_materials
        if number is not None:
            ids = np.array(self.variants[number][1], np.int32)[ids]
        return replace(self, face_materials=ids, variants=()).used()

    def only(self, channels: Collection[str]) -> Materials:
        """Return the materials with some of their channels."""
        kept = tuple(
            replace(item, channels={k: v for k, v in item.channels.items() if k in channels})
            for item in self.materials
        )
        return replace(self, materials=kept)

    def sources(self, channel: str) -> list[ChannelSource | None]:
        """Return where each material takes a channel from; None where it does not set it."""
        return [material.channels.get(channel) for material in self.materials]

    def notes(self) -> tuple[str, ...]:
        """Return lines about what is missing: the first few, and how many more."""
        return first_few(line for _, line in self.missing)

    def of_faces(
        self, chosen: BoolArray | IndexArray, uv_rows: IndexArray | None = None
    ) -> Materials:
        """Return the materials of chosen faces, whose mesh keeps some rows of `uvs`, or all."""
        rows = slice(None) if uv_rows is None else uv_rows
        sets = {number: coordinates[rows] for number, coordinates in self.uv_sets.items()}
        return replace(self, face_materials=self.face_materials[chosen], uv_sets=sets)

    @classmethod
    def of_image(cls, mesh: Mesh, path: PathLike, channel: str = "base-color") -> Materials:
        """One material for all faces of a mesh, with an image file for one of its channels."""
        from texbake.files import read_bytes

        width = len(CHANNELS[channel].default)
        image = ChannelImage(read_bytes(path), name=str(path), components=tuple(range(width)))
        source = ChannelSource(factor=(1.0,) * width, image=image)
        material = MeshMaterial(name=Path(path).name, channels={channel: source})
        return cls(face_materials=np.zeros(mesh.n_faces, dtype=np.int32), materials=(material,))


@dataclass(frozen=True, eq=False)
class MissingParts:
    """What a reader of materials does not find; appended to."""

    lines: list[tuple[str, str]] = field(default_factory=list)  # as `Materials.missing`
    # As `Materials.missing_images`, each once.
    images: dict[str, None] = field(default_factory=dict)

    def add(self, channel: str, line: str, *, image: str | None = None) -> None:
        """Add a line about a channel, and the name of an image that is not there."""
        self.lines.append((channel, line))
        if image is not None:
            self.images[image] = None

    def fields(self) -> dict[str, Any]:
        """Return them as fields of `Materials`."""
        return {"missing": tuple(self.lines), "missing_images": tuple(self.images)}


def materials_by_face(mesh: Mesh, of_groups: Sequence[Any]) -> tuple[list[Any], IntArray] | None:
    """Distinct materials of groups, in order, and (F,) numbers; None if the groups are others."""
    if mesh.face_groups is None or len(of_groups) != len(mesh.group_names):
        return None
    numbers = {item: number for number, item in enumerate(dict.fromkeys(of_groups))}
    rows = np.array([numbers[item] for item in of_groups], np.int32)
    return list(numbers), rows[mesh.face_groups]


_READERS = {
    ".obj": ("mtl", "read_obj_materials"),
    ".glb": ("gltf_mesh_materials", "read_gltf_materials"),
    ".gltf": ("gltf_mesh_materials", "read_gltf_materials"),
    ".fbx": ("fbx_materials", "read_fbx_materials"),
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), ("usd_materials", "read_usd_materials")),
}


def read_materials(path: PathLike, mesh: MeshLike) -> Materials | None:
    """Read materials as `texbake.read_materials` does, without decoding their images."""
    mesh = as_mesh(mesh)
    reader = _READERS.get(Path(path).suffix.lower())
    if reader is None:
        return None
    read: Callable[[PathLike, Mesh], Materials | None]
    module, name = reader
    read = getattr(import_module(f"texbake.mesh.files.{module}"), name)
    materials = read(path, mesh)
    for line in () if materials is None else materials.notes():
        warn_of(path, line)
    return materials
