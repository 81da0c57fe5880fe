/* Supersampling: bilinear lookups in the finest level, spread evenly over the pixel. The slow
   reference of the texture filters.

   It reads only the finest level, so that it shares nothing with the filters that read smaller ones,
   and gives all lookups the same weight, as a square pixel does. The caller chooses the places.

   Based on: Heckbert, "Fundamentals of Texture Mapping and Image Warping", 1989, for the
   parallelogram that a pixel covers.

   Called from texbake/texture/sample.py. */

#include "arena.h"
#include "core.h"
#include "texture_lookup.h"

/* Fill rows `start` to `stop` of `out`; `samples` are places in a pixel, (0, 0) in its middle. */
EXPORT int64_t sample_supersampled(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n, int64_t n_samples,
    const float texels[n_texels][n_channels], const int64_t sizes[n_levels][2],
    const double uvs[n][2], const float derivatives[n][4], const double samples[n_samples][2],
    int64_t wraps, const float border[n_channels], float out[n][n_channels], int64_t start,
    int64_t stop)
{
    OPEN_ARENA(arena);
    const int64_t height = sizes[0][0], width = sizes[0][1];
    double *sums = TAKE(arena, double, n_channels);
    for (int64_t i = start; i < stop; i++) {
        for (int64_t channel = 0; channel < n_channels; channel++)
            sums[channel] = 0.0;
        for (int64_t k = 0; k < n_samples; k++) {
            const double right = samples[k][0], down = samples[k][1];
            const double u = uvs[i][0] + right * derivatives[i][0] + down * derivatives[i][2];
            const double v = uvs[i][1] + right * derivatives[i][1] + down * derivatives[i][3];
            const struct texel_cell cell = bilinear_cell(
                wrap_to_unit(u, wrap_along_u(wraps)), wrap_to_unit(v, wrap_along_v(wraps)), width, height,
                wraps, 0);
            for (int64_t channel = 0; channel < n_channels; channel++)
                sums[channel] +=
                    interpolate_cell(n_channels, texels, &cell, channel, border[channel]);
        }
        for (int64_t channel = 0; channel < n_channels; channel++)
            out[i][channel] = (float)(sums[channel] / (double)n_samples);
    }
    close_arena(arena);
    return 0;
}
