"""A mesh that rays are cast into: `RayScene.build` makes it, `RayScene.cast` turns rays into hits.

Embree finds which triangle a ray hits, in float32 and in packets of rays on several threads; where
on the triangle is then computed in float64. Hits do not depend on the number of threads, on the
other rays of a call, or on whether the mesh is traced in chunks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from typing import Self

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import IntArray, Mesh
from texbake.parallel import resolve_threads, run_bands
from texbake.raycast.embree import DIRECTION, PACKET, EmbreeScene, RayPacket, pair_faces
from texbake.raycast.fans import N_COLUMNS, Fans, OcclusionRange
from texbake.raycast.moller_trumbore import refine_kernel
from texbake.raycast.packets import fans_kernel, nearest_hits_kernel
from texbake.raycast.rays import NO_HIT, RayHits, Rays

Float32Array = npt.NDArray[np.float32]

# Multiples of PACKET, so that packets are the same for any number of threads.
_RAYS_PER_BAND = 1 << 14
_FANS_PER_BAND = 1 << 10


class RayScene:
    """A mesh to cast rays into, as a context manager: leaving it frees the memory of Embree.

    Made by `RayScene.build`.

    Attributes
    ----------
    mesh : Mesh
    frame : LocalFrame
        Rays, and distances of hits, are in this frame.
    caster : str
        Name of what casts the rays, for reports.
    """

    caster = "Embree, packets"

    def __init__(
        self, mesh: Mesh, frame: LocalFrame, chunk_faces: int | None, threads: int
    ) -> None:
        self.mesh = mesh
        self.frame = frame
        self._chunk_faces = chunk_faces
        self._threads = threads
        self._tree: EmbreeScene | None = None
        if chunk_faces is None:
            quads, self._first_faces = pair_faces(mesh.faces)
            positions = frame.to_local(mesh.positions).astype(np.float32)
            self._tree = EmbreeScene(positions, quads, threads)

    @classmethod
    def build(
        cls,
        mesh: Mesh,
        frame: LocalFrame,
        *,
        chunk_faces: int | None = None,
        threads: int | None = None,
    ) -> Self:
        """Build the ray tree over a mesh.

        Parameters
        ----------
        chunk_faces : int, optional
            For a mesh whose ray tree would not fit into memory: the most faces in a tree, at
            least 2. Each call then builds the trees of the chunks anew, one at a time. None: one
            tree over the whole mesh.
        threads : int, optional
            None: every processor.

        Raises
        ------
        DependencyError
            embreex, or the Embree library in it, does not load; or memory ran out.
        """
        chunk = None if chunk_faces is None else max(chunk_faces, 2)
        return cls(mesh, frame, chunk, resolve_threads(threads))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the memory of Embree."""
        if self._tree is not None:
            self._tree.close()

    def cast(self, rays: Rays, *, cull_back_faces: bool = True) -> RayHits:
        """Find the first hit of each ray within its length.

        With culling, rays pass through faces that face away from their origin. A few hits near
        edges are uncertain, and a few rays miss by rounding: see `texbake.raycast.exact_hits`.
        """
        if self._tree is None:
            return self._cast_in_chunks(rays, cull_back_faces)
        hits, _ = _nearest_hits(
            self._tree,
            self._first_faces,
            rays,
            cull=cull_back_faces,
            threads=self._threads,
            refine=self._refine,
        )
        return hits

    def cast_fans(
        self, fans: Fans, sets: Float32Array, occlusion_range: OcclusionRange
    ) -> Float32Array:
        """Cast all rays of the fans.

        Parameters
        ----------
        sets : (S, n_rays, 3) float32
            Directions, from `texbake.raycast.fans.direction_sets`.

        Returns
        -------
        (n, N_COLUMNS) float32
            The columns of `texbake.raycast.fans`, lengths in local units.

        Raises
        ------
        OptionError
            The mesh is traced in chunks, and these rays need all of it at once.
        """
        if self._tree is None:
            raise OptionError(
                f"max_memory: {self.mesh.name} is traced in chunks, and ambient occlusion, bent "
                "normals and thickness need all of it at once; bake them without max_memory"
            )
        tree, results = self._tree, np.full((len(fans), N_COLUMNS), np.nan, dtype=np.float32)
        set_ids = fans.set_ids & np.uint32(len(sets) - 1)

        def cast(start: int, stop: int) -> None:
            band = slice(start, stop)
            packet = RayPacket()
            fields = packet.words.reshape(-1, PACKET)
            fans_kernel(
                tree.secondary_addresses(packet),
                (packet.valid, fields, packet.ids.reshape(-1, PACKET)),
                fields[DIRECTION : DIRECTION + 3],
                (fans.points[band], fans.axes[band], fans.planes[band], set_ids[band]),
                sets,
                (occlusion_range.offset, occlusion_range.outer, occlusion_range.inner),
                results[band],
            )

        run_bands(cast, len(fans), band=_FANS_PER_BAND, threads=self._threads)
        return results

    def _refine(self, hits: RayHits, rays: Rays) -> None:
        """Compute where rays meet the faces they hit, in place."""
        refine_kernel(
            (self.mesh.positions, self.mesh.faces, self.frame.center, self.frame.scale),
            (rays.origins, rays.directions, rays.lengths),
            (hits.faces, hits.barycentrics, hits.distances),
        )

    def _cast_in_chunks(self, rays: Rays, cull: bool) -> RayHits:
        """As `cast`: the hit of a ray is the nearest one in all chunks.

        A face is hit by the same rays at the same distances in the tree over the whole mesh and in
        that over its chunk, chunks begin where a pair of faces does, and of equally near faces the
        first one counts.
        """
        hits = RayHits.misses(len(rays))
        firsts = np.full(len(rays), np.inf, dtype=np.float32)
        for first, quads, first_faces in self.chunks():
            with closing(self._chunk_tree(quads)) as tree:

                def merge(
                    start: int,
                    stop: int,
                    *,
                    first: int = first,
                    first_faces: IntArray = first_faces,
                    tree: EmbreeScene = tree,
                ) -> None:
                    band = slice(start, stop)
                    part = _nearest_hits(tree, first_faces, rays.where(band), cull=cull, threads=1)
                    _merge_nearer(hits.where(band), firsts[band], part, first)

                run_bands(merge, len(rays), band=_RAYS_PER_BAND, threads=self._threads)

        def refine(start: int, stop: int) -> None:
            self._refine(hits.where(slice(start, stop)), rays.where(slice(start, stop)))

        run_bands(refine, len(rays), band=_RAYS_PER_BAND, threads=self._threads)
        return hits

    def chunks(self) -> Iterator[tuple[int, IntArray, IntArray]]:
        """Yield the first face of each chunk, its quads, and the first face per quad in the chunk.

        The quads are those of the whole mesh: one that the end of a chunk may cut in two goes to
        the next chunk.
        """
        faces, first = self.mesh.faces, 0
        size = len(faces) if self._chunk_faces is None else self._chunk_faces
        while first < len(faces):
            stop = min(first + size + 1, len(faces))
            quads, first_faces = pair_faces(faces[first:stop])
            if stop < len(faces):
                quads, first_faces = quads[:-1], first_faces[:-1]
            yield first, quads, first_faces
            first += int(first_faces[-1])

    def _chunk_tree(self, quads: IntArray) -> EmbreeScene:
        """Tree over some quads, with only the vertices from the lowest to the highest index."""
        low, high = int(quads.min()), int(quads.max())
        positions = self.frame.to_local(self.mesh.positions[low : high + 1]).astype(np.float32)
        return EmbreeScene(positions, quads - np.int32(low), self._threads)


