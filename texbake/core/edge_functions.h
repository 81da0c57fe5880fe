/* Which face owns a point of a map, for other files of the core: see edge_functions.c. */

#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "numbers.h"

enum {
    NO_FACE = -1,
    FRACTION_BITS = 11,
    UNIT = 1 << FRACTION_BITS, /* units of the fixed-point grid in a sub-square */
    FINE = 8,                  /* sub-squares along one side of a texel */
    FULL = FINE * FINE,
    TEXEL = FINE * UNIT, /* units in a texel */
    BIN = 8,             /* texels along one side of the squares that share a list of faces */
};

/* Faces listed for each square of texels that they overlap, as in `FaceBins`. */
struct face_bins {
    const int64_t (*corners)[3][2]; /* x to the right and y down, in units */
    const int64_t *firsts;
    const int32_t *faces;
    int64_t n_columns;
};

/* The corners of a face, in the order that has its inside on the inner side of each edge. */
struct triangle {
    int64_t ax, ay, bx, by, cx, cy;
};

static inline int64_t doubled_area(const int64_t corners[3][2])
{
    return (corners[1][0] - corners[0][0]) * (corners[2][1] - corners[0][1])
         - (corners[1][1] - corners[0][1]) * (corners[2][0] - corners[0][0]);
}

static inline struct triangle oriented(const int64_t corners[3][2])
{
    const int second = doubled_area(corners) < 0 ? 2 : 1, third = 3 - second;
    return (struct triangle){
        corners[0][0], corners[0][1], corners[second][0], corners[second][1],
        corners[third][0], corners[third][1]};
}

/* A positive number for a point on the inner side of an edge, by the top-left rule. */
static inline int64_t edge_side(
    int64_t px, int64_t py, int64_t qx, int64_t qy, int64_t x, int64_t y)
{
    const int64_t dx = qx - px, dy = qy - py;
    const bool is_owned = dy < 0 || (dy == 0 && dx > 0);
    return dx * (y - py) - dy * (x - px) + is_owned;
}

/* Whether a face with an area covers a point, by the top-left rule. */
static inline bool covers(const int64_t corners[3][2], int64_t x, int64_t y)
{
    const struct triangle t = oriented(corners);
    return edge_side(t.ax, t.ay, t.bx, t.by, x, y) > 0
        && edge_side(t.bx, t.by, t.cx, t.cy, x, y) > 0
        && edge_side(t.cx, t.cy, t.ax, t.ay, x, y) > 0;
}

/* The first face that covers a point of the map, NO_FACE for none; x and y in units. */
static inline int32_t owner_at(const struct face_bins *bins, int64_t x, int64_t y)
{
    const int64_t side = BIN * TEXEL;
    const int64_t bin = floor_div(y, side) * bins->n_columns + floor_div(x, side);
    for (int64_t i = bins->firsts[bin]; i < bins->firsts[bin + 1]; i++)
        if (covers(bins->corners[bins->faces[i]], x, y))
            return bins->faces[i];
    return NO_FACE;
}

/* Write the weights of the second and third corner of a face at a point. */
static inline void write_point_weights(
    const int64_t corners[3][2], int64_t x, int64_t y, double weights[2])
{
    const int64_t ax = corners[0][0], ay = corners[0][1];
    const int64_t bx = corners[1][0] - ax, by = corners[1][1] - ay;
    const int64_t cx = corners[2][0] - ax, cy = corners[2][1] - ay;
    const int64_t px = x - ax, py = y - ay;
    const double area = (double)(bx * cy - by * cx);
    weights[0] = (double)(px * cy - py * cx) / area;
    weights[1] = (double)(bx * py - by * px) / area;
}
