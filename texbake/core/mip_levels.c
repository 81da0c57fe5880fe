/* A smaller level of an image, from the texels and weights that each of its rows and columns takes.

   Based on: Williams, "Pyramidal Parametrics", 1983; mipmaps.py chooses the weights.

   Called from texbake/texture/mipmaps.py. */

#include <math.h>

#include "arena.h"
#include "core.h"

/* Mix the texels of a row of the larger level into a row of the smaller one. */
static inline void mix_columns(
    int64_t width, int64_t n_taps, int64_t n_channels, const float *restrict line,
    const int64_t columns[restrict width][n_taps], const float weights[restrict width][n_taps],
    float out[restrict width][n_channels])
{
    for (int64_t column = 0; column < width; column++) {
        const float *first = line + columns[column][0] * n_channels;
        for (int64_t channel = 0; channel < n_channels; channel++)
            out[column][channel] = first[channel];
        for (int64_t tap = 1; tap < n_taps; tap++) {
            const float *other = line + columns[column][tap] * n_channels;
            const float weight = weights[column][tap];
            for (int64_t channel = 0; channel < n_channels; channel++)
                out[column][channel] += weight * (other[channel] - first[channel]);
        }
    }
}

/* Mix rows of the larger level. Differences from one of the texels are added, so that a constant stays
   exactly what it is. */
static void mix_rows(
    int64_t n_values, const float *restrict base, const float *restrict other, float weight,
    float *restrict line)
{
    for (int64_t k = 0; k < n_values; k++)
        line[k] += weight * (other[k] - base[k]);
}

/* Fill rows `start` to `stop` of the smaller level. `values` are the rows of the larger one, all
   channels of a texel together. */
EXPORT int64_t fill_mip_level(
    int64_t n_rows, int64_t n_values, int64_t height, int64_t width, int64_t n_channels,
    int64_t n_row_taps, int64_t n_column_taps, const float values[n_rows][n_values],
    const int64_t rows[height][n_row_taps], const float row_weights[height][n_row_taps],
    const int64_t columns[width][n_column_taps], const float column_weights[width][n_column_taps],
    float out[height][width][n_channels], int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    float *line = TAKE(arena, float, n_values);
    for (int64_t row = start; row < stop; row++) {
        const float *base = values[rows[row][0]];
        for (int64_t k = 0; k < n_values; k++)
            line[k] = base[k];
        for (int64_t tap = 1; tap < n_row_taps; tap++)
            mix_rows(n_values, base, values[rows[row][tap]], row_weights[row][tap], line);
        /* With a known number of channels the loops over them become straight code. */
        if (n_channels == 3)
            mix_columns(
                width, n_column_taps, 3, line, columns, column_weights, (float (*)[3])out[row]);
        else
            mix_columns(
                width, n_column_taps, n_channels, line, columns, column_weights, out[row]);
    }
    close_arena(arena);
    return 0;
}

/* Write vectors of length 1, or of 0 where there is none or a component is not finite. They are divided
   by their largest component first, because its square may overflow. */
EXPORT void normalize_vectors(
    int64_t n, const float vectors[n][3], float out[n][3], int64_t start, int64_t stop)
{
    for (int64_t i = start; i < stop; i++) {
        const float x = vectors[i][0], y = vectors[i][1], z = vectors[i][2];
        const float largest = fmaxf(fmaxf(fabsf(x), fabsf(y)), fabsf(z));
        const bool is_sound = largest > 0.0f && isfinite(x) && isfinite(y) && isfinite(z);
        const float a = is_sound ? x / largest : 0.0f, b = is_sound ? y / largest : 0.0f;
        const float c = is_sound ? z / largest : 0.0f;
        const float length = is_sound ? sqrtf(a * a + b * b + c * c) : 1.0f;
        out[i][0] = a / length;
        out[i][1] = b / length;
        out[i][2] = c / length;
    }
}
