/* Conversion between cube maps and latitude-longitude images: each texel is the mean of lookups spread
   over the area that it covers, weighted by solid angle.

   Based on: Heckbert, "Fundamentals of Texture Mapping and Image Warping", 1989, for prefilter,
   reconstruction and resampling; Debevec, "Rendering Synthetic Objects into Real Scenes", 1998, for
   panoramas as light sources.

   Called from texbake/texture/cube_lookup.py. */

#include <math.h>

#include "arena.h"
#include "core.h"
#include "cube_lookup.h"
#include "elementary.h"
#include "numbers.h"
#include "texture_lookup.h"

static const double PI = 3.141592653589793;

/* Of each face: the directions in which s and t grow, and the direction of its middle. As in
   texbake/texture/cube_map.py. */
static const double FACE_AXES[6][3][3] = {
    {{0, 0, -1}, {0, -1, 0}, {1, 0, 0}},
    {{0, 0, 1}, {0, -1, 0}, {-1, 0, 0}},
    {{1, 0, 0}, {0, 0, 1}, {0, 1, 0}},
    {{1, 0, 0}, {0, 0, -1}, {0, -1, 0}},
    {{1, 0, 0}, {0, -1, 0}, {0, 0, 1}},
    {{-1, 0, 0}, {0, -1, 0}, {0, 0, -1}},
};

/* Add `weight` times the bilinear value in a unit direction to `sums`. Beyond a pole lies the same
   row, half a turn away. */
static void add_from_image(
    int64_t height, int64_t width, int64_t n_channels,
    const float image[height][width][n_channels], double x, double y, double z, double weight,
    double sums[n_channels])
{
    const double column = (portable_atan2(x, -z) / (2 * PI) + 0.5) * (double)width - 0.5;
    const double v = portable_asin(clamp_f64(y, -1.0, 1.0)) / PI + 0.5;
    const double row = row_of_v(v, (double)height) - 0.5;
    const int64_t above = (int64_t)floor(row);
    for (int64_t corner = 0; corner < 2; corner++) {
        int64_t here = above + corner;
        double at = column;
        if (here < 0 || here >= height) {
            here = clamp_i64(here, 0, height - 1);
            at += 0.5 * (double)width;
        }
        const double whole = floor(at), along = at - whole;
        const int64_t left = floor_mod((int64_t)whole, width);
        const int64_t right = left + 1 < width ? left + 1 : 0;
        const double down = row - (double)above;
        const double share = weight * (corner == 1 ? down : 1.0 - down);
        for (int64_t channel = 0; channel < n_channels; channel++) {
            const double first = image[here][left][channel];
            sums[channel] += share * (first + along * (image[here][right][channel] - first));
        }
    }
}

/* Rows of faces, counted over all six, from a latitude-longitude image. */
EXPORT int64_t convert_to_cube(
    int64_t height, int64_t width, int64_t n_channels, int64_t size,
    const float image[height][width][n_channels], int64_t n_lookups,
    float out[6][size][size][n_channels], int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    double *sums = TAKE(arena, double, n_channels);
    const double step = 2.0 / (double)(size * n_lookups);
    for (int64_t index = start; index < stop; index++) {
        const int64_t face = index / size, row = index % size;
        const double *across = FACE_AXES[face][0], *down = FACE_AXES[face][1];
        const double *middle = FACE_AXES[face][2];
        for (int64_t column = 0; column < size; column++) {
            double total = 0.0;
            for (int64_t channel = 0; channel < n_channels; channel++)
                sums[channel] = 0.0;
            for (int64_t i = 0; i < n_lookups * n_lookups; i++) {
                const int64_t lookup_x = column * n_lookups + i % n_lookups;
                const int64_t lookup_y = row * n_lookups + i / n_lookups;
                const double s = ((double)lookup_x + 0.5) * step - 1.0;
                const double t = ((double)lookup_y + 0.5) * step - 1.0;
                const double shrink = 1.0 / sqrt(1.0 + s * s + t * t);
                /* The solid angle of a piece of the face falls with the cube of its distance. */
                const double weight = shrink * shrink * shrink;
                add_from_image(
                    height, width, n_channels, image,
                    (s * across[0] + t * down[0] + middle[0]) * shrink,
                    (s * across[1] + t * down[1] + middle[1]) * shrink,
                    (s * across[2] + t * down[2] + middle[2]) * shrink, weight, sums);
                total += weight;
            }
            for (int64_t channel = 0; channel < n_channels; channel++)
                out[face][row][column][channel] = (float)(sums[channel] / total);
        }
    }
    close_arena(arena);
    return 0;
}

/* Rows of a latitude-longitude image from the bordered faces of a cube map. */
EXPORT int64_t convert_from_cube(
    int64_t n_texels, int64_t n_channels, int64_t height, int64_t width,
    const float texels[n_texels][n_channels], int64_t size, int64_t n_lookups,
    float out[height][width][n_channels], int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    double *sums = TAKE(arena, double, n_channels);
    for (int64_t row = start; row < stop; row++) {
        /* Toward the poles texels are narrower, and need fewer lookups across. */
        const double middle = (0.5 - ((double)row + 0.5) / (double)height) * PI;
        const int64_t n_across = max_i64(1, (int64_t)ceil((double)n_lookups * portable_cos(middle)));
        for (int64_t column = 0; column < width; column++) {
            double total = 0.0;
            for (int64_t channel = 0; channel < n_channels; channel++)
                sums[channel] = 0.0;
            for (int64_t i = 0; i < n_lookups; i++) {
                const double at = (double)row + ((double)i + 0.5) / (double)n_lookups;
                const double latitude = (row_of_v(at / (double)height, 1.0) - 0.5) * PI;
                const double weight = portable_cos(latitude), y = portable_sin(latitude);
                for (int64_t j = 0; j < n_across; j++) {
                    const double across = (double)column + ((double)j + 0.5) / (double)n_across;
                    const double longitude = (across / (double)width - 0.5) * 2 * PI;
                    const struct cube_place place = find_cube_place(
                        weight * portable_sin(longitude), y, -weight * portable_cos(longitude));
                    const struct cube_cell cell = find_cube_cell(0, size, &place);
                    for (int64_t channel = 0; channel < n_channels; channel++)
                        sums[channel] +=
                            weight * interpolate_cube_cell(n_channels, texels, &cell, channel);
                    total += weight;
                }
            }
            for (int64_t channel = 0; channel < n_channels; channel++)
                out[row][column][channel] = (float)(sums[channel] / total);
        }
    }
    close_arena(arena);
    return 0;
}
