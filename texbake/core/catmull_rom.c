/* Bicubic filtering: sixteen texels of the finest level, with the weights of Catmull and Rom.

   These interpolate, which a B-spline does not: at its center a texel keeps its own value, as with the
   bilinear filter, so that changing the filter neither blurs the image nor shifts its brightness; and
   polynomials up to the second degree are reproduced. The price is overshoot beside hard edges, by at
   most 9/32 of the range of the texels in two dimensions: callers whose values must stay within a
   range have to clip them. First derivatives are continuous.

   Based on: Catmull and Rom, "A Class of Local Interpolating Splines", 1974; Keys, "Cubic Convolution
   Interpolation for Digital Image Processing", 1981 (a = -1/2).

   Called from texbake/texture/sample.py. */

#include <math.h>

#include "core.h"
#include "texture_lookup.h"

/* Weights of the texels before, after and beyond the one at which a place lies; that one, which is 1
   less the others, is left out. */
struct cubic_weights {
    float before, after, beyond;
};

static inline struct cubic_weights weigh_neighbors(double along)
{
    const struct cubic_weights weights = {
        (float)(0.5 * along * (along * (2.0 - along) - 1.0)),
        (float)(0.5 * along * (along * (4.0 - 3.0 * along) + 1.0)),
        (float)(0.5 * along * along * (along - 1.0)),
    };
    return weights;
}

static inline float mix_four(const float values[4], const struct cubic_weights *weights)
{
    const float b = values[1];
    return b + (weights->before * (values[0] - b) + weights->after * (values[2] - b) +
                weights->beyond * (values[3] - b));
}

/* Fill rows `start` to `stop` of `out` from the finest level. */
EXPORT void sample_bicubic(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n,
    const float texels[n_texels][n_channels], const int64_t sizes[n_levels][2],
    const double uvs[n][2], int64_t wraps, const float border[n_channels],
    float out[n][n_channels], int64_t start, int64_t stop)
{
    const int64_t height = sizes[0][0], width = sizes[0][1];
    for (int64_t i = start; i < stop; i++) {
        const double x = wrap_to_period(uvs[i][0], wrap_along_u(wraps)) * (double)width - 0.5;
        const double v = wrap_to_period(uvs[i][1], wrap_along_v(wraps));
        const double y = row_of_v(v, (double)height) - 0.5;
        const int64_t left = (int64_t)floor(x) - 1, top = (int64_t)floor(y) - 1;
        const float *sources[4][4];
        for (int row = 0; row < 4; row++)
            for (int column = 0; column < 4; column++) {
                const int64_t index = texel_at(left + column, top + row, width, height, wraps);
                sources[row][column] = index >= 0 ? texels[index] : border;
            }
        const struct cubic_weights across = weigh_neighbors(x - floor(x));
        const struct cubic_weights down = weigh_neighbors(y - floor(y));
        for (int64_t channel = 0; channel < n_channels; channel++) {
            float rows[4];
            for (int row = 0; row < 4; row++) {
                float values[4];
                for (int column = 0; column < 4; column++)
                    values[column] = sources[row][column][channel];
                rows[row] = mix_four(values, &across);
            }
            out[i][channel] = mix_four(rows, &down);
        }
    }
}
