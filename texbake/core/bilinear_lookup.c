/* Lookups in the finest level of an image: the texel that holds a place, or a mix of the four
   texels around it.

   Based on: the OpenGL 4.6 specification, section 8.14, for nearest lookup; texture_lookup.h for
   bilinear interpolation.

   Called from texbake/texture/lookup.py and texbake/texture/sample.py. */

#include <math.h>

#include "core.h"
#include "numbers.h"
#include "texture_lookup.h"

/* Bilinear values of an image without mip levels, with weights in double precision. */
EXPORT void sample_bilinear(
    int64_t height, int64_t width, int64_t n_channels, int64_t n,
    const float image[height][width][n_channels], const double uvs[n][2], int64_t wraps,
    const float border[n_channels], float out[n][n_channels], int64_t start, int64_t stop)
{
    const float (*texels)[n_channels] = image[0];
    for (int64_t i = start; i < stop; i++) {
        const double u = wrap_to_unit(uvs[i][0], wrap_along_u(wraps));
        const double v = wrap_to_unit(uvs[i][1], wrap_along_v(wraps));
        const struct texel_cell cell = bilinear_cell(u, v, width, height, wraps, 0);
        for (int64_t channel = 0; channel < n_channels; channel++)
            out[i][channel] =
                (float)interpolate_cell(n_channels, texels, &cell, channel, border[channel]);
    }
}

/* The texel that holds each coordinate; a texel holds its left and its lower edge. */
EXPORT void sample_nearest(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n,
    const float texels[n_texels][n_channels], const int64_t sizes[n_levels][2],
    const double uvs[n][2], int64_t wraps, const float border[n_channels],
    float out[n][n_channels], int64_t start, int64_t stop)
{
    const int64_t height = sizes[0][0], width = sizes[0][1];
    for (int64_t i = start; i < stop; i++) {
        const double x = wrap_to_unit(uvs[i][0], wrap_along_u(wraps)) * (double)width;
        const double y = row_of_v(wrap_to_unit(uvs[i][1], wrap_along_v(wraps)), (double)height);
        const int64_t column = (int64_t)floor(min_f64(max_f64(x, -1.0), (double)width));
        const int64_t row = (int64_t)ceil(min_f64(max_f64(y, 0.0), (double)height + 1.0)) - 1;
        const int64_t index = texel_at(column, row, width, height, wraps);
        const float *from = index >= 0 ? texels[index] : border;
        for (int64_t channel = 0; channel < n_channels; channel++)
            out[i][channel] = from[channel];
    }
}
