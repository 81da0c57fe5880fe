/* Lookups in a volume, a stack of images: the texel that holds a place, or a mix of the eight
   texels around it.

   Based on: the OpenGL 4.6 specification, section 8.14; Peachey, "Solid Texturing of Complex
   Surfaces", 1985.

   Called from texbake/texture/lookup.py. */

#include <math.h>

#include "core.h"
#include "texture_lookup.h"

struct volume_size {
    int64_t depth, height, width;
};

/* Index of the texel that stands anywhere; OUTSIDE for the border. */
static inline int64_t volume_texel(
    int64_t column, int64_t row, int64_t layer, const struct volume_size *size, int64_t wrap)
{
    layer = wrap_index(layer, size->depth, wrap);
    const int64_t index = texel_at(column, row, size->width, size->height, wrap_alike(wrap));
    return layer >= 0 && index >= 0 ? layer * size->height * size->width + index : OUTSIDE;
}

static inline struct texel_cell slice_cell(
    int64_t left, int64_t top, int64_t layer, const struct volume_size *size, int64_t wrap,
    double x, double y)
{
    const struct texel_cell cell = {
        volume_texel(left, top, layer, size, wrap),
        volume_texel(left + 1, top, layer, size, wrap),
        volume_texel(left, top + 1, layer, size, wrap),
        volume_texel(left + 1, top + 1, layer, size, wrap),
        x,
        y,
    };
    return cell;
}

/* Nearest or trilinear values at points (s, t, r), t up. */
EXPORT void sample_volume(
    int64_t depth, int64_t height, int64_t width, int64_t n_channels, int64_t n,
    const float volume[depth][height][width][n_channels], const double points[n][3], bool nearest,
    int64_t wrap, const float border[n_channels], float out[n][n_channels], int64_t start,
    int64_t stop)
{
    const struct volume_size size = {depth, height, width};
    const float (*texels)[n_channels] = volume[0][0];
    for (int64_t i = start; i < stop; i++) {
        const double x = wrap_to_period(points[i][0], wrap) * (double)width;
        const double y = row_of_v(wrap_to_period(points[i][1], wrap), (double)height);
        const double z = wrap_to_period(points[i][2], wrap) * (double)depth;
        if (nearest) {
            /* A texel holds its left, its lower and its front side, as in an image. */
            const int64_t index = volume_texel(
                (int64_t)floor(x), (int64_t)ceil(y) - 1, (int64_t)floor(z), &size, wrap);
            const float *from = index >= 0 ? texels[index] : border;
            for (int64_t channel = 0; channel < n_channels; channel++)
                out[i][channel] = from[channel];
            continue;
        }
        const int64_t left = (int64_t)floor(x - 0.5), top = (int64_t)floor(y - 0.5);
        const int64_t front = (int64_t)floor(z - 0.5);
        const double along_x = x - 0.5 - (double)left, along_y = y - 0.5 - (double)top;
        const float along_z = (float)(z - 0.5 - (double)front);
        const struct texel_cell cell = slice_cell(left, top, front, &size, wrap, along_x, along_y);
        const struct texel_cell behind =
            slice_cell(left, top, front + 1, &size, wrap, along_x, along_y);
        for (int64_t channel = 0; channel < n_channels; channel++) {
            const float outside = border[channel];
            const float near = interpolate_cell_f32(n_channels, texels, &cell, channel, outside);
            const float far = interpolate_cell_f32(n_channels, texels, &behind, channel, outside);
            out[i][channel] = near + along_z * (far - near);
        }
    }
}
