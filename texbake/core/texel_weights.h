/* Barycentric weights on the fixed-point grid of a texture: for what lists samples of texels. */

#ifndef TEXBAKE_TEXEL_WEIGHTS_H
#define TEXBAKE_TEXEL_WEIGHTS_H

#include <stdint.h>

/* Width of a sample in units of the grid, as in texbake/baking/texels.py. */
enum { UNIT = 1 << 11 };

/* Write the weights of the second and third corner of a face at a point, in units of the grid. */
static inline void weigh_texel(
    const int64_t (*corners)[2], int64_t x, int64_t y, double *weights)
{
    const int64_t ax = corners[0][0], ay = corners[0][1];
    const int64_t bx = corners[1][0] - ax, by = corners[1][1] - ay;
    const int64_t cx = corners[2][0] - ax, cy = corners[2][1] - ay;
    const int64_t px = x - ax, py = y - ay;
    const double area = (double)(bx * cy - by * cx);
    weights[0] = (double)(px * cy - py * cx) / area;
    weights[1] = (double)(bx * py - by * px) / area;
}

#endif
