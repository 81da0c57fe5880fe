/* Charts on the grid of an atlas, shared by the files that the sections below name. */

#pragma once

#include <stdint.h>

#include "arena.h"

/* Step to the next state; return its bits from 8 up, 23 of them. */
static inline int64_t next_random(uint64_t *state)
{
    *state = (*state * 1103515245 + 12345) & 0x7FFFFFFF;
    return (int64_t)(*state >> 8);
}

/* chart_bitmaps.c */

/* A run of cells of a row, up to the one before `end`. */
struct span {
    int32_t row, begin, end;
};

/* The cells of one chart in one pose, row by row; 1 where the chart touches them. */
struct mask {
    int64_t width, height;
    const uint8_t *cells;
};

/* The bitmaps of all charts in all poses, as in `Bitmaps`. */
struct chart_masks {
    int64_t n_poses;
    const uint8_t *cells;
    const int64_t *starts;    /* (chart, pose) */
    const int64_t (*boxes)[2]; /* (chart, pose): width, height */
};

static inline struct mask mask_of(const struct chart_masks *masks, int64_t chart, int64_t pose)
{
    const int64_t at = chart * masks->n_poses + pose;
    return (struct mask){masks->boxes[at][0], masks->boxes[at][1], masks->cells + masks->starts[at]};
}

/* Cells of the largest mask, at least 1. */
int64_t largest_mask(const struct chart_masks *masks, int64_t n_charts);

/* A mask with rows and columns exchanged, in `cells`. */
struct mask transposed(struct mask mask, uint8_t *cells);

/* Write the runs of marked cells of a mask after some quarter turns; return how many. `across` is the
   transposed mask, for odd turns. */
int64_t write_spans(struct mask mask, struct mask across, int64_t turn, struct span *spans);

/* bottom_left.c */

/* The free cells of a grid. `runs` holds, for each cell, how many cells are free from it to the
   right; or, as a negative number, how many at least are blocked. `longest` holds the longest free
   run of each row, below 0 until it is asked for. */
struct free_cells {
    int64_t n_rows, n_columns;
    int32_t *runs, *longest;
};

/* A chart in one pose and quarter turn: its box, and the runs of its cells. */
struct turned_chart {
    int64_t width, height, n_spans;
    const struct span *spans;
};

struct spot {
    int64_t x, y;
};

/* A grid with nothing in it; the second empties one again. */
struct free_cells take_cells(struct arena *arena, int64_t n_rows, int64_t n_columns);
void free_all(const struct free_cells *cells);

/* Find the lowest, then leftmost free place from `first` on, with the top below the row `below`;
   x and y are -1 where there is none. */
struct spot lowest_place(
    const struct free_cells *cells, const struct turned_chart *chart, struct spot first,
    int64_t below, int64_t *steps);

/* Block the cells near a chart that was just placed; return the number of steps. `half_widths` are
   those of the packing grid. */
int64_t block_chart(
    const struct free_cells *cells, const struct turned_chart *chart, int64_t x, int64_t y,
    int64_t n_widths, const int32_t *half_widths);

/* guided_local_search.c, near_places.c and order_search.c */

/* The cells of charts in some orientations, as in `Shapes`; the arrays after `spans` and `reach`
   hold a pair for each chart and orientation. */
struct shapes {
    int64_t n_charts, n_orientations;
    const int32_t (*boxes)[2];
    const struct span *spans;
    const int64_t (*starts)[2];
    const struct span *reach;
    const int64_t (*reach_starts)[2];
    int64_t margin;
};

struct place {
    int32_t x, y, orientation;
};

static inline int64_t index_of(const struct shapes *shapes, int64_t chart, int64_t orientation)
{
    return chart * shapes->n_orientations + orientation;
}

static inline struct turned_chart
turned(const struct shapes *shapes, int64_t chart, int64_t orientation)
{
    const int64_t at = index_of(shapes, chart, orientation);
    const int64_t *range = shapes->starts[at];
    return (struct turned_chart){shapes->boxes[at][0], shapes->boxes[at][1], range[1] - range[0],
        shapes->spans + range[0]};
}
