"""Cells of texels: how they are divided, where their samples lie, and what is kept of them.

A cell of level k is a square of which 4^k make up a texel; its spot is `FINE` times its row plus
its column within the texel, both counted in cells of its level.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.adaptive_texels.edge_functions import FINE, FULL, TEXEL, covers, owner_at
from texbake.baking.pineda import NO_FACE, write_weights
from texbake.kernels import kernel

PER_TEXEL = 2 * FINE  # samples are placed in units of half a sub-square
TILE = 8  # texels along one side of the squares whose cells lie together, so that their rays do
NO_CHART = -1
NO_CHILD = -1
N_CHECK_SAMPLES, _GENERATOR = 13, 8  # two consecutive Fibonacci numbers


@kernel
def submask(masks, texel, level, spot):  # type: ignore[no-untyped-def]
    """Return the number of covered sub-squares in a cell, and the sums of their x and y."""
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
    """Return where in its texel the sample of a cell lies, in `PER_TEXEL`; (-1, -1) for none.

    It lies at the center of the cell. In a partly covered cell it lies at the covered sub-square
    nearest to the middle of all covered ones, so that values that change evenly stay exact.
    """
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
        # Only its center is covered, or nothing.
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
def write_samples(bins, coverage, size, cells, owners, weights):  # type: ignore[no-untyped-def]
    """Write the face that each cell's sample lies on, and where on it; see `cell_samples`."""
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
        # Where faces overlap, all samples of a texel take the one that owns its center.
        owners[i] = centers[texels[i]]
        if owners[i] == NO_FACE or not covers(bins[0], owners[i], x, y):
            owners[i] = owner_at(bins, x, y)
        if owners[i] == NO_FACE:
            # A gap narrower than a sub-square runs through the very center of the cell.
            x, y = x - unit, y - unit
            owners[i] = owner_at(bins, x, y)
        if owners[i] != NO_FACE:
            write_weights(bins[0], owners[i], x, y, weights[i])


@kernel
def write_check_samples(bins, width, texels, owners, weights):  # type: ignore[no-untyped-def]
    """Write the faces that the samples of a check lie on, and where on them."""
    i = 0
    for texel in texels:
        for sample in range(N_CHECK_SAMPLES):
            across, down = sample, _GENERATOR * sample % N_CHECK_SAMPLES
            x = (texel % width) * TEXEL + (2 * across + 1) * TEXEL // (2 * N_CHECK_SAMPLES)
            y = (texel // width) * TEXEL + (2 * down + 1) * TEXEL // (2 * N_CHECK_SAMPLES)
            owners[i] = owner_at(bins, x, y)
            if owners[i] != NO_FACE:
                write_weights(bins[0], owners[i], x, y, weights[i])
            i += 1


@kernel
def write_children(size, parents, coverage, children, new):  # type: ignore[no-untyped-def]
    """Write four children for each parent, and how many sub-squares of each are covered."""
    level, first = size
    places, parent_texels, parent_spots = parents
    counts, masks = coverage
    texels, spots, weights = new
    whole = FULL >> (2 * level)
    for i in range(len(places)):
        children[places[i]] = first + 4 * i
        texel = parent_texels[i]
        row, column = parent_spots[i] // FINE, parent_spots[i] % FINE
        for child in range(4):
            spot = (2 * row + child // 2) * FINE + 2 * column + child % 2
            texels[4 * i + child] = texel
            spots[4 * i + child] = spot
            if counts[texel] == FULL:
                weights[4 * i + child] = whole
            else:
                weights[4 * i + child] = submask(masks, texel, level, spot)[0]


@kernel
def write_in_tiles(chosen, ids):  # type: ignore[no-untyped-def]
    """Write the ids of the chosen texels, tile by tile."""
    height, width = chosen.shape
    n = 0
    for top in range(0, height, TILE):
        for left in range(0, width, TILE):
            for row in range(top, min(top + TILE, height)):
                for column in range(left, min(left + TILE, width)):
                    if chosen[row, column]:
                        ids[n] = row * width + column
                        n += 1


@kernel
def keep_values(places, charts, values, first_channel, kept_charts, kept):  # type: ignore[no-untyped-def]
    """Write the charts and values of samples to the places of their cells."""
    for i in range(len(places)):
        kept_charts[places[i]] = charts[i]
        for channel in range(values.shape[1]):
            kept[places[i], first_channel + channel] = values[i, channel]


@kernel
def add_leaves(first, texels, weights, cells, sums, areas):  # type: ignore[no-untyped-def]
    """Add the undivided cells of a level to their texels, each by how much of it is covered."""
    children, charts, values = cells
    for i in range(len(texels)):
        place = first + i
        if children[place] != NO_CHILD or charts[place] == NO_CHART:
            continue
        area = np.float32(weights[i])
        areas[texels[i]] += area
        for channel in range(values.shape[1]):
            sums[texels[i], channel] += area * values[place, channel]
