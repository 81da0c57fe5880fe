/* Sums and squares of the samples of pixels, and error estimates derived from them.

   Based on: Mitchell, "Generating antialiased images at low sampling densities", SIGGRAPH 1987, for
   more samples where they differ; Roe, "Characteristic-based schemes for the Euler equations", Annual
   Review of Fluid Mechanics 18, 1986, for the minmod slope, which is 0 next to a discontinuity.

   Called from texbake/rendering/adaptive_pixels: pixel_statistics.py and sampler.py. */

#include <math.h>

#include "core.h"
#include "elementary.h"
#include "numbers.h"

/* Shading error relative to the second difference: 1/8 for a bend, up to 1/2 for a discontinuity. */
static const double BEND = 0.25;
/* Error relative to the last change by finer shading. */
static const double CHANGE = 0.7;
/* Edge error relative to the samples' standard deviation, and to the second difference of pixels. */
static const double EDGE = 1.0;
static const double HIDDEN = 0.5;

/* Add opaque fragments to their pixels, weighted by their numbers of samples. */
EXPORT void add_fragments_squared(
    int64_t n, int64_t n_pixels, const int32_t pixels[n], const float counts[n],
    const float light[n][3], double sums[n_pixels][4], double squares[n_pixels][4],
    float covered[n_pixels])
{
    for (int64_t i = 0; i < n; i++) {
        const int32_t pixel = pixels[i];
        const double count = counts[i];
        for (int k = 0; k < 3; k++) {
            const double value = light[i][k];
            sums[pixel][k] += count * value;
            squares[pixel][k] += count * value * value;
        }
        sums[pixel][3] += count;
        squares[pixel][3] += count;
        covered[pixel] += counts[i];
    }
}

/* Add samples to their pixels, composited over the background, which has a single value or one per
   pixel. */
EXPORT void add_samples_squared(
    int64_t sample_rows, int64_t sample_columns, int64_t rows_behind, int64_t columns_behind,
    int64_t height, int64_t width, const float light[sample_rows][sample_columns][3],
    const float passed[sample_rows][sample_columns],
    const bool seen[sample_rows][sample_columns],
    const float behind[rows_behind][columns_behind][3], int64_t first_row, int64_t side,
    double sums[height][width][4], double squares[height][width][4], float covered[height][width])
{
    for (int64_t j = 0; j < sample_rows; j++) {
        const int64_t row = first_row + j / side;
        for (int64_t i = 0; i < sample_columns; i++) {
            const int64_t column = i / side;
            const float *back =
                behind[rows_behind > 1 ? row : 0][columns_behind > 1 ? column : 0];
            const double through = passed[j][i];
            for (int k = 0; k < 4; k++) {
                const double value = k < 3 ? light[j][i][k] + through * back[k] : 1.0 - through;
                sums[row][column][k] += value;
                squares[row][column][k] += value * value;
            }
            if (seen[j][i])
                covered[row][column] += 1.0f;
        }
    }
}

/* Write the sums of masked pixels to those of a picture, from the pixel at `top` and `left`; samples
   without a surface show the background, if there is one. */
EXPORT void write_window(
    int64_t rows, int64_t columns, int64_t rows_behind, int64_t columns_behind, int64_t height,
    int64_t width, const bool mask[rows][columns], int64_t top, int64_t left, int64_t side,
    const float behind[rows_behind][columns_behind][3], bool is_opaque, bool shows_behind,
    const double light[rows][columns][4], const double squares[rows][columns][4],
    const float covered[rows][columns], double light_out[height][width][4],
    double squares_out[height][width][4], float covered_out[height][width])
{
    const double n = (double)(side * side);
    for (int64_t row = 0; row < rows; row++) {
        for (int64_t column = 0; column < columns; column++) {
            if (!mask[row][column])
                continue;
            const int64_t j = top + row, i = left + column;
            const float *back =
                behind[rows_behind > 1 ? row : 0][columns_behind > 1 ? column : 0];
            const double passed = shows_behind ? n - light[row][column][3] : 0.0;
            for (int k = 0; k < 4; k++) {
                const double value = k < 3 ? back[k] : 0.0;
                light_out[j][i][k] = light[row][column][k] + passed * value;
                squares_out[j][i][k] = squares[row][column][k] + passed * value * value;
            }
            if (is_opaque)
                light_out[j][i][3] = squares_out[j][i][3] = n;
            covered_out[j][i] = covered[row][column];
        }
    }
}

/* Clear the samples of all pixels outside the mask. */
EXPORT void drop_unwanted(
    int64_t sample_rows, int64_t sample_columns, int64_t rows, int64_t columns,
    int32_t face_ids[sample_rows][sample_columns], const bool mask[rows][columns], int64_t side)
{
    for (int64_t row = 0; row < rows; row++) {
        for (int64_t column = 0; column < columns; column++) {
            if (mask[row][column])
                continue;
            for (int64_t j = row * side; j < (row + 1) * side; j++) {
                for (int64_t i = column * side; i < (column + 1) * side; i++)
                    face_ids[j][i] = -1;
            }
        }
    }
}

/* Encode light as `texbake.texture.encoding.encode_srgb` does. */
static double coded(double light)
{
    if (light <= 0.0031308)
        return 12.92 * max_f64(light, 0.0);
    return light >= 1.0 ? 1.0 : 1.055 * short_power(light, 1.0 / 2.4) - 0.055;
}

