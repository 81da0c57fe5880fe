/* Texture lookup: wrap modes, and interpolation between four texels.

   A texture coordinate (u, v) has v up and (0, 0) at the lower left corner of the image; row 0 of an
   image is its top. In texels, the continuous coordinates (x, y) run down from the top edge, and the
   center of the texel in column i and row j is (i + 0.5, j + 0.5). `row_of_v` is the one place where
   v up becomes rows down.

   Based on: Heckbert, "Fundamentals of Texture Mapping and Image Warping", 1989, for texel centers
   and bilinear interpolation; the OpenGL 4.6 specification, section 8.14, for the wrap modes. Departs
   from the latter in that the weights are double. */

#pragma once

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "numbers.h"

/* As in texbake/texture/lookup.py. */
enum { WRAP_REPEAT, WRAP_CLAMP, WRAP_MIRROR, WRAP_BORDER };

/* Lookups in images take a mode for each direction in one number: that along u, plus four times that
   along v. A lookup along one axis takes a mode alone. */
static inline int64_t wrap_along_u(int64_t wraps) { return wraps & 3; }
static inline int64_t wrap_along_v(int64_t wraps) { return wraps >> 2; }
static inline int64_t wrap_alike(int64_t wrap) { return wrap | wrap << 2; }
static inline bool has_border(int64_t wraps)
{
    return wrap_along_u(wraps) == WRAP_BORDER || wrap_along_v(wraps) == WRAP_BORDER;
}

/* Index of a texel that lies outside an image with a border. */
enum { OUTSIDE = -1 };

/* Four texels and how far between them, in [0, 1), a place lies. */
struct texel_cell {
    int64_t above_left, above_right, below_left, below_right;
    double x, y;
};

/* Continuous row, down from the top edge, of a v that goes up from the bottom edge. Its own inverse
   on the unit square: `row_of_v(row / height, 1.0)` is the v of a row. */
static inline double row_of_v(double v, double height) { return (1.0 - v) * height; }

/* Coordinate in [0, 1] that reads the same as `u`; with a border, `u` itself. One that is not a
   number counts as 0, and so does an infinite one that repeats or is mirrored. */
static inline double wrap_to_unit(double u, int64_t wrap)
{
    if (wrap == WRAP_REPEAT) {
        u -= floor(u);
        /* False for what is not a number, and for 1 left over from a negative number too small to
           subtract from 1. */
        return u < 1.0 ? u : 0.0;
    }
    if (wrap == WRAP_MIRROR) {
        u = fabs(u - 2.0 * floor(0.5 * u + 0.5));
        return u <= 1.0 ? u : 0.0;
    }
    if (wrap == WRAP_CLAMP)
        return u > 0.0 ? min_f64(u, 1.0) : 0.0;
    return u == u ? u : 0.0;
}

/* Coordinate about which all texels stand as they do about `u`, small enough to count texels. In
   [0, 1) where the image repeats and in [0, 2) where it is mirrored. NaN and infinity count as in
   `wrap_to_unit`. For `wrap_index`, by lookups that read more than the next texel. */
static inline double wrap_to_period(double u, int64_t wrap)
{
    const double farthest = 1 << 30;
    if (wrap == WRAP_REPEAT)
        return wrap_to_unit(u, wrap);
    if (wrap == WRAP_MIRROR) {
        u -= 2.0 * floor(0.5 * u);
        return u < 2.0 ? u : 0.0;
    }
    return u == u ? max_f64(min_f64(u, farthest), -farthest) : 0.0;
}

/* Row or column that stands at any index along an axis of `size` texels; OUTSIDE for none. */
static inline int64_t wrap_index(int64_t index, int64_t size, int64_t wrap)
{
    if (index >= 0 && index < size)
        return index;
    if (wrap == WRAP_REPEAT)
        return floor_mod(index, size);
    if (wrap == WRAP_MIRROR) {
        index = floor_mod(index, 2 * size);
        return min_i64(index, 2 * size - 1 - index);
    }
    if (wrap == WRAP_CLAMP)
        return index < 0 ? 0 : size - 1;
    return OUTSIDE;
}

