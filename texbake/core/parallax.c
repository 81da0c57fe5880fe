/* Parallax occlusion mapping: following rays below a surface until they meet a map of heights.

   A ray is followed in even steps. The intersection between the last step above the heights and the
   first step below is refined by the method of false position (Illinois variant), which is exact
   where the map is linear.

   Based on: Policarpo, Oliveira, Comba, "Real-time relief mapping on arbitrary polygonal surfaces",
   I3D 2005; Tatarchuk, "Dynamic parallax occlusion mapping with approximate soft shadows", I3D 2006.
   Unlike these papers, steps are counted in texels.

   Called from texbake/rendering/effects/parallax.py. */

#include <math.h>

#include "core.h"
#include "elementary.h"
#include "numbers.h"
#include "texture_lookup.h"

/* Maximum number of rounds of false position, and its tolerance as a share of the depth: 1/16 of a
   16-bit step. */
enum { REFINEMENTS = 8 };
static const double CLOSE = 1.0 / (1 << 20);

/* One level of a map of heights, in the first of its channels. */
struct height_map {
    int64_t n_channels;
    const float *texels;
    int64_t first, width, height, wraps;
    float border, factor;
};

/* Height of the ray above the map at a share of its way down from 1 to 0. */
static double height_above(
    const struct height_map *map, const double start[2], const double step[2], double share)
{
    const double u = wrap_to_unit(start[0] + share * step[0], wrap_along_u(map->wraps));
    const double v = wrap_to_unit(start[1] + share * step[1], wrap_along_v(map->wraps));
    const struct texel_cell cell =
        bilinear_cell(u, v, map->width, map->height, map->wraps, map->first);
    const float (*texels)[map->n_channels] = (const void *)map->texels;
    return 1.0 - share
           - map->factor * interpolate_cell(map->n_channels, texels, &cell, 0, map->border);
}

/* Find the intersection with the map between a position above it and one below. */
static double find_meeting(
    const struct height_map *map, const double start[2], const double step[2], double near,
    double above, double far, double below)
{
    double share = far;
    int side = 0;
    for (int round = 0; round < REFINEMENTS; round++) {
        share = near + (far - near) * above / (above - below);
        const double there = height_above(map, start, step, share);
        if (fabs(there) <= CLOSE)
            break;
        /* Illinois variant: halve the value of an end that is kept twice in a row. */
        if (there > 0.0) {
            near = share;
            above = there;
            below *= side > 0 ? 0.5 : 1.0;
            side = 1;
        } else {
            far = share;
            below = there;
            above *= side < 0 ? 0.5 : 1.0;
            side = -1;
        }
    }
    return share;
}

/* Write the share of its way at which each ray meets the map. A ray takes one step per texel that it
   crosses, but at most `layers`, and is followed for at most one unit of texture coordinates. */
EXPORT void follow_rays(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n,
    const float texels[n_texels][n_channels], const int64_t offsets[n_levels],
    const int64_t sizes[n_levels][2], int64_t wraps, float border, float factor,
    const double starts[n][2], const double steps[n][2], const int64_t levels[n], int64_t layers,
    double shares[n])
{
    for (int64_t i = 0; i < n; i++) {
        const int64_t *size = sizes[levels[i]];
        const struct height_map map = {
            n_channels, texels[0], offsets[levels[i]], size[1], size[0], wraps, border, factor};
        const double *step = steps[i];
        const double last = 1.0 / max_f64(portable_hypot(step[0], step[1]), 1.0);
        const double crossed = portable_hypot(last * step[0] * size[1], last * step[1] * size[0]);
        const int64_t n_steps =
            crossed > 1.0 && layers > 1 ? (int64_t)min_f64(ceil(crossed), (double)layers) : 1;
        double near = 0.0, far = 0.0;
        double below = height_above(&map, starts[i], step, 0.0), above = below;
        int64_t k = 0;
        while (below > 0.0 && k < n_steps) {
            k++;
            near = far;
            above = below;
            far = last * k / n_steps;
            below = height_above(&map, starts[i], step, far);
        }
        if (k > 0 && below < 0.0)
            far = find_meeting(&map, starts[i], step, near, above, far, below);
        shares[i] = far;
    }
}
