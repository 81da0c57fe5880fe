/* Clipping triangles, and snapping their corners to the grid of the screen: for the rasterizers. */

#pragma once

#include <math.h>
#include <stdint.h>

/* Units of the grid in a sample, as in texbake/rendering/rasterize.py. */
enum { SUBPIXEL_BITS = 8, SUBPIXELS = 1 << SUBPIXEL_BITS, HALF_SAMPLE = SUBPIXELS / 2 };

/* Column that marks a vertex outside the grid, as in texbake/rendering/rasterize.py. */
#define OFF_GRID INT32_MIN

/* A triangle cut by five planes has 8 corners at most. Where corners lie on a plane up to rounding,
   each plane may turn n corners into 3 n / 2. */
enum { MAX_CORNERS = 20 };

struct clipped_triangle {
    int64_t n_corners;
    int64_t points[MAX_CORNERS][2]; /* columns and rows of the corners, in units of the grid */
    float depths[MAX_CORNERS];      /* z / w */
};

/* The homogeneous clip coordinates x, y, z, w of a position. */
static inline void to_clip(const double (*matrix)[4], const double *position, double *clip)
{
    for (int i = 0; i < 4; i++)
        clip[i] = matrix[i][0] * position[0] + matrix[i][1] * position[1]
                + matrix[i][2] * position[2] + matrix[i][3];
}

void clip_triangle(
    const double (*positions)[3], const int32_t *corners, const double (*matrix)[4], int64_t width,
    int64_t height, struct clipped_triangle *clipped);
