"""Exact hits: no ray slips between two triangles that touch, whatever float32 rounds.

Embree's robust mode still lets a few rays through that are aimed at a vertex, and whether it takes
a ray that passes just beside a face for a hit depends on the boxes of its tree. So two things
follow after `RayScene.cast`:

1. `drop_uncertain_hits` turns hits too close to an edge for float32 to decide into misses, a few in
   ten thousand.
2. `retry_misses` tests all misses against the triangles exactly. The rays are put into a small
   tree of boxes and every triangle is tested against that, so that no second ray tree over the mesh
   is needed.

A ray that misses after both passes through a real hole of the mesh.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.parallel import run_bands
from texbake.raycast.moller_trumbore import EDGE_ERROR, drop_uncertain_kernel, refine_kernel
from texbake.raycast.rays import NO_HIT, RayHits, Rays
from texbake.raycast.watertight import (
    CELLS,
    boxes_kernel,
    curve_kernel,
    mark_kernel,
    retry_kernel,
)

# Triangles down to this fraction of the usual thickness are tested for hits near their edges.
_SLIVER = 0.1
_RAYS_PER_TREE = 1 << 15
_MAX_PIECES = 64  # per ray
_TRIANGLE_BANDS = 16


def drop_uncertain_hits(
    hits: RayHits, rays: Rays, mesh: Mesh, frame: LocalFrame, threads: int | None
) -> int:
    """Turn hits whose ray passes an edge of its face too closely into misses, in place.

    Returns
    -------
    int
        How many hits were dropped.
    """
    n_misses = int(np.count_nonzero(hits.faces == NO_HIT))
    # In barycentrics. Only hits nearer to an edge are computed again, since fetching the corners of
    # a face from memory takes longer than the test.
    usual = 1.0 / math.sqrt(max(mesh.n_faces, 1))
    farthest = float(rays.lengths.max(initial=0.0)) + usual
    near_edge = min(2.0 * EDGE_ERROR * farthest / (_SLIVER * usual), 1.0)
    triangles = (mesh.positions, mesh.faces, frame.center, frame.scale)

    def drop(start: int, stop: int) -> None:
        band = slice(start, stop)
        drop_uncertain_kernel(
            triangles,
            (rays.origins[band], rays.directions[band]),
            near_edge,
            (hits.faces[band], hits.barycentrics[band]),
            (hits.distances[band], hits.passed_back[band]),
        )

    run_bands(drop, len(rays), band=1 << 15, threads=threads)
    return int(np.count_nonzero(hits.faces == NO_HIT)) - n_misses


def retry_misses(
    rays: Rays,
    mesh: Mesh,
    frame: LocalFrame,
    *,
    cull_back_faces: bool,
    threads: int | None = None,
) -> RayHits:
    """Find the first hit of each ray exactly, by testing every triangle against every ray near it.

    The time is proportional to the number of triangles, and hardly depends on the rays as long as
    there are few of them. The result is that of `RayScene.cast`, without its misses at vertices
    and edges.
    """
    hits = RayHits.misses(len(rays))
    triangles = (mesh.positions, mesh.faces, frame.center, frame.scale)
    for first in range(0, len(rays), _RAYS_PER_TREE):
        part = slice(first, first + _RAYS_PER_TREE)
        lines = (rays.origins[part], rays.directions[part], rays.lengths[part])
        hits.faces[part], hits.barycentrics[part], hits.distances[part], back = _nearest(
            triangles, lines, cull_back_faces, threads
        )
        # Compared before refining, which changes the last bits of a distance.
        end = np.where(hits.faces[part] == NO_HIT, lines[2], hits.distances[part])
        hits.passed_back[part] = back <= end
        refine_kernel(
            triangles,
            lines,
            (hits.faces[part], hits.barycentrics[part], hits.distances[part]),
        )
    return hits


def _nearest(
    triangles: tuple[FloatArray, IntArray, FloatArray, float],
    lines: tuple[FloatArray, FloatArray, FloatArray],
    cull: bool,
    threads: int | None,
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """First face hit, its barycentrics and distance, and the distance of the first back face."""
    n_rays, n_faces = len(lines[0]), len(triangles[1])
    tree = _tree_over_pieces(lines, typical_edge=1.0 / np.sqrt(n_faces))
    marked = np.zeros((CELLS, CELLS, CELLS), dtype=np.bool_)
    mark_kernel(tree[0][len(tree[0]) // 2 :][: len(tree[1])], marked)
    axes = np.abs(lines[1]).argmax(axis=1)
    # Each band of triangles has its own results; the bands do not depend on the threads.
    faces = np.full((_TRIANGLE_BANDS, n_rays), NO_HIT, dtype=np.int32)
    barycentrics = np.zeros((_TRIANGLE_BANDS, n_rays, 2))
    distances = np.full((_TRIANGLE_BANDS, n_rays), np.inf)
    backs = np.full((_TRIANGLE_BANDS, n_rays), np.inf)
    edges = np.linspace(0, n_faces, _TRIANGLE_BANDS + 1).astype(np.int64)

    def test(start: int, stop: int) -> None:
        for band in range(start, stop):
            results = (faces[band], barycentrics[band], distances[band], backs[band])
            retry_kernel(
                triangles, edges[band : band + 2], lines, axes, tree, marked, cull, results
            )

    run_bands(test, _TRIANGLE_BANDS, band=1, threads=threads)
    # The first band, and so the lowest face, where several are equally near.
    best = distances.argmin(axis=0)
    chosen = (best, np.arange(n_rays))
    hit = faces[chosen] != NO_HIT
    return (
        faces[chosen],
        barycentrics[chosen],
        np.where(hit, distances[chosen], 0.0),
        backs.min(axis=0),
    )


def _tree_over_pieces(
    lines: tuple[FloatArray, FloatArray, FloatArray], typical_edge: float
) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Boxes of a complete binary tree over pieces of rays, and the ray of each leaf.

    The box of a long ray is mostly empty, so rays are cut into pieces about as long as a few
    triangles. Node i has the children 2 i + 1 and 2 i + 2; leaves beyond the last piece have empty
    boxes. Boxes are (2 * n_leaves - 1, 6): minimum x, y, z, then maximum, grown by 1e-9 of the
    local frame for rounding.
    """
    lengths = lines[2]
    longest = float(lengths.max(initial=0.0))
    n_pieces = int(np.clip(longest / (8.0 * typical_edge), 1, _MAX_PIECES))
    keys = np.empty(n_pieces * len(lengths), dtype=np.uint64)
    curve_kernel(lines, n_pieces, keys)
    order = np.argsort(keys, kind="stable")
    n_leaves = 1 << (len(order) - 1).bit_length()
    boxes = np.empty((2 * n_leaves - 1, 6))
    boxes_kernel(lines, n_pieces, order, boxes)
    return boxes, order // n_pieces
