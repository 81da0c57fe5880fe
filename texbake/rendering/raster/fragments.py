"""Merging the samples of each pixel into fragments, one per visible triangle (multisampling).

Fragments are what gets shaded. A pixel inside one triangle yields a single fragment at the pixel's
center that stands for all its samples. A pixel at an edge yields one fragment per triangle, at the
mean position of the samples that see it. Edges are antialiased this way, and pixels without an edge
are shaded once.

Kernels: `core/multisampling.c`, `core/perspective_weights.c`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.rendering.raster.world import World


@dataclass(frozen=True, eq=False)
class FragmentRows:
    """Fragments of some rows of pixels, sorted by object and then by pixel."""

    faces: IntArray  # (n,): triangle of the world
    # (n, 2): column and row in pixels, (0, 0) at the upper left corner of the picture
    places: npt.NDArray[np.float32]
    pixels: IntArray  # (n,): row and column of the pixel as one number, row * width + column
    counts: npt.NDArray[np.float32]  # (n,): number of the pixel's samples that the fragment covers
    # (O + 1,): fragments of object k are at starts[k] to starts[k + 1]
    starts: npt.NDArray[np.int64]
    # (rows * side, width * side): fragment of each sample, -1 where there is none
    of_samples: IntArray


def fragment_rows(
    face_ids: IntArray,
    world: World,
    rows: tuple[int, int],
    *,
    side: int,
    merges: bool = True,
    wants_samples: bool = False,
    corner: tuple[int, int] = (0, 0),
    fine: int = 1,
) -> FragmentRows:
    """Compute the fragments of some rows of pixels.

    `face_ids` (h, w) int32; `rows` (first, stop).
    """
    counts = np.zeros(world.n_objects, np.int64)
    core.count_fragments(face_ids, world.starts, side, merges, *rows, counts)
    starts = np.concatenate([[0], np.cumsum(counts)])
    n = int(starts[-1])
    shape = ((rows[1] - rows[0]) * side, face_ids.shape[1]) if wants_samples else (0, 0)
    result = FragmentRows(
        np.empty(n, np.int32),
        np.empty((n, 2), np.float32),
        np.empty(n, np.int32),
        np.empty(n, np.float32),
        starts,
        np.full(shape, -1, np.int32),
    )
    core.list_fragments(
        face_ids, world.starts, side, merges, *rows, *corner, fine, starts[:-1].copy(),
        result.faces, result.places, result.pixels, result.counts,
        result.of_samples if wants_samples else None,
    )  # fmt: skip
    return result


def weights_at(
    world: World,
    clip_from_world: FloatArray,
    width: int,
    height: int,
    face_ids: IntArray,
    places: npt.NDArray[np.float32],
    *,
    affine: bool = False,
    wants_changes: bool = False,
) -> tuple[FloatArray, npt.NDArray[np.bool_], npt.NDArray[np.float32]]:
    """Compute the barycentric weights of fragments.

    `clip_from_world` (4, 4) float64; `width`, `height`: size of the picture in pixels; `face_ids`
    (n,) int32; `places` (n, 2) float32. Returns `weights` (n, 2) float64: weights of the second and
    third corner, never below 0. Both are 0 for a triangle without area in clip space, `back_facing`
    (n,) bool: whether the triangle is seen from behind, `changes` (n, 4) float32: growth of the two
    weights for one pixel to the right, then for one pixel down.
    """
    n = len(face_ids)
    weights = np.empty((n, 2))
    back_facing = np.empty(n, np.bool_)
    changes = np.empty((n if wants_changes else 0, 4), np.float32)
    core.weigh_fragments(
        world.positions, world.faces, clip_from_world, width, height, affine, face_ids, places,
        weights, back_facing, changes if wants_changes else None,
    )  # fmt: skip
    return weights, back_facing, changes
