/* Cube maps: their values in directions, smaller levels, lighting, and latitude-longitude images.

   A level's texel is the mean of what it covers, weighted by solid angle, so that no level gains or
   loses energy; a converted texel is such a mean of lookups spread over its area.

   Based on: the OpenGL 4.6 specification, sections 8.13 and 8.14 (seamless cube maps); Karis, "Real
   Shading in Unreal Engine 4", 2013, for levels by roughness; Krivanek and Colbert, "Real-time Shading
   with Filtered Importance Sampling", 2008; Duff et al., "Building an Orthonormal Basis, Revisited",
   2017; Heckbert, "Fundamentals of Texture Mapping and Image Warping", 1989, for resampling; Debevec,
   "Rendering Synthetic Objects into Real Scenes", 1998, for panoramas as light sources.

   Called from texbake/texture/cube_map.py and texbake/texture/prefilter.py. */

#include <math.h>
#include <stdint.h>

#include "arena.h"
#include "core.h"
#include "elementary.h"
#include "numbers.h"
#include "texture_lookup.h"

/* A face (0 to 5; -1: none), and s and t on it in [0, 1]. */
struct cube_place {
    int64_t face;
    double s, t;
};

/* The first of four texels, the texels a row has, and how far between them a place lies. */
struct cube_cell {
    int64_t first, stride;
    float along_x, along_y;
};

/* Place of a direction of any length; the same as `cube_map.locate_directions`, without its table. */
static inline struct cube_place find_cube_place(double x, double y, double z)
{
    const double size_x = fabs(x), size_y = fabs(y), size_z = fabs(z);
    struct cube_place place;
    double largest;
    if (size_x >= size_y && size_x >= size_z) {
        largest = size_x;
        place.face = x > 0.0 ? 0 : 1;
        place.s = x > 0.0 ? -z : z;
        place.t = -y;
    } else if (size_y >= size_z) {
        largest = size_y;
        place.face = y > 0.0 ? 2 : 3;
        place.s = x;
        place.t = y > 0.0 ? z : -z;
    } else {
        largest = size_z;
        place.face = z > 0.0 ? 4 : 5;
        place.s = z > 0.0 ? x : -x;
        place.t = -y;
    }
    const double half = 0.5 / largest;
    place.s = place.s * half + 0.5;
    place.t = place.t * half + 0.5;
    /* None of these holds for what is not a number; `half` is 0 where the largest is infinite. */
    if (half > 0.0 && place.s >= -1.0 && place.t >= -1.0) {
        /* Rounding can lead beyond an edge. */
        place.s = clamp_f64(place.s, 0.0, 1.0);
        place.t = clamp_f64(place.t, 0.0, 1.0);
        return place;
    }
    const struct cube_place none = {-1, 0.0, 0.0};
    return none;
}

/* The four texels around a place on a level of `size` texels that begins at `offset`. */
static inline struct cube_cell find_cube_cell(
    int64_t offset, int64_t size, const struct cube_place *place)
{
    const int64_t stride = size + 2;
    const double x = place->s * (double)size + 0.5, y = place->t * (double)size + 0.5;
    const int64_t left = (int64_t)x, top = (int64_t)y;
    const struct cube_cell cell = {
        offset + (place->face * stride + top) * stride + left, stride,
        (float)(x - (double)left), (float)(y - (double)top)};
    return cell;
}

/* Interpolate one channel; exact where the four texels are equal. */
static inline float interpolate_cube_cell(
    int64_t n_channels, const float texels[][n_channels], const struct cube_cell *cell,
    int64_t channel)
{
    const float (*row)[n_channels] = texels + cell->first;
    const float (*next)[n_channels] = row + cell->stride;
    float above = row[0][channel], below = next[0][channel];
    above += cell->along_x * (row[1][channel] - above);
    below += cell->along_x * (next[1][channel] - below);
    return above + cell->along_y * (below - above);
}

/* Rows `start` to `stop` of the smaller faces, counted over all six. `weights` are the solid angles of
   the texels of a larger face. */
EXPORT int64_t shrink_cube_rows(
    int64_t size, int64_t small, int64_t n_channels,
    const float faces[6][size][size][n_channels], const double weights[size][size],
    float out[6][small][small][n_channels], int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    double *sums = TAKE(arena, double, n_channels);
    const double ratio = (double)size / (double)small;
    for (int64_t row = start; row < stop; row++) {
        const int64_t face = row / small;
        const double top = (double)(row % small) * ratio, bottom = top + ratio;
        const int64_t last_y = min_i64((int64_t)ceil(bottom), size);
        for (int64_t column = 0; column < small; column++) {
            const double left = (double)column * ratio, right = left + ratio;
            const int64_t last_x = min_i64((int64_t)ceil(right), size);
            double total = 0.0;
            for (int64_t channel = 0; channel < n_channels; channel++)
                sums[channel] = 0.0;
            for (int64_t y = (int64_t)top; y < last_y; y++) {
                const double height = min_f64((double)y + 1.0, bottom) - max_f64((double)y, top);
                for (int64_t x = (int64_t)left; x < last_x; x++) {
                    const double width = min_f64((double)x + 1.0, right) - max_f64((double)x, left);
                    const double weight =
                        max_f64(width, 0.0) * max_f64(height, 0.0) * weights[y][x];
                    total += weight;
                    for (int64_t channel = 0; channel < n_channels; channel++)
                        sums[channel] += weight * faces[face][y][x][channel];
                }
            }
            for (int64_t channel = 0; channel < n_channels; channel++)
                out[face][row % small][column][channel] = (float)(sums[channel] / total);
        }
    }
    close_arena(arena);
    return 0;
}

