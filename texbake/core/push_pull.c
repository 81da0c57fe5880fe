/* Push-pull: the texels outside a mask are filled smoothly from those inside it, through coarser
   levels of the image.

   Based on: Gortler et al., "The Lumigraph", 1996, section 4.3. Departs from it in that weights are 0
   or 1 in every level.

   Called from texbake/texture/padding.py. */

#include <math.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"

/* Means of the valid, finite texels of each 2 x 2 block, for coarse rows `start` to `stop`. */
EXPORT int64_t push_texels(
    int64_t height, int64_t width, int64_t n_channels, int64_t coarse_height,
    int64_t coarse_width, const float values[height][width][n_channels],
    const bool mask[height][width], float coarse[coarse_height][coarse_width][n_channels],
    bool coarse_mask[coarse_height][coarse_width], int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    double *totals = TAKE(arena, double, n_channels);
    for (int64_t row = start; row < stop; row++)
        for (int64_t column = 0; column < coarse_width; column++) {
            int64_t count = 0;
            for (int64_t channel = 0; channel < n_channels; channel++)
                totals[channel] = 0.0;
            for (int64_t y = 2 * row; y < min_i64(2 * row + 2, height); y++)
                for (int64_t x = 2 * column; x < min_i64(2 * column + 2, width); x++) {
                    bool is_finite = mask[y][x];
                    for (int64_t channel = 0; channel < n_channels; channel++)
                        is_finite = is_finite && isfinite(values[y][x][channel]);
                    if (!is_finite)
                        continue;
                    count++;
                    for (int64_t channel = 0; channel < n_channels; channel++)
                        totals[channel] += values[y][x][channel];
                }
            for (int64_t channel = 0; channel < n_channels; channel++)
                coarse[row][column][channel] =
                    (float)(totals[channel] / (double)max_i64(count, 1));
            coarse_mask[row][column] = count > 0;
        }
    close_arena(arena);
    return 0;
}

/* Fill rows `start` to `stop`, where not valid, with the coarser level, interpolated bilinearly. */
EXPORT void pull_texels(
    int64_t height, int64_t width, int64_t n_channels, int64_t coarse_height,
    int64_t coarse_width, float values[height][width][n_channels], const bool mask[height][width],
    const float coarse[coarse_height][coarse_width][n_channels], int64_t start, int64_t stop)
{
    for (int64_t y = start; y < stop; y++) {
        const int64_t near_row = y / 2;
        const int64_t far_row = clamp_i64(near_row + (y % 2 ? 1 : -1), 0, coarse_height - 1);
        for (int64_t x = 0; x < width; x++) {
            if (mask[y][x])
                continue;
            const int64_t near = x / 2;
            const int64_t far = clamp_i64(near + (x % 2 ? 1 : -1), 0, coarse_width - 1);
            for (int64_t channel = 0; channel < n_channels; channel++) {
                /* Sixteenths of float add up exactly in double, so a constant stays constant. */
                double total = 9.0 * coarse[near_row][near][channel];
                total += 3.0 * coarse[near_row][far][channel];
                total += 3.0 * coarse[far_row][near][channel];
                total += 1.0 * coarse[far_row][far][channel];
                values[y][x][channel] = (float)(total / 16.0);
            }
        }
    }
}
