"""A ray becomes a hit: packets of rays to Embree, from compiled code, several threads at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from texbake.baking.embree import (
    DIRECTION,
    FAR,
    FLAGS,
    FRONT_ONLY,
    GEOMETRY_ID,
    INSTANCE_ID,
    LANE,
    MASK,
    NEAR,
    NEAREST,
    NEAREST_BEHIND,
    NEAREST_QUAD,
    NEAREST_SECOND,
    ORIGIN,
    PACKET,
    TIME,
    EmbreeScene,
    RayPacket,
    call_native,
)
from texbake.baking.found import Found, refine_kernel
from texbake.baking.hits import NO_HIT
from texbake.baking.quads import pair_faces
from texbake.baking.rays import Rays
from texbake.baking.secondary.fans import Fans
from texbake.baking.secondary.reach import Reach
from texbake.kernels import kernel
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import IntArray, Mesh
from texbake.parallel import resolve_threads, run_bands

_RAYS_A_BAND = 1 << 14  # a multiple of PACKET, so that packets are the same for any threads


class NativeCaster:
    """Casts packets of rays from compiled code, several threads at once."""

    name = "Embree, packets"

    def __init__(self, high: Mesh, frame: LocalFrame, *, threads: int | None = None) -> None:
        self._threads = resolve_threads(threads)
        positions = frame.to_local(high.positions).astype(np.float32)
        quads, self._first_faces = pair_faces(high.faces)
        self._scene = EmbreeScene(positions, quads, self._threads)
        self._high = high
        self._frame = frame

    def cast(self, rays: Rays, *, cull_back_faces: bool = True) -> Found:
        """Find the nearest hit of each ray within its length."""
        found, _ = nearest_hits(
            self._scene,
            self._first_faces,
            rays,
            cull=cull_back_faces,
            threads=self._threads,
            refine=refiner(self._high, self._frame),
        )
        return found

    def cast_fans(
        self, fans: Fans, sets: npt.NDArray[np.float32], reach: Reach
    ) -> npt.NDArray[np.float32]:
        """Cast all rays of fans; see `packets.cast_packets`."""
        from texbake.baking.secondary.packets import cast_packets

        return cast_packets(self._scene, fans, sets, reach, self._threads)

    def close(self) -> None:
        """Free Embree's tree."""
        self._scene.close()


def nearest_hits(
    scene: EmbreeScene,
    first_faces: IntArray,
    rays: Rays,
    *,
    cull: bool,
    threads: int,
    refine: Callable[[Found, Rays], None] | None = None,
) -> tuple[Found, npt.NDArray[np.float32]]:
    """Nearest hit of each ray in a scene, in float32; of equally near faces it is the first.

    Parameters
    ----------
    first_faces : (Q + 1,) int32
        Of the quads of the scene, as `pair_faces` gives them.
    refine
        Told of each band of rays and what they found, right after it was cast.

    Returns
    -------
    found : Found
        Without barycentrics.
    firsts : (n,) float32
        Distance of the nearest hit from either side; infinite where there is none.
    """
    found = Found.nothing(len(rays))
    firsts = np.full(len(rays), np.inf, dtype=np.float32)

    def cast(start: int, stop: int) -> None:
        band = slice(start, stop)
        packet = RayPacket()
        lines = rays.where(band)
        hits = found.where(band)
        _cast_kernel(
            scene.addresses(packet),
            (packet.valid, packet.words, packet.ids),
            (packet.query, packet.query_ids),
            first_faces,
            cull,
            (lines.origins, lines.directions, lines.lengths),
            (hits.faces, hits.distances),
            (hits.passed_back, firsts[band]),
        )
        if refine is not None:
            refine(hits, lines)

    run_bands(cast, len(rays), band=_RAYS_A_BAND, threads=threads)
    return found, firsts


def refiner(high: Mesh, frame: LocalFrame) -> Callable[[Found, Rays], None]:
    """Return what finds where rays meet the faces that were found, in place."""
    triangles = (high.positions, high.faces, frame.center, frame.scale)

    def refine(found: Found, rays: Rays) -> None:
        refine_kernel(
            triangles,
            (rays.origins, rays.directions, rays.lengths),
            (found.faces, found.barycentrics, found.distances),
        )

    return refine


@kernel
def _cast_kernel(addresses, packet, nearest, first_faces, cull, lines, results, firsts):  # type: ignore[no-untyped-def]
    """Cast rays in packets; those of a packet that meet a back face once more, past them."""
    valid, words, ids = packet
    query, query_ids = nearest
    function, scene, valid_address, words_address, arguments = addresses
    passed_back, first_distances = firsts
    lengths = lines[2]
    for first in range(0, len(lengths), PACKET):
        n = min(PACKET, len(lengths) - first)
        query_ids[FRONT_ONLY] = 0
        for lane in range(PACKET):
            valid[lane] = 0
            if lane < n and lengths[first + lane] > 0.0:
                valid[lane] = -1
                _load_ray(words, ids, lane, lines, first + lane)
            query_ids[PACKET * NEAREST_QUAD + lane] = NO_HIT
            query[PACKET * NEAREST + lane] = np.inf
        call_native(function, valid_address, scene, words_address, arguments)
        n_behind = 0
        for lane in range(n):
            i = first + lane
            _store_hit(query, query_ids, first_faces, lane, results, i)
            valid[lane] = 0
            if results[0][i] != NO_HIT:
                first_distances[i] = query[PACKET * NEAREST + lane]
                if query_ids[PACKET * NEAREST_BEHIND + lane] != 0:
                    passed_back[i] = True
                    if cull:
                        n_behind += 1
                        valid[lane] = -1
                        _load_ray(words, ids, lane, lines, i)
                        query_ids[PACKET * NEAREST_QUAD + lane] = NO_HIT
                        query[PACKET * NEAREST + lane] = np.inf
        if n_behind > 0:
            query_ids[FRONT_ONLY] = 1
            call_native(function, valid_address, scene, words_address, arguments)
            for lane in range(n):
                if valid[lane] != 0:
                    _store_hit(query, query_ids, first_faces, lane, results, first + lane)


@kernel
def _load_ray(words, ids, lane, lines, i):  # type: ignore[no-untyped-def]
    """Write ray i into one lane of a packet, without a hit."""
    origins, directions, lengths = lines
    for axis in range(3):
        words[PACKET * (ORIGIN + axis) + lane] = origins[i, axis]
        words[PACKET * (DIRECTION + axis) + lane] = directions[i, axis]
    words[PACKET * NEAR + lane] = 0.0
    words[PACKET * TIME + lane] = 0.0
    words[PACKET * FAR + lane] = lengths[i]
    ids[PACKET * MASK + lane] = -1
    ids[PACKET * LANE + lane] = lane
    ids[PACKET * FLAGS + lane] = 0
    ids[PACKET * GEOMETRY_ID + lane] = NO_HIT
    ids[PACKET * INSTANCE_ID + lane] = NO_HIT


@kernel
def _store_hit(query, query_ids, first_faces, lane, results, i):  # type: ignore[no-untyped-def]
    """Keep what a lane hit; `refine_kernel` finds the place on the face that is told here."""
    faces, distances = results
    quad = query_ids[PACKET * NEAREST_QUAD + lane]
    faces[i] = NO_HIT
    distances[i] = 0.0
    if quad != NO_HIT:
        # Beyond the diagonal lies the second face, if the quad has one; on it, by rounding, either.
        second = query_ids[PACKET * NEAREST_SECOND + lane]
        faces[i] = min(first_faces[quad] + second, first_faces[quad + 1] - 1)
        distances[i] = query[PACKET * NEAREST + lane]
