/* Lowest free places of charts on a grid, for other files of the core. */

#ifndef TEXBAKE_BOTTOM_LEFT_H
#define TEXBAKE_BOTTOM_LEFT_H

#include "arena.h"
#include "chart_bitmaps.h"

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

#endif
