/* Lookup in a cube map by direction, in the bordered faces of a `CubeChain` or a `CubeMap`.

   Based on: the OpenGL 4.6 specification, sections 8.13 and 8.14. Departs from it for directions that
   are zero or not finite, which belong to no face. */

#pragma once

#include <math.h>
#include <stdint.h>

#include "numbers.h"

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
