"""How much of each texel the low-poly mesh covers, and where in each texel its samples lie.

A texel is covered wholly or not at all, except where the outline of a chart passes through it:
there each of its `FINE` x `FINE` sub-squares is tested.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from texbake.baking.texels import NO_FACE, UNIT, SampleGrid, Samples, snap_uvs
from texbake.core import core
from texbake.mesh.mesh import BoolArray, ByteArray, FloatArray, Int64Array, IntArray, Mesh
from texbake.parallel import run_bands

FINE = 8  # sub-squares along one side of a texel
FULL = FINE * FINE
TEXEL = FINE * UNIT  # units of the fixed-point grid in a texel
BIN = 8  # texels along one side of the squares that share a list of faces

N_CHECK_SAMPLES, _GENERATOR = 13, 8  # two consecutive Fibonacci numbers


class FaceBins(NamedTuple):
    """Faces of the low-poly mesh, listed for each square of texels that they overlap."""

    # (F, 3, 2) int64; x to the right and y down, in units of which `TEXEL` make up a texel.
    corners: Int64Array
    # (bins + 1,) int64; where the faces of each square, or bin, begin.
    firsts: Int64Array
    faces: IntArray  # (n,) int32; in their own order within each bin
    n_columns: int  # bins side by side

    @classmethod
    def of(cls, low: Mesh, width: int, height: int) -> FaceBins:
        """Sort the faces of a low-poly mesh into the bins of a map, by `core/edge_functions.c`."""
        corners = snap_uvs(low, SampleGrid(width, height, FINE)).corners
        n_rows, n_columns = -(-height // BIN), -(-width // BIN)
        firsts = np.zeros(n_rows * n_columns + 1, dtype=np.int64)
        core.bin_faces(corners, n_rows, n_columns, firsts, None)
        firsts = np.concatenate([[0], np.cumsum(firsts[:-1])])
        faces = np.empty(int(firsts[-1]), dtype=np.int32)
        core.bin_faces(corners, n_rows, n_columns, firsts.copy(), faces)
        return cls(corners, firsts, faces, n_columns)


class TexelCoverage(NamedTuple):
    """How much of each texel is covered."""

    # (n_texels,) uint8; covered sub-squares, out of `FULL`; at least 1 where the center is covered.
    counts: ByteArray
    # (n_texels,) int64; covered sub-squares of partly covered texels, one bit each, row by row from
    # bit 0.
    masks: Int64Array

    @classmethod
    def none(cls, n_texels: int) -> TexelCoverage:
        """Return a coverage of nothing."""
        return cls(np.zeros(n_texels, dtype=np.uint8), np.zeros(n_texels, dtype=np.int64))

    def measure(
        self, bins: FaceBins, owners: IntArray, outlined: BoolArray, rows: range,
        threads: int | None,
    ) -> None:  # fmt: skip
        """Fill in rows of texels by their owners and outlines, in `core/edge_functions.c`."""
        width = owners.shape[1]
        band = slice(rows.start * width, rows.stop * width)
        counts, masks = self.counts[band], self.masks[band]
        flat = owners.reshape(-1)
        np.multiply(flat != NO_FACE, np.uint8(FULL), out=counts)
        texels = np.flatnonzero(outlined[rows.start : rows.stop])

        def measure(start: int, stop: int) -> None:
            core.write_masks(*bins, rows.start, width, texels[start:stop], flat, counts, masks)

        run_bands(measure, len(texels), band=1 << 12, threads=threads)


def outlined_texels(bins: FaceBins, width: int, height: int) -> BoolArray:
    """(height, width) bool: texels that an open edge passes through; `core/edge_functions.c`."""
    outlined = np.zeros((height, width), dtype=np.bool_)
    core.mark_lines(_outlines(bins.corners), outlined)
    return outlined


def _outlines(corners: Int64Array) -> Int64Array:
    """(E, 2, 2) edges that no face with an area has in the opposite direction."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    doubled = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    oriented = np.where((doubled < 0)[:, np.newaxis, np.newaxis], corners[:, ::-1], corners)
    oriented = oriented[doubled != 0]
    # Coordinates are within 2^29 of the origin, so that both of a point fit into one number.
    keys = (oriented[..., 0] << 31) + oriented[..., 1]
    points, ids = np.unique(keys, return_inverse=True)
    ids = ids.reshape(-1, 3).astype(np.int64)
    ends = np.roll(ids, -1, axis=1)
    n = len(points)
    is_outline = ~np.isin(ids * n + ends, ends * n + ids)
    edges = np.stack([oriented, np.roll(oriented, -1, axis=1)], axis=2)
    return np.ascontiguousarray(edges[is_outline])


# Places, texels and spots of cells.
SampledCells = tuple[IntArray, IntArray, ByteArray]


def cell_samples(
    bins: FaceBins,
    coverage: TexelCoverage,
    level: int,
    centers: IntArray,
    cells: SampledCells,
    *,
    threads: int | None,
) -> tuple[IntArray, Samples]:
    """Place the samples of some cells of one level, and find the faces that they lie on.

    `centers` (height, width) int32: faces that own the centers of texels; `cells`: places, texels
    and spots. Returns (n,) int32, the cells that a face covers, and their samples. Kernel:
    `core/quadtree.c`.
    """
    places, texels, spots = cells
    owners = np.empty(len(places), dtype=np.int32)
    weights = np.empty((len(places), 2))

    def fill(start: int, stop: int) -> None:
        core.write_cell_samples(
            *bins, *coverage, level, centers.shape[1], centers.reshape(-1),
            texels[start:stop], spots[start:stop], owners[start:stop], weights[start:stop],
        )  # fmt: skip

    run_bands(fill, len(places), band=1 << 16, threads=threads)
    samples, is_owned = Samples(texels, owners, weights), owners != NO_FACE
    if is_owned.all():
        return places, samples
    return places[is_owned], samples.where(is_owned)


def find_owners(bins: FaceBins, points: Int64Array) -> tuple[IntArray, FloatArray]:
    """Find the first face that owns each point (n, 2), in 1 / `TEXEL` of a texel.

    Returns `owners` (n,) int32, or `NO_FACE`; `weights` (n, 2) float64 of the second and third
    corner. Kernel: `core/edge_functions.c`.
    """
    owners, weights = np.empty(len(points), dtype=np.int32), np.empty((len(points), 2))
    core.find_owners(*bins, points, owners, weights)
    return owners, weights


def check_samples(bins: FaceBins, width: int, texels: Int64Array) -> tuple[Int64Array, Samples]:
    """Place the `N_CHECK_SAMPLES` of some texels on a Fibonacci lattice, with (n,) ranks of texels.

    Based on: Sloan, Joe, "Lattice Methods for Multiple Integration", Oxford 1994, section 4.3.
    """
    across = np.arange(N_CHECK_SAMPLES)
    lattice = np.stack([across, _GENERATOR * across % N_CHECK_SAMPLES], axis=1)
    within = (2 * lattice + 1) * TEXEL // (2 * N_CHECK_SAMPLES)
    corners = TEXEL * np.stack([texels % width, texels // width], axis=1)
    points = (corners[:, np.newaxis] + within).reshape(-1, 2)
    owners, weights = find_owners(bins, points)
    ranks = np.repeat(np.arange(len(texels)), N_CHECK_SAMPLES)
    is_owned = owners != NO_FACE
    return ranks[is_owned], Samples(texels[ranks].astype(np.int32), owners, weights).where(is_owned)
