/* How close two pictures are: the angles between their normals, and their structural similarity.

   Based on: Wang, Bovik, Sheikh, Simoncelli, "Image quality assessment: from error visibility to
   structural similarity", IEEE TIP 13(4), 2004.

   Called from texbake/rendering/closeness.py. */

#include <math.h>

#include "arena.h"
#include "core.h"
#include "elementary.h"

/* Below this length of a sum or difference of unit vectors, `positive_atan2` is not defined. */
static const double SHORT = 0x1p-60;

/* Lengths of the difference and of the sum of two vectors. */
static inline void measure_chords(
    const float first[3], const float second[3], double *apart, double *along)
{
    double less = 0.0, more = 0.0;
    for (int k = 0; k < 3; k++) {
        const double difference = (double)first[k] - second[k], sum = (double)first[k] + second[k];
        less += difference * difference;
        more += sum * sum;
    }
    *apart = sqrt(less);
    *along = sqrt(more);
}

/* Write the angles in degrees between the normals of two pictures, from the chord, which is accurate
   for small angles where the arc cosine is not; NaN where depths differ by more than `tolerance`.
   Counts, in each row, the pixels that see either surface, and both. */
EXPORT int64_t measure_angles(
    int64_t height, int64_t width, const float first[height][width][3],
    const float second[height][width][3], const float first_depths[height][width],
    const float second_depths[height][width], const float first_coverage[height][width],
    const float second_coverage[height][width], double tolerance, float angles[height][width],
    int64_t counts[height][2], int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    double *apart = TAKE(arena, double, width), *along = TAKE(arena, double, width);
    double *found = TAKE(arena, double, width);
    int32_t *columns = TAKE(arena, int32_t, width);
    for (int64_t row = start; row < stop; row++) {
        int64_t n = 0;
        counts[row][0] = counts[row][1] = 0;
        for (int64_t i = 0; i < width; i++) {
            const bool one = first_coverage[row][i] > 0.0f, other = second_coverage[row][i] > 0.0f;
            counts[row][0] += one || other;
            counts[row][1] += one && other;
            angles[row][i] = NAN;
            const float deeper = fabsf(first_depths[row][i] - second_depths[row][i]);
            if (!one || !other || !(deeper <= (float)tolerance))
                continue;
            measure_chords(first[row][i], second[row][i], &apart[n], &along[n]);
            columns[n++] = (int32_t)i;
        }
        for (int64_t i = 0; i < n; i++)
            found[i] = positive_atan2(apart[i], along[i]);
        for (int64_t i = 0; i < n; i++) {
            if (apart[i] < SHORT || along[i] < SHORT)
                found[i] = portable_atan2(apart[i], along[i]);
            angles[row][columns[i]] = (float)(2.0 * found[i] * (180.0 / 0x1.921fb54442d18p1));
        }
    }
    close_arena(arena);
    return 0;
}

/* Values of which the means over a window are needed: x, y, x x, y y, x y. */
enum { N_MEANS = 5 };

/* A place in a row or column of n, or outside of it, mirrored at the ends. */
static inline int64_t mirrored(int64_t place, int64_t n)
{
    return place < 0 ? -1 - place : place >= n ? 2 * n - 1 - place : place;
}

/* Means over `window` rows around one, of the n values in a row. */
static void average_rows(
    int64_t n, const float (*first)[n], const float (*second)[n], int64_t height, int64_t row,
    int64_t window, double (*sums)[n], float (*means)[n])
{
    for (int k = 0; k < N_MEANS; k++)
        for (int64_t i = 0; i < n; i++)
            sums[k][i] = 0.0;
    for (int64_t k = 0; k < window; k++) {
        const int64_t at = mirrored(row - window / 2 + k, height);
        const float *x = first[at], *y = second[at];
        for (int64_t i = 0; i < n; i++) {
            sums[0][i] += x[i];
            sums[1][i] += y[i];
            sums[2][i] += x[i] * x[i];
            sums[3][i] += y[i] * y[i];
            sums[4][i] += x[i] * y[i];
        }
    }
    for (int k = 0; k < N_MEANS; k++)
        for (int64_t i = 0; i < n; i++)
            means[k][i] = (float)(sums[k][i] / (double)window);
}

/* Means over `window` values around each of a row of `width` with `channels` each; `row` has room
   for the values mirrored at both ends. */
static void average_columns(
    int64_t width, int64_t channels, int64_t window, float *row, double *sums, float *means)
{
    const int64_t margin = window / 2, n = width * channels;
    for (int64_t i = 0; i < width + 2 * margin; i++)
        for (int64_t k = 0; k < channels; k++)
            row[i * channels + k] = means[mirrored(i - margin, width) * channels + k];
    for (int64_t i = 0; i < n; i++)
        sums[i] = 0.0;
    for (int64_t k = 0; k < window; k++)
        for (int64_t i = 0; i < n; i++)
            sums[i] += row[i + k * channels];
    for (int64_t i = 0; i < n; i++)
        means[i] = (float)(sums[i] / (double)window);
}

/* Write the similarity of windows around each pixel of some rows; `luminance` and `contrast` are the
   constants of the paper, and variances are times `unbiased`. */
EXPORT int64_t compare_structures(
    int64_t height, int64_t width, int64_t channels, const float first[height][width][channels],
    const float second[height][width][channels], int64_t window, double unbiased,
    double luminance, double contrast, float out[height][width][channels], int64_t start,
    int64_t stop)
{
    OPEN_ARENA(arena);
    const int64_t n = width * channels;
    double (*sums)[n] = take(arena, N_MEANS, n * sizeof(double));
    float (*means)[n] = take(arena, N_MEANS, n * sizeof(float));
    float *row = TAKE(arena, float, n + window * channels);
    const float (*x)[n] = (const void *)first, (*y)[n] = (const void *)second;
    const float u = (float)unbiased, c1 = (float)luminance, c2 = (float)contrast;
    for (int64_t at = start; at < stop; at++) {
        average_rows(n, x, y, height, at, window, sums, means);
        for (int k = 0; k < N_MEANS; k++)
            average_columns(width, channels, window, row, sums[0], means[k]);
        float *found = (float *)out[at];
        for (int64_t i = 0; i < n; i++) {
            const float a = means[0][i], b = means[1][i];
            const float variances = u * (means[2][i] - a * a) + u * (means[3][i] - b * b);
            const float covariance = u * (means[4][i] - a * b);
            const float alike = (2.0f * a * b + c1) * (2.0f * covariance + c2);
            found[i] = alike / ((a * a + b * b + c1) * (variances + c2));
        }
    }
    close_arena(arena);
    return 0;
}
