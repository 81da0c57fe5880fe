"""A ray becomes a hit: packets of rays to Embree, from compiled code, several threads at once."""

from __future__ import annotations

import numpy as np

from texbake.bake.embree import (
    DIRECTION,
    FAR,
    FLAGS,
    GEOMETRY_ID,
    HIT_U,
    HIT_V,
    INSTANCE_ID,
    MASK,
    NEAR,
    NORMAL,
    ORIGIN,
    PACKET,
    QUAD_ID,
    TIME,
    EmbreeScene,
    RayPacket,
    call_native,
)
from texbake.bake.found import Found, refine_kernel
from texbake.bake.hits import NO_HIT
from texbake.bake.quads import pair_faces
from texbake.bake.rays import Rays
from texbake.kernels import kernel
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
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
        found = Found.nothing(len(rays))
        triangles = (self._high.positions, self._high.faces, self._frame.center, self._frame.scale)

        def cast(start: int, stop: int) -> None:
            band = slice(start, stop)
            lines = (rays.origins[band], rays.directions[band], rays.lengths[band])
            packet = RayPacket()
            _cast_kernel(
                self._scene.addresses(packet),
                (packet.valid, packet.words, packet.ids),
                self._first_faces,
                cull_back_faces,
                lines,
                (found.faces[band], found.distances[band]),
                found.passed_back[band],
            )
            refine_kernel(
                triangles,
                lines,
                (found.faces[band], found.barycentrics[band], found.distances[band]),
            )

        run_bands(cast, len(rays), band=_RAYS_A_BAND, threads=self._threads)
        return found

    def close(self) -> None:
        """Free Embree's tree."""
        self._scene.close()


@kernel
def _cast_kernel(addresses, packet, first_faces, cull, lines, results, passed_back):  # type: ignore[no-untyped-def]
    """Cast rays in packets; those of a packet that meet a back face once more, past them."""
    valid, words, ids = packet
    query, scene, valid_address, words_address, any_face, front_faces = addresses
    lengths = lines[2]
    for first in range(0, len(lengths), PACKET):
        n = min(PACKET, len(lengths) - first)
        for lane in range(PACKET):
            valid[lane] = 0
            ids[PACKET * QUAD_ID + lane] = NO_HIT
            if lane < n and lengths[first + lane] > 0.0:
                valid[lane] = -1
                _load_ray(words, ids, lane, lines, first + lane)
        call_native(query, valid_address, scene, words_address, any_face)
        n_behind = 0
        for lane in range(n):
            i = first + lane
            _store_hit(words, ids, first_faces, lane, results, i)
            valid[lane] = 0
            if results[0][i] != NO_HIT and _is_behind(words, lane):
                passed_back[i] = True
                if cull:
                    n_behind += 1
                    valid[lane] = -1
                    _load_ray(words, ids, lane, lines, i)
        if n_behind > 0:
            call_native(query, valid_address, scene, words_address, front_faces)
            for lane in range(n):
                if valid[lane] != 0:
                    _store_hit(words, ids, first_faces, lane, results, first + lane)


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
    ids[PACKET * FLAGS + lane] = 0
    ids[PACKET * QUAD_ID + lane] = NO_HIT
    ids[PACKET * GEOMETRY_ID + lane] = NO_HIT
    ids[PACKET * INSTANCE_ID + lane] = NO_HIT


@kernel
def _store_hit(words, ids, first_faces, lane, results, i):  # type: ignore[no-untyped-def]
    """Keep what a lane hit; `refine_kernel` finds the place on the face that is told here."""
    faces, distances = results
    quad = ids[PACKET * QUAD_ID + lane]
    faces[i] = NO_HIT
    if quad != NO_HIT:
        u, v = words[PACKET * HIT_U + lane], words[PACKET * HIT_V + lane]
        # Beyond the diagonal lies the second face, if the quad has one; on it, by rounding, either.
        faces[i] = min(first_faces[quad] + (1 if u + v > 1.0 else 0), first_faces[quad + 1] - 1)
        distances[i] = words[PACKET * FAR + lane]


@kernel
def _is_behind(words, lane):  # type: ignore[no-untyped-def]
    """Whether the surface that a lane hit does not face its ray's start."""
    facing = 0.0
    for axis in range(3):
        facing += words[PACKET * (NORMAL + axis) + lane] * words[PACKET * (DIRECTION + axis) + lane]
    return facing >= 0.0