/* Index, counted along rows, of the texel that stands in any column and row; or OUTSIDE. */
static inline int64_t texel_at(
    int64_t column, int64_t row, int64_t width, int64_t height, int64_t wraps)
{
    column = wrap_index(column, width, wrap_along_u(wraps));
    row = wrap_index(row, height, wrap_along_v(wraps));
    return column >= 0 && row >= 0 ? row * width + column : OUTSIDE;
}

/* Find the texels to either side of a place along an axis; return how far between them it lies. `x`
   is 0 at the first center; `wrap_to_unit` has been applied, so that no division is needed. */
static inline double find_neighbors(
    double x, int64_t size, int64_t wrap, int64_t *left, int64_t *right)
{
    /* With a border, a texel beyond the edge there is nothing else to come. */
    x = min_f64(max_f64(x, -1.0), (double)size);
    const double whole = floor(x);
    *left = (int64_t)whole;
    *right = *left + 1;
    if (*left < 0 || *right >= size) {
        int64_t before = OUTSIDE, after = OUTSIDE;
        if (wrap == WRAP_REPEAT) {
            before = size - 1;
            after = 0;
        } else if (wrap != WRAP_BORDER) {
            before = 0;
            after = size - 1;
        }
        if (*left < 0)
            *left = before;
        else if (*left >= size)
            *left = after;
        if (*right >= size)
            *right = after;
    }
    return x - whole;
}

/* The four texels around a `wrap_to_unit` coordinate, OUTSIDE for the border. `first` is the index
   of the image's first texel. */
static inline struct texel_cell bilinear_cell(
    double u, double v, int64_t width, int64_t height, int64_t wraps, int64_t first)
{
    int64_t left, right, top, bottom;
    const double x = find_neighbors(
        u * (double)width - 0.5, width, wrap_along_u(wraps), &left, &right);
    const double row = row_of_v(v, (double)height) - 0.5;
    const double y = find_neighbors(row, height, wrap_along_v(wraps), &top, &bottom);
    const int64_t above = first + top * width, below = first + bottom * width;
    struct texel_cell cell = {above + left, above + right, below + left, below + right, x, y};
    if (has_border(wraps)) {
        if (left < 0 || top < 0)
            cell.above_left = OUTSIDE;
        if (right < 0 || top < 0)
            cell.above_right = OUTSIDE;
        if (left < 0 || bottom < 0)
            cell.below_left = OUTSIDE;
        if (right < 0 || bottom < 0)
            cell.below_right = OUTSIDE;
    }
    return cell;
}

/* One channel of the four texels of a cell. `outside` is the value of the border. */
struct corner_values {
    float above_left, above_right, below_left, below_right;
};

static inline struct corner_values corner_values_of(
    int64_t n_channels, const float texels[][n_channels], const struct texel_cell *cell,
    int64_t channel, float outside)
{
    const struct corner_values values = {
        cell->above_left >= 0 ? texels[cell->above_left][channel] : outside,
        cell->above_right >= 0 ? texels[cell->above_right][channel] : outside,
        cell->below_left >= 0 ? texels[cell->below_left][channel] : outside,
        cell->below_right >= 0 ? texels[cell->below_right][channel] : outside,
    };
    return values;
}

/* Interpolate one channel between the four texels of a cell; exact where they are equal. */
static inline double interpolate_cell(
    int64_t n_channels, const float texels[][n_channels], const struct texel_cell *cell,
    int64_t channel, float outside)
{
    const struct corner_values at =
        corner_values_of(n_channels, texels, cell, channel, outside);
    const double above = at.above_left + cell->x * (at.above_right - at.above_left);
    const double below = at.below_left + cell->x * (at.below_right - at.below_left);
    return above + cell->y * (below - above);
}

/* The same with weights in single precision, for speed. */
static inline float interpolate_cell_f32(
    int64_t n_channels, const float texels[][n_channels], const struct texel_cell *cell,
    int64_t channel, float outside)
{
    const struct corner_values at =
        corner_values_of(n_channels, texels, cell, channel, outside);
    const float x = (float)cell->x, y = (float)cell->y;
    const float above = at.above_left + x * (at.above_right - at.above_left);
    const float below = at.below_left + x * (at.below_right - at.below_left);
    return above + y * (below - above);
}
