"""Merging the samples of each pixel into fragments, one per visible triangle (multisampling).

Fragments are what gets shaded. A pixel inside one triangle yields a single fragment at the pixel's
center that stands for all its samples. A pixel at an edge yields one fragment per triangle, at the
mean position of the samples that see it. Edges are antialiased this way, and pixels without an edge
are shaded once.

Based on: Akeley, "RealityEngine graphics", SIGGRAPH 1993, for multisampling; Olano and Greer,
"Triangle scan conversion using 2D homogeneous coordinates", Graphics Hardware 1997: barycentric
weights are computed from the corners in clip space, so they are correct in perspective and the
triangle need not be clipped.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.rendering.raster.clip import to_clip
from texbake.rendering.raster.world import World, object_of

# Number of a pixel's triangles that a sample is compared with. A triangle that is seen again after
# more others than this gets a second fragment, which costs time and changes nothing else.
_REMEMBERED = 8


@dataclass(frozen=True, eq=False)
class FragmentRows:
    """Fragments of some rows of pixels, sorted by object and then by pixel.

    Attributes
    ----------
    faces : (n,) int32
        Triangle of the world.
    places : (n, 2) float32
        Column and row in pixels, (0, 0) at the upper left corner of the picture.
    pixels : (n,) int32
        Row and column of the pixel as one number, row * width + column.
    counts : (n,) float32
        Number of the pixel's samples that the fragment covers.
    starts : (O + 1,) int64
        Fragments of object k are at starts[k] to starts[k + 1].
    of_samples : (rows * side, width * side) int32, optional
        Fragment of each sample, -1 where there is none.
    """

    faces: IntArray
    places: npt.NDArray[np.float32]
    pixels: IntArray
    counts: npt.NDArray[np.float32]
    starts: npt.NDArray[np.int64]
    of_samples: IntArray


@kernel
def _pixel(face_ids, row, column, side, merges, found, sums):  # type: ignore[no-untyped-def]
    """Collect the triangles of a pixel in `found`, with sample counts and summed positions."""
    n_found = 0
    for j in range(row * side, (row + 1) * side):
        for i in range(column * side, (column + 1) * side):
            face = face_ids[j, i]
            if face < 0:
                continue
            k = n_found - 1
            last = max(n_found - _REMEMBERED, 0) if merges else n_found
            while k >= last and found[k] != face:
                k -= 1
            if k < last:
                k = n_found
                found[k] = face
                sums[k, 0], sums[k, 1], sums[k, 2] = 0.0, 0.0, 0.0
                n_found += 1
            sums[k, 0] += 1.0
            sums[k, 1] += i + 0.5
            sums[k, 2] += j + 0.5
    return n_found


@kernel
def _is_plain(face_ids, row, column, side, merges):  # type: ignore[no-untyped-def]
    """Whether all samples of a pixel see the same triangle, or none does."""
    face = face_ids[row * side, column * side]
    if side == 1:
        return True
    for j in range(row * side, (row + 1) * side):
        for i in range(column * side, (column + 1) * side):
            if face_ids[j, i] != face:
                return False
    return merges or face < 0


@kernel
def _count_kernel(face_ids, starts, side, merges, first_row, stop_row, counts):  # type: ignore[no-untyped-def]
    found = np.empty(side * side, np.int32)
    sums = np.empty((side * side, 3))
    for row in range(first_row, stop_row):
        for column in range(face_ids.shape[1] // side):
            if _is_plain(face_ids, row, column, side, merges):
                face = face_ids[row * side, column * side]
                if face >= 0:
                    counts[object_of(face, starts)] += 1
                continue
            n_found = _pixel(face_ids, row, column, side, merges, found, sums)
            for k in range(n_found):
                counts[object_of(found[k], starts)] += 1


@kernel
def _fill_kernel(  # type: ignore[no-untyped-def]
    face_ids, starts, side, merges, first_row, stop_row, nexts, wants_samples,
    faces, places, pixels, sample_counts, of_samples,
):  # fmt: skip
    found = np.empty(side * side, np.int32)
    slots = np.empty(side * side, np.int64)
    sums = np.empty((side * side, 3))
    width = face_ids.shape[1] // side
    for row in range(first_row, stop_row):
        for column in range(width):
            if _is_plain(face_ids, row, column, side, merges):
                found[0] = face_ids[row * side, column * side]
                n_found = 1 if found[0] >= 0 else 0
                sums[0, 0], sums[0, 1], sums[0, 2] = side * side, column + 0.5, row + 0.5
            else:
                n_found = _pixel(face_ids, row, column, side, merges, found, sums)
                for k in range(n_found):
                    sums[k, 1] /= sums[k, 0] * side
                    sums[k, 2] /= sums[k, 0] * side
            for k in range(n_found):
                owner = object_of(found[k], starts)
                slot = nexts[owner]
                nexts[owner] += 1
                slots[k] = slot
                faces[slot] = found[k]
                pixels[slot] = row * width + column
                sample_counts[slot] = sums[k, 0]
                places[slot, 0], places[slot, 1] = sums[k, 1], sums[k, 2]
            if wants_samples:
                first = 0
                for j in range(row * side, (row + 1) * side):
                    for i in range(column * side, (column + 1) * side):
                        if face_ids[j, i] < 0:
                            continue
                        k = first
                        while found[k] != face_ids[j, i]:
                            k += 1
                        of_samples[j - first_row * side, i] = slots[k]
                        if not merges:  # the next sample is the next fragment
                            first = k + 1


def fragment_rows(
    face_ids: IntArray,
    world: World,
    rows: tuple[int, int],
    *,
    side: int,
    merges: bool = True,
    wants_samples: bool = False,
) -> FragmentRows:
    """Compute the fragments of some rows of pixels.

    Parameters
    ----------
    face_ids : (h, w) int32
        Triangle that each sample of the picture sees.
    world
        The triangles of the scene.
    rows : (first, stop)
        Range of pixel rows.
    side
        Samples along one side of a pixel.
    merges
        Merge the samples of a pixel that see the same triangle into one fragment.
    wants_samples
        Fill `of_samples`; otherwise it is empty.
    """
    counts = np.zeros(world.n_objects, np.int64)
    _count_kernel(face_ids, world.starts, side, merges, *rows, counts)
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
    _fill_kernel(
        face_ids, world.starts, side, merges, *rows, starts[:-1].copy(), wants_samples,
        result.faces, result.places, result.pixels, result.counts, result.of_samples,
    )  # fmt: skip
    return result


@kernel
def corner_edges(positions, corners, matrix, affine, sx, sy, clip, edges):  # type: ignore[no-untyped-def]
    """Write the barycentric weight of each corner as a linear function of column and row.

    `edges` (3, 3) receives the coefficients of x, y and 1, up to a common factor: determinants of
    two corners in clip space and the position. Nothing is divided by w, so w may have any sign.
    `sx` and `sy` are the width and height of a pixel in clip space.
    """
    for k in range(3):
        to_clip(matrix, positions[corners[k]], clip[k])
    if affine and clip[0, 3] > 0.0 and clip[1, 3] > 0.0 and clip[2, 3] > 0.0:
        for k in range(3):
            clip[k, 0], clip[k, 1] = clip[k, 0] / clip[k, 3], clip[k, 1] / clip[k, 3]
            clip[k, 3] = 1.0
    # Clip space from columns and rows: x of pixel 0 is -1, y of row 0 is 1.
    for k in range(3):
        b, c = clip[(k + 1) % 3], clip[(k + 2) % 3]
        along_x = b[1] * c[3] - b[3] * c[1]
        along_y = b[3] * c[0] - b[0] * c[3]
        edges[k, 0] = along_x * sx
        edges[k, 1] = -along_y * sy
        edges[k, 2] = b[0] * c[1] - b[1] * c[0] - along_x + along_y


@kernel
def _weights_kernel(  # type: ignore[no-untyped-def]
    positions, faces, matrix, width, height, affine, wants_changes,
    face_ids, places, weights, back_facing, changes,
):  # fmt: skip
    clip, e = np.empty((3, 4)), np.empty((3, 3))
    known = np.int32(-1)  # neighbors mostly see the same triangle
    for i in range(len(face_ids)):
        if face_ids[i] != known:
            known = face_ids[i]
            corner_edges(
                positions, faces[known], matrix, affine, 2.0 / width, 2.0 / height, clip, e
            )
        x, y = np.float64(places[i, 0]), np.float64(places[i, 1])
        weight0 = e[0, 0] * x + e[0, 1] * y + e[0, 2]
        weight1 = e[1, 0] * x + e[1, 1] * y + e[1, 2]
        weight2 = e[2, 0] * x + e[2, 1] * y + e[2, 2]
        sign = -1.0 if weight0 + weight1 + weight2 < 0.0 else 1.0
        back_facing[i] = sign < 0.0
        # Snapping moves edges by up to half a grid step, so a position may lie just outside.
        weight0, weight1, weight2 = (
            max(sign * weight0, 0.0), max(sign * weight1, 0.0), max(sign * weight2, 0.0),
        )  # fmt: skip
        total = weight0 + weight1 + weight2
        scale = 1.0 / total if 0.0 < total < np.inf else 0.0
        weights[i, 0], weights[i, 1] = weight1 * scale, weight2 * scale
        if wants_changes:
            for axis in range(2):
                slope = sign * (e[0, axis] + e[1, axis] + e[2, axis])
                changes[i, 2 * axis] = (sign * e[1, axis] - weights[i, 0] * slope) * scale
                changes[i, 2 * axis + 1] = (sign * e[2, axis] - weights[i, 1] * slope) * scale


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

    Parameters
    ----------
    world
        The triangles of the scene.
    clip_from_world : (4, 4) float64
        Matrix of the camera.
    width, height
        Size of the picture in pixels.
    face_ids : (n,) int32
    places : (n, 2) float32
        As in `FragmentRows`.
    affine
        Interpolate linearly on the screen, which is wrong in perspective. Triangles that extend
        behind the camera are still interpolated correctly.
    wants_changes
        Compute `changes`; otherwise it is empty.

    Returns
    -------
    weights : (n, 2) float64
        Weights of the second and third corner, never below 0. Both are 0 for a triangle without
        area in clip space.
    back_facing : (n,) bool
        Whether the triangle is seen from behind.
    changes : (n, 4) float32
        Growth of the two weights for one pixel to the right, then for one pixel down.
    """
    n = len(face_ids)
    weights = np.empty((n, 2))
    back_facing = np.empty(n, np.bool_)
    changes = np.empty((n if wants_changes else 0, 4), np.float32)
    _weights_kernel(
        world.positions, world.faces, clip_from_world, float(width), float(height), affine,
        wants_changes, face_ids, places, weights, back_facing, changes,
    )  # fmt: skip
    return weights, back_facing, changes
