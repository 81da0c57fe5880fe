"""What maps are made from, beside the hits; each part is computed when a map first needs it.

Of the high-poly mesh, maps use only what belongs to its faces, corner by corner, apart from its
normals and curvatures. So the faces that were hit are enough to make maps again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from texbake.baking.channel_images import ChannelImages, MaterialPoints, points_by_material
from texbake.baking.hits import Hits
from texbake.baking.options import BakeOptions
from texbake.baking.rays import ray_normals
from texbake.baking.texels import texel_charts_of
from texbake.mapping.seams import chart_ids
from texbake.mesh.files.conversion import linear_colors, srgb_colors
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import Float32Array, FloatArray, IntArray, Mesh, frozen
from texbake.mesh.normals import flat_normals, shading_normals, smooth_normals, vertex_curvatures
from texbake.mesh.streamed.mesh import StreamedMesh
from texbake.mesh.streamed.source import Marks
from texbake.mesh.tangents import shading_tangents
from texbake.records import dataclass


@dataclass(frozen=True, eq=False)
class HighSurface:
    """The high-poly mesh of a bake, with what maps need of it."""

    mesh: Mesh
    materials: Materials | None
    shading: str  # `BakeOptions.high_shading`
    colors_misread: str  # `BakeOptions.colors_misread`
    # (V, 1) float32; its curvatures, where the mesh is only a part of the one they were computed
    # for.
    known_curvatures: Float32Array | None = None
    # Returns its smooth normals, (V, 3) float64, where the mesh is only a part of another.
    known_normals: Callable[[], FloatArray] | None = None
    # (F, 3, 4) float32; its MikkTSpace tangents, where the mesh is only a part of another.
    known_tangents: Float32Array | None = None
    threads: int | None = None

    @cached_property
    def normals(self) -> tuple[Float32Array, IntArray]:
        """(N, 3) float32 shading normals, and (F, 3) indices of those at the corners."""
        mesh, threads = self.mesh, self.threads
        if self.shading == "flat":
            normals, corners = flat_normals(mesh, threads=threads)
        elif mesh.normals is None:
            normals, corners = self._smooth_normals, mesh.faces
        else:
            normals, corners = shading_normals(mesh, threads=threads)
        return frozen(normals.astype(np.float32)), frozen(corners)

    @cached_property
    def _smooth_normals(self) -> FloatArray:
        if self.known_normals is not None:
            return self.known_normals()
        return smooth_normals(self.mesh, threads=self.threads)

    @cached_property
    def curvatures(self) -> Float32Array:
        """(V, 1) float32 mean curvature at the vertices, per model unit."""
        if self.known_curvatures is not None:
            return frozen(self.known_curvatures)
        curvatures = vertex_curvatures(
            self.mesh, normals=self._smooth_normals, threads=self.threads
        )
        return frozen(curvatures.astype(np.float32)[:, np.newaxis])

    @cached_property
    def colors(self) -> Float32Array:
        """(V, 3) float32 linear vertex colors; white if there are none."""
        if self.mesh.colors is None:
            return frozen(np.ones((self.mesh.n_vertices, 3), dtype=np.float32))
        colors = self.mesh.colors[:, :3]
        if self.colors_misread == "srgb":
            colors = linear_colors(colors)
        elif self.colors_misread == "linear":
            colors = srgb_colors(colors).astype(np.float32)
        return frozen(np.ascontiguousarray(colors))

    def material_points(self, hits: Hits) -> list[MaterialPoints]:
        """Return the points hit of each material; those of the same hits are found once."""
        assert self.materials is not None
        if hits not in self._material_points:
            self._material_points[hits] = points_by_material(
                hits, self.materials.face_materials, len(self.materials.materials)
            )
        return self._material_points[hits]

    def __getstate__(self) -> dict[str, object]:
        """Return all fields but the points, whose weak keys cannot be pickled."""
        return {name: value for name, value in vars(self).items() if name != "_material_points"}

    @cached_property
    def _material_points(self) -> WeakKeyDictionary[Hits, list[MaterialPoints]]:
        return WeakKeyDictionary()

    @cached_property
    def images(self) -> ChannelImages:
        """Images of the materials; nothing is decoded yet."""
        mesh, sets = self.mesh, {} if self.materials is None else self.materials.uv_sets
        assert mesh.uvs is not None and mesh.uv_faces is not None
        return ChannelImages({0: mesh.uvs, **sets}, mesh.uv_faces, self.threads)

    @cached_property
    def tangents(self) -> Float32Array:
        """(F, 3, 4) float32 corner tangents: those of the file, else MikkTSpace tangents."""
        known = self.known_tangents
        return frozen(shading_tangents(self.mesh) if known is None else known)


@dataclass(frozen=True, eq=False)
class LowSurface:
    """The low-poly mesh of a bake, with what maps need of it."""

    mesh: Mesh
    threads: int | None = None

    @cached_property
    def normals(self) -> tuple[FloatArray, IntArray]:
        """(N, 3) float64 shading normals, and (F, 3) indices of those at the corners."""
        normals, corners = shading_normals(self.mesh, threads=self.threads)
        return frozen(normals), frozen(corners)

    @cached_property
    def tangents(self) -> Float32Array:
        """(F, 3, 4) float32 corner tangents: those of the file, else MikkTSpace tangents."""
        return frozen(shading_tangents(self.mesh))

    @cached_property
    def charts(self) -> IntArray:
        """(F,) int32 chart of each face."""
        return chart_ids(self.mesh)

    @cached_property
    def displacement_normals(self) -> tuple[FloatArray, IntArray]:
        """(N, 3) float64 directions in which it is displaced, and (F, 3) indices at the corners."""
        normals, corners = ray_normals(self.mesh, "smooth")
        return frozen(normals), frozen(corners)


@dataclass(frozen=True, eq=False)
class BakeInputs:
    """Both meshes of a bake with normals and tangents, in model space; from `BakeInputs.of`."""

    high_surface: HighSurface
    low_surface: LowSurface
    options: BakeOptions
    # (2, 3) float64; the box that positions are encoded in, where it is not that around both
    # meshes.
    known_bounds: FloatArray | None = None
    # The high-poly mesh, if it stays in its file. Then the surface has only some faces of it:
    # `of_hits` returns inputs with those that were hit.
    stream: StreamedMesh | None = None

    @classmethod
    def of(
        cls,
        high: Mesh | StreamedMesh,
        low: Mesh,
        options: BakeOptions,
        materials: Materials | None = None,
        *,
        known_curvatures: Float32Array | None = None,
        known_tangents: Float32Array | None = None,
        known_bounds: FloatArray | None = None,
    ) -> BakeInputs:
        """Return the inputs of a bake; nothing is computed yet."""
        stream = None
        if isinstance(high, StreamedMesh):
            stream, known_bounds = high, joint_bounds(low, high)
            high = high.part(np.zeros(1, dtype=np.int32)).mesh
        surface = HighSurface(
            high,
            materials,
            options.high_shading,
            options.colors_misread(high.name),
            known_curvatures,
            known_tangents=known_tangents,
            threads=options.threads,
        )
        return cls(surface, LowSurface(low, options.threads), options, known_bounds, stream)

    def of_hits(self, hits: Hits) -> tuple[BakeInputs, Hits]:
        """Inputs that maps of hits are made from, of a streamed mesh the faces hit; and hits."""
        stream = self.stream
        if stream is None:
            return self, hits
        hit = hits.high_faces[hits.is_hit]
        # One face, if none was hit.
        marks = Marks.of(hit if len(hit) else np.zeros(1, np.int32), stream.n_faces)
        part = stream.part(marks.places)
        surface = replace(
            self.high_surface,
            mesh=part.mesh,
            known_normals=lambda: stream.smooth_normals(part.vertices),
        )
        faces = marks.numbers_of(hits.high_faces, self.options.threads)  # `NO_HIT` stays
        hits = replace(hits, high_faces=faces)
        return replace(self, high_surface=surface), hits

    @property
    def source(self) -> Mesh | StreamedMesh:
        """The whole high-poly mesh."""
        return self.high if self.stream is None else self.stream

    @property
    def high(self) -> Mesh:
        """The high-poly mesh, or a part of one that is streamed."""
        return self.high_surface.mesh

    @property
    def low(self) -> Mesh:
        """The low-poly mesh."""
        return self.low_surface.mesh

    @property
    def materials(self) -> Materials | None:
        """Materials of the high-poly mesh."""
        return self.high_surface.materials

    @property
    def has_normal_maps(self) -> bool:
        """Whether normals are those of the high-poly mesh's own normal maps."""
        return (
            self.materials is not None
            and self.options.high_normal_maps
            and self.high.uvs is not None
            and any(source is not None for source in self.materials.sources("normal"))
        )

    @property
    def has_samplers(self) -> bool:
        """Whether functions of the user, which are called from one thread, compute channels."""
        found = () if self.materials is None else self.materials.materials
        return any(source.sampler for material in found for source in material.channels.values())

    def with_options(self, options: BakeOptions) -> BakeInputs:
        """Return the inputs with other options; what these do not change stays computed."""
        surface = self.high_surface
        misread = options.colors_misread(surface.mesh.name)
        if (options.high_shading, misread) != (surface.shading, surface.colors_misread):
            surface = replace(surface, shading=options.high_shading, colors_misread=misread)
        return replace(self, high_surface=surface, options=options)

    def with_low(self, low: Mesh) -> BakeInputs:
        """Return the inputs with another low-poly mesh."""
        return replace(self, low_surface=LowSurface(low, self.options.threads))

    def texel_charts(self, texel_faces: IntArray) -> IntArray:
        """(H, W) int32: chart of the low-poly mesh on each texel, given its face; -1 for none."""
        return texel_charts_of(self.low_surface.charts, texel_faces, self.options.threads)

    @cached_property
    def bounds(self) -> FloatArray:
        """(2, 3) float64: the box around both meshes."""
        if self.known_bounds is not None:
            return frozen(self.known_bounds)
        return joint_bounds(self.low, self.high)


def joint_bounds(low: Mesh, high: Mesh | StreamedMesh) -> FloatArray:
    """(2, 3) float64: the box around both meshes."""
    (first, last), (other_first, other_last) = low.bounds, high.bounds
    return frozen(np.stack([np.minimum(first, other_first), np.maximum(last, other_last)]))
