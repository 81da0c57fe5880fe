"""Fans of rays through Embree in packets: one direction of 16 neighboring fans at a time.

Rays of one packet start beside each other and go about the same way, because the directions of all
sets are sorted alike; so they share most of their way through the tree.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.baking.embree import (
    DIRECTION,
    FAR,
    FLAGS,
    GEOMETRY_ID,
    INSTANCE_ID,
    MASK,
    NEAR,
    ORIGIN,
    PACKET,
    TIME,
    EmbreeScene,
    RayPacket,
    call_native,
)
from texbake.baking.hits import NO_HIT
from texbake.baking.secondary import (
    DEPTH,
    N_COLUMNS,
    OPEN,
    OPEN_DIRECTION,
)
from texbake.baking.secondary.fans import Fans, directions_kernel, frames_kernel
from texbake.baking.secondary.reach import Reach
from texbake.kernels import kernel
from texbake.parallel import run_bands

_FANS_A_BAND = 1 << 10  # a multiple of PACKET, so that packets are the same for any threads
_FIRST_OPEN = OPEN_DIRECTION.start


def cast_packets(
    scene: EmbreeScene,
    fans: Fans,
    sets: npt.NDArray[np.float32],
    reach: Reach,
    threads: int,
) -> npt.NDArray[np.float32]:
    """Cast all rays of the fans; (n, N_COLUMNS) float32, the columns of `texbake.baking.secondary`.

    Lengths are local.

    Parameters
    ----------
    sets : (S, n_rays, 3) float32
        As `direction_sets` makes them.
    """
    results = np.full((len(fans), N_COLUMNS), np.nan, dtype=np.float32)
    set_ids = fans.set_ids & np.uint32(len(sets) - 1)

    def cast(start: int, stop: int) -> None:
        band = slice(start, stop)
        packet = RayPacket()
        fields = packet.words.reshape(-1, PACKET)
        _packets_kernel(
            scene.secondary_addresses(packet),
            (packet.valid, fields, packet.ids.reshape(-1, PACKET)),
            fields[DIRECTION : DIRECTION + 3],
            (fans.points[band], fans.axes[band], fans.planes[band], set_ids[band]),
            sets,
            (reach.offset, reach.outer, reach.inner),
            results[band],
        )

    run_bands(cast, len(fans), band=_FANS_A_BAND, threads=threads)
    return results


@kernel
def _packets_kernel(addresses, packet, directions, fans, sets, reach, results):  # type: ignore[no-untyped-def]
    """Cast all directions of 16 fans after another; a row of a packet is a field of all lanes."""
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
    """Write where the rays of a packet start, and what is the same for all of them."""
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
    """Give the rays of a packet their length again, and no hit."""
    for lane in range(PACKET):
        fields[FAR, lane] = length
        ids[GEOMETRY_ID, lane] = NO_HIT
        ids[INSTANCE_ID, lane] = NO_HIT


@kernel
def _add_open(fields, sums):  # type: ignore[no-untyped-def]
    """Count the rays that met nothing, whose length Embree left as it was, and add them up."""
    for lane in range(PACKET):
        free = np.float32(1.0) if fields[FAR, lane] > 0.0 else np.float32(0.0)
        sums[0, lane] += free
        for axis in range(3):
            sums[1 + axis, lane] += free * fields[DIRECTION + axis, lane]