/* As in texbake/texture/cube_map.py. */
enum { FILTER_NEAREST, FILTER_BILINEAR, FILTER_TRILINEAR };

static inline void copy_nearest(
    int64_t n_channels, const float texels[][n_channels], int64_t offset, int64_t size,
    const struct cube_place *place, float out[n_channels])
{
    const int64_t y = min_i64((int64_t)(place->t * (double)size), size - 1) + 1;
    const int64_t x = min_i64((int64_t)(place->s * (double)size), size - 1) + 1;
    const int64_t index = offset + (place->face * (size + 2) + y) * (size + 2) + x;
    for (int64_t channel = 0; channel < n_channels; channel++)
        out[channel] = texels[index][channel];
}

/* Values at levels, or at the finest; 0 in directions that belong to no face. */
EXPORT void sample_cube(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n,
    const float texels[n_texels][n_channels], const int64_t offsets[n_levels],
    const int64_t sizes[n_levels], const float directions[n][3], OPTIONAL const float levels[n],
    int64_t filter, float out[n][n_channels], int64_t start, int64_t stop)
{
    const double last = (double)(n_levels - 1);
    for (int64_t i = start; i < stop; i++) {
        const struct cube_place place =
            find_cube_place(directions[i][0], directions[i][1], directions[i][2]);
        if (place.face < 0) {
            for (int64_t channel = 0; channel < n_channels; channel++)
                out[i][channel] = 0.0f;
            continue;
        }
        double level = levels && levels[i] > 0.0f ? min_f64(levels[i], last) : 0.0;
        if (filter != FILTER_TRILINEAR)
            level = floor(level + 0.5);
        const int64_t fine = (int64_t)level;
        if (filter == FILTER_NEAREST) {
            copy_nearest(n_channels, texels, offsets[fine], sizes[fine], &place, out[i]);
            continue;
        }
        struct cube_cell cell = find_cube_cell(offsets[fine], sizes[fine], &place);
        for (int64_t channel = 0; channel < n_channels; channel++)
            out[i][channel] = interpolate_cube_cell(n_channels, texels, &cell, channel);
        const float blend = (float)(level - (double)fine);
        if (!(blend > 0.0f))
            continue;
        cell = find_cube_cell(offsets[fine + 1], sizes[fine + 1], &place);
        for (int64_t channel = 0; channel < n_channels; channel++) {
            const float value = interpolate_cube_cell(n_channels, texels, &cell, channel);
            out[i][channel] += blend * (value - out[i][channel]);
        }
    }
}

/* Mean radiance over the hemisphere about each normal, weighted by cosine. `angles` are the solid
   angles of the directions. */
EXPORT int64_t average_hemispheres(
    int64_t n_directions, int64_t n_channels, int64_t n,
    const float directions[n_directions][3], const double angles[n_directions],
    const float radiance[n_directions][n_channels], const float normals[n][3],
    float out[n][n_channels], int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    double *sums = TAKE(arena, double, n_channels);
    for (int64_t i = start; i < stop; i++) {
        double total = 0.0;
        for (int64_t channel = 0; channel < n_channels; channel++)
            sums[channel] = 0.0;
        for (int64_t j = 0; j < n_directions; j++) {
            const float cosine = normals[i][0] * directions[j][0] +
                                 normals[i][1] * directions[j][1] +
                                 normals[i][2] * directions[j][2];
            if (!(cosine > 0.0f))
                continue;
            const double weight = cosine * angles[j];
            total += weight;
            for (int64_t channel = 0; channel < n_channels; channel++)
                sums[channel] += weight * radiance[j][channel];
        }
        for (int64_t channel = 0; channel < n_channels; channel++)
            out[i][channel] = (float)(sums[channel] / total);
    }
    close_arena(arena);
    return 0;
}

/* Place of a direction of the lobe, which is given with the normal along z. */
static inline struct cube_place find_in_lobe(const double direction[3], const float normal[3])
{
    const double nx = normal[0], ny = normal[1], nz = normal[2];
    const double along = direction[0], across = direction[1], up = direction[2];
    /* Two directions that are perpendicular to the normal and to each other. */
    const double sign = nz >= 0.0 ? 1.0 : -1.0;
    const double a = -1.0 / (sign + nz), b = nx * ny * a;
    return find_cube_place(
        along * (1.0 + sign * nx * nx * a) + across * b + up * nx,
        along * sign * b + across * (sign + ny * ny * a) + up * ny,
        -along * sign * nx - across * ny + up * nz);
}

/* Mean over the lobe about each normal. A row of `lobe` is a direction, the level to read, and the
   weight. */
EXPORT int64_t average_lobes(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n_samples, int64_t n,
    const float texels[n_texels][n_channels], const int64_t offsets[n_levels],
    const int64_t sizes[n_levels], const double lobe[n_samples][5], const float normals[n][3],
    float out[n][n_channels], int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    double *sums = TAKE(arena, double, n_channels);
    for (int64_t i = start; i < stop; i++) {
        double total = 0.0;
        for (int64_t channel = 0; channel < n_channels; channel++)
            sums[channel] = 0.0;
        for (int64_t j = 0; j < n_samples; j++) {
            const int64_t level = (int64_t)lobe[j][3];
            const double weight = lobe[j][4];
            const struct cube_place place = find_in_lobe(lobe[j], normals[i]);
            const struct cube_cell cell = find_cube_cell(offsets[level], sizes[level], &place);
            for (int64_t channel = 0; channel < n_channels; channel++)
                sums[channel] += weight * interpolate_cube_cell(n_channels, texels, &cell, channel);
            total += weight;
        }
        for (int64_t channel = 0; channel < n_channels; channel++)
            out[i][channel] = (float)(sums[channel] / total);
    }
    close_arena(arena);
    return 0;
}

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
