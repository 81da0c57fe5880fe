"""A ray becomes a hit: packets of rays to Embree, from compiled code, several threads at once."""

from __future__ import annotations

import numpy as np

from texbake.bake.embree import (
    DIRECTION,
    FACE_ID,
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
    RAY_WORDS,
    TIME,
    EmbreeScene,
    call_native,
)
from texbake.bake.found import Found, refine_kernel
from texbake.bake.hits import NO_HIT
from texbake.bake.rays import Rays
from texbake.kernels import kernel
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.parallel import resolve_threads, run_bands

_RAYS_A_BAND = 1 << 14  # a multiple of PACKET, so that packets are the same for any threads


class NativeCaster:
    """Casts packets of rays from compiled code, several threads at once."""

    def __init__(self, high: Mesh, frame: LocalFrame, *, threads: int | None = None) -> None:
        self._threads = resolve_threads(threads)
        positions = frame.to_local(high.positions).astype(np.float32)
        self._scene = EmbreeScene(positions, high.faces, self._threads)
        self._high = high
        self._frame = frame

    def cast(self, rays: Rays, *, cull_back_faces: bool = True) -> Found:
        """Find the nearest hit of each ray within its length."""
        found = Found.nothing(len(rays))
        triangles = (self._high.positions, self._high.faces, self._frame.center, self._frame.scale)
        addresses = np.array(self._scene.addresses, dtype=np.uintp)

        def cast(start: int, stop: int) -> None:
            band = slice(start, stop)
            lines = (rays.origins[band], rays.directions[band], rays.lengths[band])
            results = (found.faces[band], found.barycentrics[band], found.distances[band])
            _cast_kernel(addresses, cull_back_faces, lines, results, found.passed_back[band])
            refine_kernel(triangles, lines, results)

        run_bands(cast, len(rays), band=_RAYS_A_BAND, threads=self._threads)
        return found

    def close(self) -> None:
        """Free Embree's tree."""
        self._scene.close()


@kernel
def _cast_kernel(addresses, cull, lines, results, passed_back):  # type: ignore[no-untyped-def]
    """Cast rays in packets of `PACKET`; those that meet a back face again, one by one."""
    origins, _, lengths = lines
    faces, barycentrics, distances = results
    scene, packet_query, single_query, packet_arguments, front_arguments = addresses
    words, valid, single = _aligned(PACKET * RAY_WORDS), _aligned(PACKET), _aligned(RAY_WORDS)
    ids, valid_ids = words.view(np.int32), valid.view(np.int32)
    single_ids = single.view(np.int32)
    for first in range(0, len(origins), PACKET):
        n = min(PACKET, len(origins) - first)
        for lane in range(PACKET):
            is_ray = lane < n and lengths[first + lane] > 0.0
            valid_ids[lane] = -1 if is_ray else 0
            ids[PACKET * FACE_ID + lane] = NO_HIT
            if is_ray:
                _load_ray(words, ids, PACKET, lane, lines, first + lane)
        call_native(packet_query, valid.ctypes.data, scene, words.ctypes.data, packet_arguments)
        for lane in range(n):
            i = first + lane
            face = ids[PACKET * FACE_ID + lane]
            if face == NO_HIT:
                continue
            faces[i] = face
            distances[i] = words[PACKET * FAR + lane]
            barycentrics[i, 0] = words[PACKET * HIT_U + lane]
            barycentrics[i, 1] = words[PACKET * HIT_V + lane]
            facing = 0.0
            for axis in range(3):
                facing += (
                    words[PACKET * (NORMAL + axis) + lane]
                    * words[PACKET * (DIRECTION + axis) + lane]
                )
            passed_back[i] = facing >= 0.0
            if passed_back[i] and cull:
                _load_ray(single, single_ids, 1, 0, lines, i)
                call_native(single_query, scene, single.ctypes.data, front_arguments, 0)
                faces[i] = single_ids[FACE_ID]
                distances[i] = single[FAR]
                barycentrics[i, 0] = single[HIT_U]
                barycentrics[i, 1] = single[HIT_V]


@kernel
def _aligned(n_words):  # type: ignore[no-untyped-def]
    """Words that begin at a multiple of 64 bytes, as Embree's packets must."""
    words = np.zeros(n_words + 16, dtype=np.float32)
    skipped = (-(words.ctypes.data // 4)) % 16
    return words[skipped : skipped + n_words]


@kernel
def _load_ray(words, ids, width, lane, lines, i):  # type: ignore[no-untyped-def]
    """Write ray i into one lane of an RTCRayHit that is `width` rays wide."""
    origins, directions, lengths = lines
    for axis in range(3):
        words[width * (ORIGIN + axis) + lane] = origins[i, axis]
        words[width * (DIRECTION + axis) + lane] = directions[i, axis]
    words[width * NEAR + lane] = 0.0
    words[width * TIME + lane] = 0.0
    words[width * FAR + lane] = lengths[i]
    ids[width * MASK + lane] = -1
    ids[width * FLAGS + lane] = 0
    ids[width * FACE_ID + lane] = NO_HIT
    ids[width * GEOMETRY_ID + lane] = NO_HIT
    ids[width * INSTANCE_ID + lane] = NO_HIT
