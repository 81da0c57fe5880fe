"""Where in its cell a sample lies, and which face of the light mesh it lies on."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.baking.coverage import (
    FINE,
    FULL,
    TEXEL,
    Coverage,
    FaceBins,
    covers,
    owner_at,
)
from texbake.baking.texels import NO_FACE, Samples, write_weights
from texbake.kernels import kernel
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands

PER_TEXEL = 2 * FINE  # the unit that samples are placed in: half a sub-square


def cell_samples(
    bins: FaceBins,
    coverage: Coverage,
    level: int,
    centers: IntArray,
    cells: tuple[IntArray, IntArray, npt.NDArray[np.uint8]],
    *,
    threads: int | None,
) -> tuple[Samples, IntArray]:
    """Samples of some cells, their texel ids being the places of these; and their texels.

    Parameters
    ----------
    centers : (height, width) int32
        Faces that own the centers of the texels.
    cells
        Places, texels and spots.

    A cell that no face covers, even at its most central covered sub-square, has none.
    """
    places, texels, spots = cells
    owners = np.empty(len(places), dtype=np.int32)
    weights = np.empty((len(places), 2))

    def fill(start: int, stop: int) -> None:
        _samples_kernel(
            bins.arrays, (coverage.counts, coverage.masks), (level, centers.shape[1]),
            (centers.reshape(-1), texels[start:stop], spots[start:stop]),
            owners[start:stop], weights[start:stop],
        )  # fmt: skip

    run_bands(fill, len(places), band=1 << 14, threads=threads)
    samples = Samples(places, owners, weights)
    is_owned = owners != NO_FACE
    if is_owned.all():
        return samples, texels
    return samples.where(is_owned), texels[is_owned]


@kernel
def submask(masks, texel, level, spot):  # type: ignore[no-untyped-def]
    """Return how many covered sub-squares a cell of a partly covered texel has, and their sums."""
    side = FINE >> level
    top, left = (spot // FINE) * side, (spot % FINE) * side
    n, sum_x, sum_y = 0, 0, 0
    mask = masks[texel]
    for y in range(top, top + side):
        for x in range(left, left + side):
            if (mask >> (FINE * y + x)) & 1:
                n += 1
                sum_x += x
                sum_y += y
    return n, sum_x, sum_y


@kernel
def sample_spot(coverage, texel, level, spot):  # type: ignore[no-untyped-def]
    """Where in its texel a cell's sample lies, x and y in `PER_TEXEL`; (-1, -1) for nowhere."""
    counts, masks = coverage
    side = FINE >> level
    top, left = (spot // FINE) * side, (spot % FINE) * side
    center_x, center_y = 2 * left + side, 2 * top + side
    if counts[texel] == FULL:
        return center_x, center_y
    n, sum_x, sum_y = submask(masks, texel, level, spot)
    if n == side * side:
        return center_x, center_y
    if n == 0:
        # Its center alone is covered, or nothing of it.
        return (center_x, center_y) if level == 0 else (-1, -1)
    best, best_x, best_y = np.int64(-1), 0, 0
    mask = masks[texel]
    for y in range(top, top + side):
        for x in range(left, left + side):
            if (mask >> (FINE * y + x)) & 1:
                away = (n * x - sum_x) ** 2 + (n * y - sum_y) ** 2
                if best < 0 or away < best:
                    best, best_x, best_y = away, x, y
    return 2 * best_x + 1, 2 * best_y + 1


@kernel
def _samples_kernel(bins, coverage, size, cells, owners, weights):  # type: ignore[no-untyped-def]
    level, width = size
    centers, texels, spots = cells
    unit = TEXEL // PER_TEXEL
    for i in range(len(texels)):
        owners[i] = NO_FACE
        x, y = sample_spot(coverage, texels[i], level, spots[i])
        if x < 0:
            continue
        row = np.int64(np.uint32(texels[i]) // np.uint32(width))
        x = (texels[i] - row * width) * TEXEL + x * unit
        y = row * TEXEL + y * unit
        # Of faces that overlap, all samples of a texel take the one that owns its center.
        owners[i] = centers[texels[i]]
        if owners[i] == NO_FACE or not covers(bins[0], owners[i], x, y):
            owners[i] = owner_at(bins, x, y)
        if owners[i] == NO_FACE:
            # A gap thinner than a sub-square, at the very center of a cell.
            x, y = x - unit, y - unit
            owners[i] = owner_at(bins, x, y)
        if owners[i] != NO_FACE:
            write_weights(bins[0], owners[i], x, y, weights[i])
