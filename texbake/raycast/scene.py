"""A mesh that rays are cast into: `RayScene.build` makes it, `RayScene.cast` turns rays into hits.

Rays of neighboring texels go through the tree in bundles, other rays one by one, which takes less
time even where they are nearly parallel. Hits are exact: no ray passes between two triangles that
share an edge, and a hit does not depend on the number of threads, on the other rays of a call, or
on whether the mesh is traced in chunks.

Kernels: `core/tile_bundles.c`, `core/single_rays.c`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Self

import numpy as np

from texbake.core import core
from texbake.errors import OptionError
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Float32Array, FloatArray, IntArray, Mesh
from texbake.mesh.streamed.mesh import StreamedMesh
from texbake.parallel import resolve_threads, run_bands
from texbake.raycast.morton_tree import MortonTree
from texbake.raycast.rays import N_COLUMNS, Hemispheres, OcclusionRange, RayHits, Rays, Rows
from texbake.records import dataclass

BUNDLE_SIDE = 16  # texels along one side of a square whose rays are one bundle
_RAYS_PER_BAND = 1 << 14
_HEMISPHERES_PER_BAND = 1 << 10  # a multiple of the number that the kernel casts together
# Of the boxes of rays, in local units: far more than rounding.
_BOX_SLACK = 1e-6


@dataclass(frozen=True, eq=False)
class RayPlaces(Rows):
    """Where rays stand in a texture; those of each square of `BUNDLE_SIDE` follow each other."""

    charts: IntArray  # (n,) int32; rays of different charts are not in one bundle
    cells: IntArray  # (n, 2) int32; column and row


# The rays of a band; without places, each is cast alone.
MakeRays = Callable[[slice], tuple[Rays, RayPlaces | None]]


class RayScene:
    """A mesh to cast rays into. Made by `RayScene.build`."""

    caster = "tile bundles"  # name of the ray caster, for reports

    def __init__(
        self,
        source: Mesh | StreamedMesh,
        frame: LocalFrame,
        chunk_faces: int | None,
        compact: bool,
        threads: int,
    ) -> None:
        self.source = source
        self.frame = frame  # of rays and of hit distances
        # Whether each call builds the trees of chunks again.
        self.in_chunks = chunk_faces is not None or isinstance(source, StreamedMesh)
        self._chunk_faces = chunk_faces or max(source.n_faces, 1)
        self.threads = threads
        self.compact = compact  # whether the tree is built for hemispheres
        self._tree = (
            None
            if self.in_chunks
            else MortonTree.build(self.mesh, frame, compact=compact, threads=threads)
        )

    @classmethod
    def build(
        cls,
        mesh: Mesh | StreamedMesh,
        frame: LocalFrame,
        *,
        chunk_faces: int | None = None,
        compact: bool = False,
        threads: int | None = None,
    ) -> Self:
        """Build the ray tree, or for a mesh beyond memory one per `chunk_faces` in turn."""
        return cls(mesh, frame, chunk_faces, compact, resolve_threads(threads))

    @property
    def mesh(self) -> Mesh:
        """The mesh, which is not streamed."""
        assert isinstance(self.source, Mesh)
        return self.source

    def cast(
        self, rays: Rays, *, cull_back_faces: bool = True, places: RayPlaces | None = None
    ) -> RayHits:
        """Find the first hit of each ray within its length; of equally near faces the lowest.

        With culling, rays pass through back faces. Rays with `places` in a texture are cast in
        bundles.
        """
        if places is not None:
            make = rows_of(rays, places)
            return self.cast_in_order(len(rays), make, cull_back_faces=cull_back_faces)
        if len(rays) == 0:
            return RayHits.misses(0)
        keys = np.empty(len(rays), dtype=np.uint64)
        core.sort_keys_of_rays(rays.origins, rays.directions, rays.lengths, keys)
        order = np.argsort(keys, kind="stable")
        make = rows_of(rays.where(order))
        sorted_hits = self.cast_in_order(len(rays), make, cull_back_faces=cull_back_faces)
        hits = RayHits.misses(len(rays))
        hits.take(sorted_hits, order)
        return hits

    def cast_in_order(
        self, n: int, make: MakeRays, *, cull_back_faces: bool, threads: int | None = None
    ) -> RayHits:
        """As `cast`, of `n` rays by place; `make` returns a band of them, again for each tree."""
        hits = RayHits.misses(n)
        # What the test of rays and triangles has computed, which decides between chunks.
        nearest, backs = np.full(n, np.inf), np.full(n, np.inf)
        # Small bands of rays have boxes that miss more chunks.
        per_band = max(n, 1) if threads == 1 and not self.in_chunks else _RAYS_PER_BAND
        boxes = np.full((-(-n // per_band), 6), np.nan)
        for tree in self.trees():

            def cast(start: int, stop: int, tree: MortonTree = tree) -> None:
                band, box = slice(start, stop), boxes[start // per_band]
                # False for a box that is not known yet: its coordinates are NaN.
                first, last = box[:3] - _BOX_SLACK, box[3:] + _BOX_SLACK
                if (last < tree.box[:3]).any() or (first > tree.box[3:]).any():
                    return
                rays, places = make(band)
                if self.in_chunks and np.isnan(box[0]):
                    core.bound_points(_ends(rays), box)
                core.cast_bundles(
                    *tree.mesh,
                    tree.ids,
                    tree.leaves if tree.has_leaves else None,
                    tree.nodes,
                    tree.starts,
                    tree.box,
                    rays.origins,
                    rays.directions,
                    rays.lengths,
                    None if places is None else places.cells,
                    None if places is None else places.charts,
                    cull_back_faces,
                    nearest[band],
                    backs[band],
                    hits.faces[band],
                    hits.barycentrics[band],
                    hits.distances[band],
                    hits.passed_back[band],
                )

            run_bands(cast, n, band=per_band, threads=threads or self.threads)
        return hits

    def trees(self) -> Iterator[MortonTree]:
        """Yield the tree over the mesh, or those over its chunks, one at a time."""
        if self._tree is not None:
            yield self._tree
            return
        if isinstance(self.source, StreamedMesh):
            for chunk in self.source.chunks(self._chunk_faces):
                yield MortonTree.build(chunk, self.frame, threads=self.threads)
            return
        n = self.mesh.n_faces
        for first in range(0, n, self._chunk_faces):
            faces = range(first, min(first + self._chunk_faces, n))
            yield MortonTree.build(self.mesh, self.frame, faces, threads=self.threads)

    def cast_hemispheres(
        self, hemispheres: Hemispheres, sets: Float32Array, occlusion_range: OcclusionRange
    ) -> Float32Array:
        """(n, N_COLUMNS) results of all rays, by `core/single_rays.c`; (S, n_rays, 3) `sets`."""
        tree = self._tree
        if tree is None:
            raise OptionError(
                f"max_memory: {self.source.name} is traced in chunks, and ambient occlusion, bent "
                "normals and thickness need all of it at once; bake them without max_memory"
            )
        results = np.full((len(hemispheres), N_COLUMNS), np.nan, dtype=np.float32)
        set_ids = hemispheres.set_ids & np.uint32(len(sets) - 1)

        def cast(start: int, stop: int) -> None:
            band = slice(start, stop)
            core.cast_hemispheres(
                hemispheres.points[band],
                hemispheres.axes[band],
                hemispheres.planes[band],
                set_ids[band],
                sets.reshape(-1, 3),
                sets.shape[1],
                occlusion_range.offset,
                occlusion_range.outer,
                occlusion_range.inner,
                tree.leaves,
                tree.nodes,
                tree.starts,
                tree.box,
                results[band],
            )

        run_bands(cast, len(hemispheres), band=_HEMISPHERES_PER_BAND, threads=self.threads)
        return results


def rows_of(rays: Rays, places: RayPlaces | None = None) -> MakeRays:
    """Return what makes bands of rays that are in memory."""
    return lambda band: (rays.where(band), None if places is None else places.where(band))


def _ends(rays: Rays) -> FloatArray:
    """(2 n, 3) float64: where rays begin and end."""
    with np.errstate(invalid="ignore"):  # 0 times infinity: the ray stays where it begins
        ends = rays.origins + rays.directions * rays.lengths[:, np.newaxis]
    return np.concatenate([rays.origins, ends])
