/* A smaller level of a cube map: the mean of what each texel covers, weighted by solid angle, so that
   no level gains or loses energy.

   Called from texbake/texture/cube_map.py. */

#include <math.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"

/* Rows `start` to `stop` of the smaller faces, counted over all six. `weights` are the solid angles of
   the texels of a larger face. */
EXPORT int64_t shrink_cube_rows(
    int64_t size, int64_t small, int64_t n_channels,
    const float faces[6][size][size][n_channels], const double weights[size][size],
    float out[6][small][small][n_channels], int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    double *sums = TAKE(arena, double, n_channels);
    const double ratio = (double)size / (double)small;
    for (int64_t row = start; row < stop; row++) {
        const int64_t face = row / small;
        const double top = (double)(row % small) * ratio, bottom = top + ratio;
        const int64_t last_y = min_i64((int64_t)ceil(bottom), size);
        for (int64_t column = 0; column < small; column++) {
            const double left = (double)column * ratio, right = left + ratio;
            const int64_t last_x = min_i64((int64_t)ceil(right), size);
            double total = 0.0;
            for (int64_t channel = 0; channel < n_channels; channel++)
                sums[channel] = 0.0;
            for (int64_t y = (int64_t)top; y < last_y; y++) {
                const double height = min_f64((double)y + 1.0, bottom) - max_f64((double)y, top);
                for (int64_t x = (int64_t)left; x < last_x; x++) {
                    const double width = min_f64((double)x + 1.0, right) - max_f64((double)x, left);
                    const double weight =
                        max_f64(width, 0.0) * max_f64(height, 0.0) * weights[y][x];
                    total += weight;
                    for (int64_t channel = 0; channel < n_channels; channel++)
                        sums[channel] += weight * faces[face][y][x][channel];
                }
            }
            for (int64_t channel = 0; channel < n_channels; channel++)
                out[face][row % small][column][channel] = (float)(sums[channel] / total);
        }
    }
    close_arena(arena);
    return 0;
}
