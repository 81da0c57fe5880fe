/* The values of texels from those of their samples: the mean of the hits, or the first of them.

   Called from texbake/baking/texel_values.py. */

#include <math.h>

#include "core.h"

/* How samples are combined, as in texbake/baking/texel_values.py. */
enum { MEAN, UNIT_MEAN, FIRST };

EXPORT void add_samples(
    int64_t n, int64_t n_texels, int64_t n_channels, const int32_t texel_ids[n],
    const float values[n][n_channels], float sums[n_texels][n_channels])
{
    for (int64_t i = 0; i < n; i++)
        for (int64_t channel = 0; channel < n_channels; channel++)
            sums[texel_ids[i]][channel] += values[i][channel];
}

/* Give texels that have no sample yet the first of their values. */
EXPORT void keep_first_samples(
    int64_t n, int64_t n_texels, int64_t n_channels, const int32_t texel_ids[n],
    const float values[n][n_channels], const uint8_t counts[n_texels],
    float sums[n_texels][n_channels])
{
    for (int64_t i = n - 1; i >= 0; i--)
        if (counts[texel_ids[i]] == 0)
            for (int64_t channel = 0; channel < n_channels; channel++)
                sums[texel_ids[i]][channel] = values[i][channel];
}

EXPORT void count_samples(
    int64_t n, int64_t n_texels, const int32_t texel_ids[n], uint8_t counts[n_texels])
{
    for (int64_t i = 0; i < n; i++)
        counts[texel_ids[i]]++;
}

/* Combine sums in place: their mean, their direction, or as they are. */
EXPORT void combine_samples(
    int64_t n, int64_t n_channels, float sums[n][n_channels], const uint8_t counts[n],
    const float neutral[n_channels], int64_t mode)
{
    for (int64_t i = 0; i < n; i++) {
        double divisor = counts[i];
        if (mode == UNIT_MEAN && divisor > 0.0) {
            double square = 0.0;
            for (int64_t channel = 0; channel < n_channels; channel++)
                square += sums[i][channel] * sums[i][channel];
            divisor = sqrt(square);
        } else if (mode == FIRST && divisor > 0.0) {
            divisor = 1.0;
        }
        for (int64_t channel = 0; channel < n_channels; channel++)
            sums[i][channel] =
                divisor > 0.0 ? (float)(sums[i][channel] / divisor) : neutral[channel];
    }
}
