"""Rays at a dense mesh whose ray tree would not fit into memory: at one chunk of it after another.

The hit of a ray is the nearest of all chunks. In Embree's tree over the whole mesh and in that over
a chunk a face is hit by the same rays at the same distances, chunks begin where a pair of faces
does (`quads.pair_faces`), and of equally near faces the first counts. So results do not depend on
the chunks.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing

import numpy as np
import numpy.typing as npt

from texbake.baking.embree import EmbreeScene
from texbake.baking.found import Found
from texbake.baking.hits import NO_HIT
from texbake.baking.native_caster import NativeCaster, nearest_hits, refiner
from texbake.baking.quads import pair_faces
from texbake.baking.rays import Rays
from texbake.baking.secondary.fans import Fans
from texbake.baking.secondary.reach import Reach
from texbake.errors import OptionError
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import IntArray, Mesh
from texbake.parallel import resolve_threads, run_bands

_RAYS_A_BAND = 1 << 14


class ChunkedCaster:
    """Builds the tree of each chunk anew for every call, and holds only one of them.

    Parameters
    ----------
    chunk_faces : int
        Most faces of a chunk, at least 2.
    """

    name = NativeCaster.name

    def __init__(
        self, high: Mesh, frame: LocalFrame, chunk_faces: int, *, threads: int | None = None
    ) -> None:
        self._high, self._frame = high, frame
        self._chunk_faces = max(chunk_faces, 2)
        self._threads = resolve_threads(threads)

    def cast(self, rays: Rays, *, cull_back_faces: bool = True) -> Found:
        """Find the nearest hit of each ray within its length."""
        found = Found.nothing(len(rays))
        firsts = np.full(len(rays), np.inf, dtype=np.float32)
        for first, quads, first_faces in self._chunks():
            with closing(self._scene(quads)) as scene:

                def look(
                    start: int,
                    stop: int,
                    *,
                    first: int = first,
                    first_faces: IntArray = first_faces,
                    scene: EmbreeScene = scene,
                ) -> None:
                    band = slice(start, stop)
                    part = nearest_hits(
                        scene, first_faces, rays.where(band), cull=cull_back_faces, threads=1
                    )
                    _merge(found.where(band), firsts[band], part, first)

                run_bands(look, len(rays), band=_RAYS_A_BAND, threads=self._threads)
        refine = refiner(self._high, self._frame)

        def work(start: int, stop: int) -> None:
            refine(found.where(slice(start, stop)), rays.where(slice(start, stop)))

        run_bands(work, len(rays), band=_RAYS_A_BAND, threads=self._threads)
        return found

    def _chunks(self) -> Iterator[tuple[int, IntArray, IntArray]]:
        """Yield the first face of each chunk, its quads, and the first face of each in the chunk.

        Quads are those of the whole mesh: one that the end of a chunk may cut goes to the next.
        """
        faces, first = self._high.faces, 0
        while first < len(faces):
            stop = min(first + self._chunk_faces + 1, len(faces))
            quads, first_faces = pair_faces(faces[first:stop])
            if stop < len(faces):
                quads, first_faces = quads[:-1], first_faces[:-1]
            yield first, quads, first_faces
            first += int(first_faces[-1])

    def _scene(self, quads: IntArray) -> EmbreeScene:
        """Tree over some quads, with no more vertices than from the least to the greatest."""
        low, high = int(quads.min()), int(quads.max())
        positions = self._frame.to_local(self._high.positions[low : high + 1]).astype(np.float32)
        return EmbreeScene(positions, quads - np.int32(low), self._threads)

    def cast_fans(
        self, fans: Fans, sets: npt.NDArray[np.float32], reach: Reach
    ) -> npt.NDArray[np.float32]:
        """Refuse: rays from the dense surface to itself need all of it.

        Raises
        ------
        OptionError
            Always.
        """
        raise OptionError(
            f"max-memory: {self._high.name} is cast at in chunks, and ambient occlusion, bent "
            "normals and thickness need all of it at once; bake them without --max-memory"
        )

    def close(self) -> None:
        """Do nothing: no tree is kept."""


def _merge(
    found: Found,
    firsts: npt.NDArray[np.float32],
    part: tuple[Found, npt.NDArray[np.float32]],
    first_face: int,
) -> None:
    """Take over, in place, what lies nearer in the next chunk, which begins at a face."""
    hits, nearest = part
    nearer = nearest < firsts
    firsts[nearer] = nearest[nearer]
    found.passed_back[nearer] = hits.passed_back[nearer]
    taken = hits.faces != NO_HIT
    taken &= (found.faces == NO_HIT) | (hits.distances < found.distances)
    found.faces[taken] = hits.faces[taken] + first_face
    found.distances[taken] = hits.distances[taken]
