"""Texels divided into quarters, and those again, where samples beside each other disagree.

A cell of level k is a square of which 4^k make a texel, with one sample at its center. Cells of
level 0 are the texels, all of them; a cell that is divided has four children on the next level, and
those that are not divided make up the value of their texel, each by its area.

Based on: Whitted, "An Improved Illumination Model for Shaded Display", Communications of the ACM
23(6), 1980: samples are added where those at hand disagree. Departs from it by samples at the
centers of cells, which are exact where values change evenly, and by a bound for the whole texel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.bake.texels import NO_FACE, SampleGrid, Samples, SnappedFaces, write_weights
from texbake.kernels import kernel
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands

LAST_LEVEL = 3  # 64 cells a texel
COVERAGE_SIDE = 4  # samples a side that tell how much of a texel is covered
NO_CHART = -1

FloatArray32 = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Level:
    """The cells of one level; those of one parent, and of one texel, lie together.

    Attributes
    ----------
    ids : (n,) int64
        Row times columns plus column, in the grid of the level.
    charts : (n,) int32
        Chart of the light mesh that the sample lies in, `NO_CHART` where it has no value.
    values : (n, C) float32
        The sample's values, of all maps beside each other.
    first_children : (n,) int32
        Place of the first of four children on the next level, -1 for none.
    """

    ids: npt.NDArray[np.int64]
    charts: IntArray
    values: FloatArray32
    first_children: IntArray

    @classmethod
    def of(cls, ids: npt.NDArray[np.int64], n_channels: int) -> Level:
        """Cells without values or children."""
        n = len(ids)
        return cls(
            ids,
            np.full(n, NO_CHART, dtype=np.int32),
            np.zeros((n, n_channels), dtype=np.float32),
            np.full(n, -1, dtype=np.int32),
        )


class TexelState:
    """What is known of each texel (n,) while its cells are divided.

    Attributes
    ----------
    covered : uint8
        How many of `COVERAGE_SIDE`^2 samples a face owns.
    has_value : bool
        Whether any sample so far has a value.
    leaves : uint8
        Cells that the texel is divided into.
    errors : float32
        Estimated error from the cells that will not be divided, in bounds.
    finest : uint8
        The finest level that the texel has cells of.
    """

    def __init__(self, n_texels: int) -> None:
        self.covered = np.zeros(n_texels, dtype=np.uint8)
        self.has_value = np.zeros(n_texels, dtype=np.bool_)
        self.leaves = np.ones(n_texels, dtype=np.uint8)
        self.errors = np.zeros(n_texels, dtype=np.float32)
        self.finest = np.zeros(n_texels, dtype=np.uint8)


def count_covered(owners: IntArray, width: int, threads: int | None) -> npt.NDArray[np.uint8]:
    """How many samples of each texel are owned, from owners of `COVERAGE_SIDE` a side."""
    counts = np.zeros((len(owners) // COVERAGE_SIDE, width), dtype=np.uint8)

    def count(start: int, stop: int) -> None:
        _count_covered_kernel(
            owners[start * COVERAGE_SIDE : stop * COVERAGE_SIDE], counts[start:stop]
        )

    run_bands(count, len(counts), band=64, threads=threads)
    return counts.ravel()


def cell_samples(
    owners: IntArray,
    faces: SnappedFaces,
    grid: SampleGrid,
    first_row: int,
    ids: npt.NDArray[np.int64],
    first_place: int,
    *,
    threads: int | None,
) -> Samples:
    """Owned samples at the centers of some cells; places among all cells stand for texel ids.

    Parameters
    ----------
    owners
        From `first_row` of the grid's rows of samples on.
    """
    n = len(ids)
    owned = np.empty(n, dtype=np.int32)
    weights = np.empty((n, 2))

    def fill(start: int, stop: int) -> None:
        _cell_samples_kernel(
            owners, faces.corners, first_row, ids[start:stop], owned[start:stop],
            weights[start:stop],
        )  # fmt: skip

    run_bands(fill, n, band=1 << 16, threads=threads)
    places = np.arange(first_place, first_place + n, dtype=np.int32)
    samples = Samples(places, owned, weights)
    is_owned = owned != NO_FACE
    return samples if is_owned.all() else samples.where(is_owned)


def divide(
    levels: list[Level], shape: tuple[int, int], errors: FloatArray32, state: TexelState
) -> npt.NDArray[np.int64]:
    """Decide which cells of the last level are divided; return the ids of their children.

    A texel whose estimated error is above its bound has those cells divided that add more than an
    even share of half of it.
    """
    level, k = levels[-1], len(levels) - 1
    n_children = _divide_kernel(
        (k, shape[1], k < LAST_LEVEL, k < COVERAGE_SIDE // 2),
        level.ids,
        errors,
        level.first_children,
        (state.covered, state.has_value, state.leaves, state.errors, state.finest),
    )
    children = np.empty(n_children, dtype=np.int64)
    _children_kernel(level.ids, level.first_children, shape[1] << k, children)
    return children


def gather(
    levels: list[Level], shape: tuple[int, int], state: TexelState
) -> tuple[FloatArray32, FloatArray32]:
    """Sums (n, C) over each texel of its undivided cells' values by area, and the areas (n,)."""
    n_texels = shape[0] * shape[1]
    sums = np.zeros((n_texels, levels[0].values.shape[1]), dtype=np.float32)
    areas = np.zeros(n_texels, dtype=np.float32)
    wanted = np.ones(n_texels, dtype=np.bool_)
    for k, level in enumerate(levels):
        _gather_kernel((k, shape[1], False), _cells_of(level), level.values, wanted, sums, areas)
    # A sliver may cover the center of a cell and none of its quarters'.
    for k, level in reversed(list(enumerate(levels))):
        wanted = (areas == 0.0) & state.has_value
        if not wanted.any():
            break
        _gather_kernel((k, shape[1], True), _cells_of(level), level.values, wanted, sums, areas)
    return sums, areas


