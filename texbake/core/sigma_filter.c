/* The mean of neighboring texels that differ by no more than the noise of their rays.

   Each texel is averaged with those of the 5 x 5 texels around it that are in the same chart. The
   more a value differs, the less it counts, down to 0 at a limit that follows from the noise. This
   averages noise and keeps larger edges and details.

   Based on: Lee, "Digital Image Smoothing and the Sigma Filter", Computer Vision, Graphics, and
   Image Processing 24(2), 1983. Departs from it: weights fall smoothly, as in Tukey's biweight, and
   not abruptly at the limit.

   Called from texbake/baking/texel_values.py. */

#include "core.h"
#include "numbers.h"

#define REACH 2 /* texels on each side */

/* Write the filtered rows from `start` on. By noise, two values with the mean m may differ by up to
   `of_shares` times sqrt(m (1 - m)), for shares of rays, and by up to `relative` times m. */
EXPORT void filter_by_noise(
    int64_t height, int64_t width, const float values[height][width],
    const int32_t charts[height][width], const bool has_data[height][width], double of_shares,
    double relative, int64_t start, int64_t stop, float filtered[height][width])
{
    for (int64_t row = start; row < stop; row++)
        for (int64_t column = 0; column < width; column++) {
            const double value = values[row][column];
            filtered[row][column] = values[row][column];
            if (!has_data[row][column])
                continue;
            double sum = 0.0, weights = 1.0; /* of differences; its own weight is 1 */
            for (int64_t y = max_i64(row - REACH, 0); y <= min_i64(row + REACH, height - 1); y++)
                for (int64_t x = max_i64(column - REACH, 0);
                     x <= min_i64(column + REACH, width - 1); x++) {
                    const bool is_itself = y == row && x == column;
                    if (is_itself || !has_data[y][x] || charts[y][x] != charts[row][column])
                        continue;
                    const int64_t square =
                        (y - row) * (y - row) + (x - column) * (x - column);
                    const double difference = values[y][x] - value, mean = value + 0.5 * difference;
                    const double limit = of_shares * of_shares * mean * (1.0 - mean) +
                                         relative * relative * mean * mean; /* squared */
                    const double share = difference == 0.0 ? 0.0 : difference * difference / limit;
                    if (!(share < 1.0)) /* the limit is 0 where all rays are open, or none */
                        continue;
                    const double near = 1.0 - (double)square / ((REACH + 1) * (REACH + 1));
                    const double weight = near * (1.0 - share) * (1.0 - share);
                    sum += weight * difference;
                    weights += weight;
                }
            filtered[row][column] = (float)(value + sum / weights);
        }
}
