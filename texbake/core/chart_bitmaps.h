/* Bitmaps of charts and runs of their cells, for other files of the core. */

#ifndef TEXBAKE_CHART_BITMAPS_H
#define TEXBAKE_CHART_BITMAPS_H

#include <stdint.h>

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

#endif
