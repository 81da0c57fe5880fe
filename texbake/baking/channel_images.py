"""Values of a high-poly mesh's materials at hits: factors, times images that are decoded once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from texbake.baking.hits import Hits
from texbake.core import core, portable_math as pm
from texbake.mesh.materials import (
    CHANNELS,
    Channel,
    ChannelImage,
    ChannelSource,
    Placing,
    SurfaceSampler,
)
from texbake.mesh.mesh import Float32Array, FloatArray, IndexArray, IntArray, Mesh, frozen
from texbake.mesh.tangents import image_axes
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.texture.lookup import lookup

if TYPE_CHECKING:
    from texbake.baking.inputs import BakeInputs

_BAND = 1 << 15


def surface_points(
    mesh: Mesh,
    vectors: Float32Array,
    corners: IntArray,
    faces: IntArray,
    barycentrics: npt.NDArray[np.floating[Any]],
) -> tuple[FloatArray, Float32Array]:
    """Points of faces (n, 3) and unit normals there, by barycentrics (n, 2) of corners 2 and 3."""
    weights: FloatArray = barycentrics.astype(np.float64, copy=False)
    vertices = np.take(mesh.faces, faces, axis=0)
    points = np.take(mesh.positions, vertices[:, 0], axis=0)
    points *= 1.0 - weights.sum(axis=1, keepdims=True)
    for i in (1, 2):
        points += np.take(mesh.positions, vertices[:, i], axis=0) * weights[:, i - 1 : i]
    normals = np.empty((len(points), 3), np.float32)
    core.interpolate_high_normals(
        faces, barycentrics.astype(np.float32, copy=False), vectors, corners, normals
    )
    return points, normals


@dataclass(eq=False)
class MaterialPoints:
    """Points of faces that have one material, and where they lie in its images."""

    rows: IndexArray | slice  # which of all points they are
    faces: IntArray  # (n,) int32
    barycentrics: Float32Array  # (n, 2) float32; weights of the second and third corner
    # By the set of texture coordinates and the placing: several channels share one.
    _places: dict[tuple[int, Placing], FloatArray] = field(default_factory=dict)
    _sampled: dict[SurfaceSampler, Mapping[str, Float32Array]] = field(default_factory=dict)

    def sampled(self, sampler: SurfaceSampler, inputs: BakeInputs) -> Mapping[str, Float32Array]:
        """Return the values of a sampler at the points, which it computes once for all channels."""
        if sampler not in self._sampled:
            points, normals = surface_points(
                inputs.high, *inputs.high_surface.normals, self.faces, self.barycentrics
            )
            self._sampled[sampler] = sampler.at(points, normals.astype(np.float64))
        return self._sampled[sampler]

    def places(
        self, image: ChannelImage, uvs: FloatArray, uv_faces: IntArray, threads: int | None
    ) -> FloatArray:
        """(n, 2) float64: texture coordinates in an image."""
        key = image.uv_set, image.placing
        if key not in self._places:
            self._places[key] = places = np.empty((len(self.faces), 2))
            placing = np.array(image.placing)

            def work(start: int, stop: int) -> None:
                band = slice(start, stop)
                faces, barycentrics = self.faces[band], self.barycentrics[band]
                core.place_in_image(faces, barycentrics, uvs, uv_faces, placing, places[band])

            run_bands(work, len(self.faces), band=_BAND, threads=threads)
        return self._places[key]


def points_by_material(hits: Hits, face_materials: IntArray, n: int) -> list[MaterialPoints]:
    """Divide the points hit by the materials of their faces, numbered from 0 to n."""
    faces, barycentrics = hits.high_faces, hits.high_barycentrics
    if n == 1:
        return [MaterialPoints(slice(None), faces, barycentrics)]
    ids = face_materials[faces]
    rows_of = (np.flatnonzero(ids == i) for i in range(n))
    return [MaterialPoints(rows, faces[rows], barycentrics[rows]) for rows in rows_of]


@dataclass(eq=False)
class ChannelImages:
    """Looks up values that channels take from images; decodes each image when first needed."""

    uvs: dict[int, FloatArray]  # each (T, 2) float64; sets of texture coordinates by their numbers
    uv_faces: IntArray  # (F, 3) int32; indices into those of each set
    threads: int | None = None
    _decoded: dict[tuple[str, bool, tuple[int, ...]], Float32Array] = field(default_factory=dict)

    def values(
        self, image: ChannelImage, points: MaterialPoints, *, is_color: bool
    ) -> Float32Array:
        """(n, components) linear values at points, bilinearly; `is_color`: 8 bits are sRGB."""
        pixels = self._pixels(image, is_color)
        places = points.places(image, self.uvs[image.uv_set], self.uv_faces, self.threads)
        if image.is_nearest:
            sizes = np.array([pixels.shape[1], pixels.shape[0]])
            with np.errstate(over="ignore"):  # infinity is outside every image
                places = (np.floor(places * sizes) + 0.5) / sizes
        wrap = image.wraps[0]
        if wrap != image.wraps[1]:
            places = _wrapped(places, image.wraps, (pixels.shape[1], pixels.shape[0]))
            wrap = "repeat"
        return lookup(pixels, places, wrap=wrap, threads=self.threads)

    def _pixels(self, image: ChannelImage, is_color: bool) -> Float32Array:
        key = image.name, is_color, image.components
        if key not in self._decoded:
            self._decoded[key] = decoded_image(image, is_color=is_color)
        return self._decoded[key]


def decoded_image(image: ChannelImage, *, is_color: bool) -> Float32Array:
    """(H, W, components) linear components of an image that a channel reads, opaque by default."""
    from texbake.texture.image import decode_image

    pixels = decode_image(image.data, image.name, color=is_color).pixels
    n = pixels.shape[2]
    alpha = n - 1 if n in (2, 4) else None
    columns = []
    for component in image.components:
        index: int | None = component if n >= 3 else 0
        if component == 3:
            index = alpha
        if index is None:
            columns.append(np.ones(pixels.shape[:2], np.float32))
        else:
            columns.append(pixels[:, :, index])
    if image.components == tuple(range(n)):
        return np.ascontiguousarray(pixels)
    return np.ascontiguousarray(np.stack(columns, axis=2))


def _wrapped(places: FloatArray, wraps: tuple[str, str], sizes: tuple[int, int]) -> FloatArray:
    """Places in the unit square, for an image that wraps differently along u and v."""
    wrapped = places.copy()
    for axis, (wrap, size) in enumerate(zip(wraps, sizes, strict=True)):
        if wrap == "mirror":
            wrapped[:, axis] = 1.0 - np.abs(1.0 - np.mod(wrapped[:, axis], 2.0))
        if wrap != "repeat":
            # Half a texel from the edges, where the outermost texels alone count.
            np.clip(wrapped[:, axis], 0.5 / size, 1.0 - 0.5 / size, out=wrapped[:, axis])
    return wrapped


def values_at_hits(name: str, hits: Hits, inputs: BakeInputs) -> Float32Array:
    """(n, C) float32: linear values of a channel; its default where a material does not set it."""
    assert inputs.materials is not None
    channel = CHANNELS[name]
    values = np.empty((len(hits), len(channel.default)), dtype=np.float32)
    sources = inputs.materials.sources(name)
    for source, points in zip(sources, inputs.high_surface.material_points(hits), strict=True):
        values[points.rows] = _source_values(channel, source, points, inputs)
    colors = inputs.high.colors
    if inputs.materials.has_vertex_colors and colors is not None:
        factors = None
        if name == "base-color":
            factors = inputs.high_surface.colors
        elif name == "alpha" and colors.shape[1] == 4:
            factors = frozen(np.ascontiguousarray(colors[:, 3:]))
        if factors is not None:
            values *= hits.interpolated(factors, inputs.high.faces, inputs.options.threads)
    return values


def _source_values(
    channel: Channel, source: ChannelSource | None, points: MaterialPoints, inputs: BakeInputs
) -> Float32Array:
    """(n, C) float32, or (C,) for all points: a channel of one material."""
    if source is not None and source.sampler is not None:
        return points.sampled(source.sampler, inputs)[channel.name]
    factor = np.array(channel.default if source is None else source.factor, dtype=np.float32)
    if source is None or source.image is None:
        return factor
    values = inputs.high_surface.images.values(source.image, points, is_color=channel.is_color)
    if (factor != 1.0).any():
        values *= factor
    if source.offset != 0.0:
        values += np.float32(source.offset)
    return values


def replace_by_normal_maps(hits: Hits, inputs: BakeInputs, normals: Float32Array) -> None:
    """Replace normals of hits by those of normal maps, in place; `core/barycentric.c`."""
    assert inputs.materials is not None
    sources = inputs.materials.sources("normal")
    for source, points in zip(sources, inputs.high_surface.material_points(hits), strict=True):
        if source is not None and source.image is not None:
            normals[points.rows] = _mapped_normals(source, source.image, points, inputs)


def _mapped_normals(
    source: ChannelSource, image: ChannelImage, points: MaterialPoints, inputs: BakeInputs
) -> Float32Array:
    """(n, 3) float32: unit normals of a normal map at points of the high-poly faces."""
    surface = inputs.high_surface
    normals, corners = surface.normals
    tangents = surface.tangents
    vectors = surface.images.values(image, points, is_color=False)
    factor = np.array(source.factor, np.float32)
    axes = np.eye(2, dtype=np.float32)
    if inputs.high.tangents is None:
        axes = image_axes(np.array(image.placing)[:, :2])
    is_turned = (axes != np.eye(2)).any()

    def work(start: int, stop: int) -> None:
        band = slice(start, stop)
        vectors[band] = (vectors[band] * 2.0 - 1.0) * factor
        if is_turned:
            vectors[band, :2] = pm.matmul(vectors[band, :2], axes)
        core.from_tangent_space(
            points.faces[band], points.barycentrics[band], normals, corners, tangents, vectors[band]
        )

    run_bands(work, len(points.faces), band=_BAND, threads=inputs.options.threads)
    return vectors