def _cells_of(level: Level) -> tuple[npt.NDArray[np.int64], IntArray, IntArray]:
    return level.ids, level.charts, level.first_children


@kernel
def _count_covered_kernel(owners, counts):  # type: ignore[no-untyped-def]
    for line in range(len(owners)):
        for column in range(owners.shape[1]):
            if owners[line, column] != NO_FACE:
                counts[line // COVERAGE_SIDE, column // COVERAGE_SIDE] += 1


@kernel
def _cell_samples_kernel(owners, corners, first_row, ids, owned, weights):  # type: ignore[no-untyped-def]
    n_columns = owners.shape[1]
    for i in range(len(ids)):
        row, column = ids[i] // n_columns, ids[i] % n_columns
        owned[i] = owners[row - first_row, column]
        if owned[i] != NO_FACE:
            write_weights(corners, owned[i], row, column, weights[i])


@kernel
def _divide_kernel(size, ids, errors, first_children, texels):  # type: ignore[no-untyped-def]
    """Mark the cells to divide and close the others; return how many children there will be."""
    level, width, may_divide, may_search = size
    covered, has_value, leaves, closed, finest = texels
    n_columns = width << level
    full = COVERAGE_SIDE * COVERAGE_SIDE
    area = 0.25**level
    n_children = 0
    start = 0
    while start < len(ids):
        texel = ((ids[start] // n_columns) >> level) * width + ((ids[start] % n_columns) >> level)
        stop = start + 1
        total = float(errors[start])
        while stop < len(ids) and level > 0:
            row, column = ids[stop] // n_columns, ids[stop] % n_columns
            if (row >> level) * width + (column >> level) != texel:
                break
            total += errors[stop]
            stop += 1
        # Of a texel that is half covered each cell counts twice.
        share = area * full / max(float(covered[texel]), 1.0) if covered[texel] < full else area
        finest[texel] = level
        searched = may_search and not has_value[texel] and covered[texel] > 0 and level > 0
        too_far = may_divide and (searched or closed[texel] + share * total > 1.0)
        limit = 0.5 / leaves[texel]
        for i in range(start, stop):
            if too_far and (searched or share * errors[i] > limit):
                first_children[i] = n_children
                n_children += 4
                leaves[texel] += 3
            else:
                closed[texel] += share * errors[i]
        start = stop
    return n_children


@kernel
def _children_kernel(ids, first_children, n_columns, children):  # type: ignore[no-untyped-def]
    for i in range(len(ids)):
        place = first_children[i]
        if place < 0:
            continue
        row, column = ids[i] // n_columns, ids[i] % n_columns
        for child in range(4):
            children[place + child] = (
                (2 * row + child // 2) * (2 * n_columns) + 2 * column + child % 2
            )


@kernel
def _gather_kernel(size, cells, values, wanted, sums, areas):  # type: ignore[no-untyped-def]
    """Add up the values of the cells that are divided, or those that are not, of some texels."""
    level, width, divided = size
    ids, charts, first_children = cells
    n_columns = width << level
    area = 0.25**level
    for i in range(len(ids)):
        if charts[i] == NO_CHART or (first_children[i] >= 0) != divided:
            continue
        texel = ((ids[i] // n_columns) >> level) * width + ((ids[i] % n_columns) >> level)
        if not wanted[texel]:
            continue
        areas[texel] += area
        for channel in range(values.shape[1]):
            sums[texel, channel] += area * values[i, channel]