def _nearest_hits(
    tree: EmbreeScene,
    first_faces: IntArray,
    rays: Rays,
    *,
    cull: bool,
    threads: int,
    refine: Callable[[RayHits, Rays], None] | None = None,
) -> tuple[RayHits, Float32Array]:
    """Nearest hit of each ray in one tree, in float32; of equally near faces the first.

    Parameters
    ----------
    first_faces : (Q + 1,) int32
        For the quads of the tree, from `pair_faces`.
    refine
        Called with each band of hits and its rays, right after they were cast.

    Returns
    -------
    hits : RayHits
        Without barycentrics, unless refined.
    firsts : (n,) float32
        Distance of the nearest face from either side; infinite where there is none.
    """
    hits = RayHits.misses(len(rays))
    firsts = np.full(len(rays), np.inf, dtype=np.float32)

    def cast(start: int, stop: int) -> None:
        band = slice(start, stop)
        packet = RayPacket()
        lines = rays.where(band)
        found = hits.where(band)
        nearest_hits_kernel(
            tree.addresses(packet),
            (packet.valid, packet.words, packet.ids),
            (packet.query, packet.query_ids),
            first_faces,
            cull,
            (lines.origins, lines.directions, lines.lengths),
            (found.faces, found.distances),
            (found.passed_back, firsts[band]),
        )
        if refine is not None:
            refine(found, lines)

    run_bands(cast, len(rays), band=_RAYS_PER_BAND, threads=threads)
    return hits, firsts


def _merge_nearer(
    hits: RayHits, firsts: Float32Array, part: tuple[RayHits, Float32Array], first_face: int
) -> None:
    """Replace hits, in place, by those that are nearer in the chunk that begins at a face."""
    others, nearest = part
    nearer = nearest < firsts
    firsts[nearer] = nearest[nearer]
    hits.passed_back[nearer] = others.passed_back[nearer]
    taken = others.faces != NO_HIT
    taken &= (hits.faces == NO_HIT) | (others.distances < hits.distances)
    hits.faces[taken] = others.faces[taken] + first_face
    hits.distances[taken] = others.distances[taken]
