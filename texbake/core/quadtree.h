/* Cells of texels and where their samples lie, for other files of the core: see quadtree.c. */

#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "edge_functions.h"

enum {
    NO_CHART = -1,
    NO_CHILD = -1,
    PER_TEXEL = 2 * FINE, /* samples are placed in units of half a sub-square */
};

/* How much of each texel is covered, as in `TexelCoverage`. */
struct coverage {
    const uint8_t *counts;
    const int64_t *masks;
};

/* Covered sub-squares, and the sums of their x and y. */
struct submask {
    int64_t n, sum_x, sum_y;
};

struct sample_spot {
    int64_t x, y;
};

/* The square of sub-squares that a cell is. */
struct cell_square {
    int64_t left, top, side;
};

static inline struct cell_square square_of(int64_t level, int64_t spot)
{
    const int64_t side = FINE >> level;
    return (struct cell_square){spot % FINE * side, spot / FINE * side, side};
}

static inline bool has_bit(int64_t mask, int64_t x, int64_t y)
{
    return ((uint64_t)mask >> (FINE * y + x)) & 1;
}

/* The covered sub-squares in a cell. */
static inline struct submask submask_of(int64_t mask, struct cell_square square)
{
    struct submask covered = {0, 0, 0};
    for (int64_t y = square.top; y < square.top + square.side; y++) {
        for (int64_t x = square.left; x < square.left + square.side; x++) {
            if (has_bit(mask, x, y)) {
                covered.n++;
                covered.sum_x += x;
                covered.sum_y += y;
            }
        }
    }
    return covered;
}

/* Where in its texel the sample of a cell lies, in PER_TEXEL; (-1, -1) for none.

   It lies at the center of the cell. In a partly covered cell it lies at the covered sub-square
   nearest to the middle of all covered ones, so that values that change evenly stay exact. */
static inline struct sample_spot sample_spot_of(
    const struct coverage *coverage, int64_t texel, int64_t level, int64_t spot)
{
    const struct cell_square square = square_of(level, spot);
    const int64_t side = square.side;
    const struct sample_spot center = {2 * square.left + side, 2 * square.top + side};
    if (coverage->counts[texel] == FULL)
        return center;
    const int64_t mask = coverage->masks[texel];
    const struct submask covered = submask_of(mask, square);
    if (covered.n == side * side)
        return center;
    if (covered.n == 0) /* only its center is covered, or nothing */
        return level == 0 ? center : (struct sample_spot){-1, -1};
    int64_t best = -1, best_x = 0, best_y = 0;
    for (int64_t y = square.top; y < square.top + side; y++) {
        for (int64_t x = square.left; x < square.left + side; x++) {
            if (!has_bit(mask, x, y))
                continue;
            const int64_t dx = covered.n * x - covered.sum_x, dy = covered.n * y - covered.sum_y;
            const int64_t away = dx * dx + dy * dy;
            if (best < 0 || away < best) {
                best = away;
                best_x = x;
                best_y = y;
            }
        }
    }
    return (struct sample_spot){2 * best_x + 1, 2 * best_y + 1};
}
