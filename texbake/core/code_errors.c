/* Squared differences of the 8-bit codes of pictures, summed exactly.

   Differences of colors can be weighted by the alpha of the second picture. A picture of half the size is
   enlarged by bilinear interpolation, whose values are whole sixteenths.

   Called from texbake/jobs/light_images.py and texbake/jobs/light_codings.py. */

#include "core.h"

enum { COLORS = 3, UNIT = 16 };

/* Add the squared differences of the colors to sums[0], and that of alpha, if there is one, to
   sums[1]. */
static inline void add_texel(
    int64_t n_channels, const int32_t one[n_channels], const uint8_t other[n_channels], int32_t unit,
    bool by_alpha, int64_t sums[2])
{
    int64_t colors = 0;
    for (int64_t channel = 0; channel < COLORS; channel++) {
        const int64_t apart = one[channel] - unit * other[channel];
        colors += apart * apart;
    }
    if (n_channels > COLORS) {
        const int64_t apart = one[COLORS] - unit * other[COLORS];
        sums[1] += apart * apart;
    }
    sums[0] += by_alpha ? colors * other[COLORS] : colors;
}

/* Write the sums of squared differences of two pictures, of colors and of alpha. */
EXPORT void sum_code_errors(
    int64_t n, int64_t n_channels, const uint8_t one[n][n_channels],
    const uint8_t other[n][n_channels], bool by_alpha, int64_t sums[2])
{
    sums[0] = sums[1] = 0;
    for (int64_t i = 0; i < n; i++) {
        int32_t codes[COLORS + 1];
        for (int64_t channel = 0; channel < n_channels; channel++)
            codes[channel] = one[i][channel];
        add_texel(n_channels, codes, other[i], 1, by_alpha, sums);
    }
}

/* Row or column of the smaller picture beside a texel of the larger one that is not the nearest. */
static inline int64_t beside(int64_t place, int64_t size)
{
    const int64_t other = place / 2 + (place % 2 ? 1 : -1);
    return other < 0 ? 0 : other >= size ? size - 1 : other;
}

/* Write the sums for a picture that is enlarged to twice its size, in units of 1 / 256. */
EXPORT void sum_enlarged_errors(
    int64_t height, int64_t width, int64_t n_rows, int64_t n_columns, int64_t n_channels,
    const uint8_t small[height][width][n_channels],
    const uint8_t larger[n_rows][n_columns][n_channels], bool by_alpha, int64_t sums[2])
{
    sums[0] = sums[1] = 0;
    for (int64_t row = 0; row < n_rows; row++) {
        const uint8_t(*near)[n_channels] = small[row / 2];
        const uint8_t(*far)[n_channels] = small[beside(row, height)];
        for (int64_t column = 0; column < n_columns; column++) {
            const int64_t at = column / 2, next = beside(column, width);
            int32_t codes[COLORS + 1];
            for (int64_t channel = 0; channel < n_channels; channel++)
                codes[channel] = 9 * near[at][channel] + 3 * near[next][channel] +
                                 3 * far[at][channel] + far[next][channel];
            add_texel(n_channels, codes, larger[row][column], UNIT, by_alpha, sums);
        }
    }
}
