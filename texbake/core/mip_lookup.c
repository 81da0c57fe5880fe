/* Trilinear filtering: four texels of each of the two mip levels whose texels are about as large as a
   pixel. Without derivatives everything is read from the finest level, which is the bilinear filter.
   The weights are in single precision, for speed.

   Based on: Williams, "Pyramidal Parametrics", 1983, and the OpenGL 4.6 specification, section 8.14:
   rho is the longer of the two steps, in texels, that one pixel to the right and one pixel down make
   on the texture.

   Called from texbake/texture/sample.py. */

#include <math.h>

#include "core.h"
#include "elementary.h"
#include "numbers.h"
#include "texture_lookup.h"

/* Level whose texels are as large as a pixel: log2 of rho, below 0 where it is less. Minus infinity
   where coordinates do not change; what is not a number counts as no change. */
static inline float footprint_level(const float derivatives[4], float width, float height)
{
    const float right_u = derivatives[0] * width, right_v = derivatives[1] * height;
    const float down_u = derivatives[2] * width, down_v = derivatives[3] * height;
    const float right = right_u * right_u + right_v * right_v;
    const float down = down_u * down_u + down_v * down_v;
    /* Comparisons are false for what is not a number. */
    float squared = right > 0.0f ? right : 0.0f;
    squared = down > squared ? down : squared;
    if (squared > 0.0f && squared < INFINITY)
        return (float)(0.5 * short_log2(squared));
    return squared > 0.0f ? squared : -INFINITY;
}

EXPORT void find_mip_levels(
    int64_t n, const float derivatives[n][4], float width, float height, float out[n],
    int64_t start, int64_t stop)
{
    for (int64_t i = start; i < stop; i++)
        out[i] = footprint_level(derivatives[i], width, height);
}

/* Three channels between the four texels of a cell inside the image; the same numbers as from
   `interpolate_cell_f32`, without a test of each texel. */
static inline void mix_colors(
    const float texels[][3], const struct texel_cell *cell, float mixed[3])
{
    const float *a = texels[cell->above_left], *b = texels[cell->above_right];
    const float *c = texels[cell->below_left], *d = texels[cell->below_right];
    const float x = (float)cell->x, y = (float)cell->y;
    for (int channel = 0; channel < 3; channel++) {
        const float above = a[channel] + x * (b[channel] - a[channel]);
        const float below = c[channel] + x * (d[channel] - c[channel]);
        mixed[channel] = above + y * (below - above);
    }
}

/* Fill rows `start` to `stop` of `out`; without derivatives, from the finest level. */
EXPORT void sample_trilinear(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n,
    const float texels[n_texels][n_channels], const int64_t offsets[n_levels],
    const int64_t sizes[n_levels][2], const double uvs[n][2],
    OPTIONAL const float derivatives[n][4], int64_t wraps, const float border[n_channels],
    float out[n][n_channels], int64_t start, int64_t stop)
{
    const float last = (float)(n_levels - 1);
    const float height = (float)sizes[0][0], width = (float)sizes[0][1];
    const bool has_colors = n_channels == 3 && !has_border(wraps);
    for (int64_t i = start; i < stop; i++) {
        const double u = wrap_to_unit(uvs[i][0], wrap_along_u(wraps));
        const double v = wrap_to_unit(uvs[i][1], wrap_along_v(wraps));
        float level = derivatives ? footprint_level(derivatives[i], width, height) : 0.0f;
        level = level > 0.0f ? min_f32(level, last) : 0.0f;
        const int64_t fine = (int64_t)level;
        const float blend = level - (float)fine;
        const int64_t coarse = blend > 0.0f ? fine + 1 : fine;
        const struct texel_cell cell =
            bilinear_cell(u, v, sizes[fine][1], sizes[fine][0], wraps, offsets[fine]);
        const struct texel_cell far_cell = coarse == fine ? cell : bilinear_cell(
            u, v, sizes[coarse][1], sizes[coarse][0], wraps, offsets[coarse]);
        if (has_colors) {
            float near[3], far[3];
            mix_colors((const float (*)[3])texels, &cell, near);
            if (coarse != fine) {
                mix_colors((const float (*)[3])texels, &far_cell, far);
                for (int channel = 0; channel < 3; channel++)
                    near[channel] += blend * (far[channel] - near[channel]);
            }
            for (int channel = 0; channel < 3; channel++)
                out[i][channel] = near[channel];
            continue;
        }
        for (int64_t channel = 0; channel < n_channels; channel++) {
            const float outside = border[channel];
            const float near = interpolate_cell_f32(n_channels, texels, &cell, channel, outside);
            if (coarse == fine) {
                out[i][channel] = near;
                continue;
            }
            const float far = interpolate_cell_f32(n_channels, texels, &far_cell, channel, outside);
            out[i][channel] = near + blend * (far - near);
        }
    }
}
