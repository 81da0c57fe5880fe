"""Packets of 16 rays handed to Embree from compiled code: nearest hits, and fans of rays.

Based on: Wald, Woop, Benthin, Johnson, Ernst, "Embree: A Kernel Framework for Efficient CPU Ray
Tracing", 2014.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel
from texbake.raycast.embree import (
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
    call_native,
)
from texbake.raycast.fans import DEPTH, OPEN, OPEN_DIRECTION
from texbake.raycast.rays import NO_HIT

_FIRST_OPEN = OPEN_DIRECTION.start


@kernel
def nearest_hits_kernel(addresses, packet, nearest, first_faces, cull, lines, results, firsts):  # type: ignore[no-untyped-def]
    """Cast rays in packets; with culling, those that hit a back face are cast again past it."""
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
    """Store which face a lane hit; `refine_kernel` computes where on the face later."""
    faces, distances = results
    quad = query_ids[PACKET * NEAREST_QUAD + lane]
    faces[i] = NO_HIT
    distances[i] = 0.0
    if quad != NO_HIT:
        # Beyond the diagonal lies the second face, if there is one; on it, rounding decides.
        second = query_ids[PACKET * NEAREST_SECOND + lane]
        faces[i] = min(first_faces[quad] + second, first_faces[quad + 1] - 1)
        distances[i] = query[PACKET * NEAREST + lane]


@kernel
def fans_kernel(addresses, packet, directions, fans, sets, reach, results):  # type: ignore[no-untyped-def]
    """Cast fans, 16 at a time, one direction after another.

    Each row of `packet` is one field of all 16 lanes.
    """
    valid, fields, ids = packet
    points, axes, planes, set_ids = fans
    scene, valid_address, packet_address, occluded, apart, intersect, together = addresses
    offset, outer, inner = reach
    n_rays = sets.shape[1]
    frames = np.zeros((12, PACKET), dtype=np.float32)
    lane_sets = np.zeros(PACKET, dtype=np.uint32)
    sums = np.empty((4, PACKET), dtype=np.float32)
    for first in range(0, len(points), PACKET):
        n = min(PACKET, len(points) - first)
        frames_kernel(axes, planes, first, frames)
        for lane in range(PACKET):
            valid[lane] = -1 if lane < n else 0
            if lane < n:
                lane_sets[lane] = set_ids[first + lane]
        if outer > 0.0:
            _place(fields, ids, points, planes, first, offset, sums)
            for j in range(n_rays):
                directions_kernel(frames, lane_sets, sets, j, np.float32(1.0), directions)
                _set_length(fields, ids, outer)
                call_native(occluded, valid_address, scene, packet_address, apart)
                _add_open(fields, sums)
            for lane in range(n):
                results[first + lane, OPEN] = sums[0, lane] / n_rays
                for axis in range(3):
                    mean = sums[1 + axis, lane] / n_rays
                    results[first + lane, _FIRST_OPEN + axis] = (
                        mean if sums[0, lane] > 0.0 else axes[first + lane, axis]
                    )
        if inner > 0.0:
            _place(fields, ids, points, planes, first, -offset, sums)
            for j in range(n_rays):
                directions_kernel(frames, lane_sets, sets, j, np.float32(-1.0), directions)
                _set_length(fields, ids, inner)
                call_native(intersect, valid_address, scene, packet_address, together)
                for lane in range(PACKET):
                    sums[0, lane] += fields[FAR, lane]
            for lane in range(n):
                results[first + lane, DEPTH] = sums[0, lane] / n_rays


@kernel
def _place(fields, ids, points, planes, first, offset, sums):  # type: ignore[no-untyped-def]
    """Write where the rays of a packet start, and the fields that stay the same for all of them."""
    for lane in range(min(PACKET, len(points) - first)):
        for axis in range(3):
            fields[ORIGIN + axis, lane] = (
                points[first + lane, axis] + offset * planes[first + lane, axis]
            )
    for lane in range(PACKET):
        fields[NEAR, lane] = 0.0
        fields[TIME, lane] = 0.0
        ids[MASK, lane] = -1
        ids[FLAGS, lane] = 0
        for k in range(4):
            sums[k, lane] = 0.0


@kernel
def _set_length(fields, ids, length):  # type: ignore[no-untyped-def]
    """Reset the rays of a packet to their full length and to no hit."""
    for lane in range(PACKET):
        fields[FAR, lane] = length
        ids[GEOMETRY_ID, lane] = NO_HIT
        ids[INSTANCE_ID, lane] = NO_HIT


@kernel
def _add_open(fields, sums):  # type: ignore[no-untyped-def]
    """Count the rays that hit nothing, whose length Embree leaves unchanged, and sum them."""
    for lane in range(PACKET):
        free = np.float32(1.0) if fields[FAR, lane] > 0.0 else np.float32(0.0)
        sums[0, lane] += free
        for axis in range(3):
            sums[1 + axis, lane] += free * fields[DIRECTION + axis, lane]


@kernel
def frames_kernel(axes, planes, first, frames):  # type: ignore[no-untyped-def]
    """Write two tangents, the axis and the plane of fans into the columns of `frames` (12, m).

    Column i gets the frame of fan `first + i`, up to the last fan or the last column.

    Based on: Duff et al., "Building an Orthonormal Basis, Revisited", 2017.
    """
    for i in range(min(frames.shape[1], len(axes) - first)):
        x, y, z = axes[first + i, 0], axes[first + i, 1], axes[first + i, 2]
        sign = np.float32(1.0) if z >= 0.0 else np.float32(-1.0)
        a = -1.0 / (sign + z)
        b = x * y * a
        frames[0, i], frames[1, i], frames[2, i] = 1.0 + sign * x * x * a, sign * b, -sign * x
        frames[3, i], frames[4, i], frames[5, i] = b, sign + y * y * a, -y
        for k in range(3):
            frames[6 + k, i] = axes[first + i, k]
            frames[9 + k, i] = planes[first + i, k]


@kernel
def directions_kernel(frames, set_ids, sets, j, side, directions):  # type: ignore[no-untyped-def]
    """Write the j-th direction of each fan into `directions` (3, m).

    `side` is 1 for the outer rays and -1 for the inner rays, which go the opposite way. All values
    are float32, so that the loop is vectorized over the lanes of a packet.
    """
    for i in range(frames.shape[1]):
        x, y, z = sets[set_ids[i], j, 0], sets[set_ids[i], j, 1], sets[set_ids[i], j, 2]
        dx = x * frames[0, i] + y * frames[3, i] + z * frames[6, i]
        dy = x * frames[1, i] + y * frames[4, i] + z * frames[7, i]
        dz = x * frames[2, i] + y * frames[5, i] + z * frames[8, i]
        height = dx * frames[9, i] + dy * frames[10, i] + dz * frames[11, i]
        below = min(height, np.float32(0.0))
        below += below
        directions[0, i] = side * (dx - below * frames[9, i])
        directions[1, i] = side * (dy - below * frames[10, i])
        directions[2, i] = side * (dz - below * frames[11, i])