/* Write the encoded means of some rows of pixels. */
EXPORT void write_codes(
    int64_t height, int64_t width, const double light[height][width][4],
    const int32_t counts[height][width], float codes[height][width][4], int64_t start, int64_t stop)
{
    for (int64_t row = start; row < stop; row++) {
        for (int64_t column = 0; column < width; column++) {
            const double n = (double)max_i64(counts[row][column], 1);
            for (int k = 0; k < 3; k++)
                codes[row][column][k] = (float)coded(light[row][column][k] / n);
            codes[row][column][3] = (float)(light[row][column][3] / n);
        }
    }
}

/* Root mean square of the changes of a pixel and its neighbors by finer shading. */
static double change_around(
    int64_t height, int64_t width, const int32_t shaded[height][width],
    const float changes[height][width], int64_t row, int64_t column)
{
    double total = 0.0;
    int64_t weight = 0;
    for (int64_t j = max_i64(row - 1, 0); j < min_i64(row + 2, height); j++) {
        for (int64_t i = max_i64(column - 1, 0); i < min_i64(column + 2, width); i++) {
            if (shaded[j][i] > 1) {
                total += changes[j][i] * changes[j][i];
                weight++;
            }
        }
    }
    return sqrt(total / (double)weight);
}

/* Estimate the error of pixels due to too few shadings. */
EXPORT void judge_shading(
    int64_t height, int64_t width, const float codes[height][width][4],
    const int32_t shaded[height][width], const float changes[height][width],
    float errors[height][width], int64_t start, int64_t stop)
{
    for (int64_t row = start; row < stop; row++) {
        for (int64_t column = 0; column < width; column++) {
            if (shaded[row][column] > 1) {
                const double around = change_around(height, width, shaded, changes, row, column);
                errors[row][column] = (float)(CHANGE * max_f64(changes[row][column], around));
                continue;
            }
            /* Neighbors; at the border the pixel itself, so that the only difference counts once. */
            const int64_t above = max_i64(row - 1, 0), below = min_i64(row + 1, height - 1);
            const int64_t left = max_i64(column - 1, 0), right = min_i64(column + 1, width - 1);
            const float *here = codes[row][column];
            double worst = 0.0;
            for (int k = 0; k < 4; k++) {
                double down = 0.0, across = 0.0;
                down += (double)codes[above][column][k] - here[k];
                down += (double)codes[below][column][k] - here[k];
                across += (double)codes[row][left][k] - here[k];
                across += (double)codes[row][right][k] - here[k];
                worst = max_f64(worst, fabs(down) + fabs(across));
            }
            /* A pixel next to one that finer shading changed a lot may have a similar error. */
            double beside = max_f64(0.0, changes[above][column]);
            beside = max_f64(beside, changes[below][column]);
            beside = max_f64(beside, changes[row][left]);
            beside = max_f64(beside, changes[row][right]);
            errors[row][column] = (float)(BEND * max_f64(worst, CHANGE * beside));
        }
    }
}

/* Means of a channel in the pixels before and after one along an axis, and whether both are in the
   picture; at its border, that of the pixel itself. */
struct neighbors {
    double before, after;
    bool both;
};

static inline double mean_of(const double sums[4], int32_t count, int k)
{
    return sums[k] / (double)max_i64(count, 1);
}

/* Estimate the error of one channel's mean, from the variance and the differences to neighbors. */
static double edge_error(
    double mean, double variance, double n, double share, const struct neighbors beside[2])
{
    double hidden = 0.0;
    for (int axis = 0; axis < 2; axis++) {
        const double first = mean - beside[axis].before, second = beside[axis].after - mean;
        if (beside[axis].both)
            hidden = max_f64(hidden, fabs(second - first));
        if (first * second > 0.0) {
            /* Subtract the variance explained by the smaller of the two slopes. */
            const double slope = min_f64(fabs(first), fabs(second));
            variance -= (1.0 - 1.0 / n) / 12.0 * slope * slope;
        }
    }
    return share * (EDGE * sqrt(max_f64(variance, 0.0)) + HIDDEN * hidden);
}

/* Estimate the error of pixels due to too few samples of their edges. */
EXPORT void judge_edges(
    int64_t height, int64_t width, const double light[height][width][4],
    const double squares[height][width][4], const int32_t counts[height][width],
    float errors[height][width], int64_t start, int64_t stop)
{
    for (int64_t row = start; row < stop; row++) {
        const int64_t above = max_i64(row - 1, 0), below = min_i64(row + 1, height - 1);
        for (int64_t column = 0; column < width; column++) {
            const int64_t left = max_i64(column - 1, 0), right = min_i64(column + 1, width - 1);
            const double n = (double)max_i64(counts[row][column], 1);
            const double share = short_power(n, -0.75);
            double error = 0.0;
            for (int k = 0; k < 4; k++) {
                const double mean = light[row][column][k] / n;
                const double variance = squares[row][column][k] / n - mean * mean;
                const struct neighbors beside[2] = {
                    {mean_of(light[above][column], counts[above][column], k),
                     mean_of(light[below][column], counts[below][column], k),
                     0 < row && row < height - 1},
                    {mean_of(light[row][left], counts[row][left], k),
                     mean_of(light[row][right], counts[row][right], k),
                     0 < column && column < width - 1},
                };
                const double off = edge_error(mean, variance, n, share, beside);
                if (off == 0.0)
                    continue;
                if (k == 3) {
                    error = max_f64(error, off);
                    continue;
                }
                const double middle = coded(mean);
                error = max_f64(error, coded(mean + off) - middle);
                error = max_f64(error, middle - coded(mean - off));
            }
            errors[row][column] = (float)error;
        }
    }
}
