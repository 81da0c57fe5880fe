/* Lookups in images, volumes and ramps: the nearest texel, a linear mix of the texels around a place,
   and the filters that take more of an image.

   Trilinear filtering reads four texels of each of the two mip levels whose texels are about as large
   as a pixel, with weights in single precision, for speed; without derivatives it reads the finest
   level alone. The bicubic filter keeps the value of a texel at its center, which a B-spline does not,
   and overshoots beside hard edges by at most 9/32 of the range of the texels. Supersampling spreads
   bilinear lookups in the finest level evenly over the pixel: the slow reference of the other filters,
   with which it shares no level.

   Based on: the OpenGL 4.6 specification, section 8.14; Peachey, "Solid Texturing of Complex Surfaces",
   1985 (volumes); Williams, "Pyramidal Parametrics", 1983 (mip levels; rho is the longer of the two
   steps of a pixel, in texels); Catmull and Rom, "A Class of Local Interpolating Splines", 1974; Keys,
   "Cubic Convolution Interpolation for Digital Image Processing", 1981 (a = -1/2); Heckbert,
   "Fundamentals of Texture Mapping and Image Warping", 1989 (the parallelogram of a pixel).

   Called from texbake/texture/lookup.py and texbake/texture/sample.py. */

#include <math.h>

#include "arena.h"
#include "core.h"
#include "elementary.h"
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

EXPORT void sample_ramp(
    int64_t n_stops, int64_t n_channels, int64_t n,
    const float stops[n_stops][n_channels], const float values[n], float out[n][n_channels],
    int64_t start, int64_t stop)
{
    const int64_t last = n_stops - 1;
    for (int64_t i = start; i < stop; i++) {
        const double place = wrap_to_unit(values[i], WRAP_CLAMP) * (double)last;
        const int64_t first = max_i64(min_i64((int64_t)place, last - 1), 0);
        const int64_t second = min_i64(first + 1, last);
        const float along = (float)(place - (double)first);
        for (int64_t channel = 0; channel < n_channels; channel++) {
            const float value = stops[first][channel];
            out[i][channel] = value + along * (stops[second][channel] - value);
        }
    }
}

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
