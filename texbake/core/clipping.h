/* Clipping triangles, and snapping their corners to the grid of the screen: for the rasterizers. */

#pragma once

#include <math.h>
#include <stdbool.h>
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

/* Write the barycentric weight of each corner as a linear function of column and row: coefficients
   of x, y and 1, up to a common factor. They are determinants of two corners in clip space and the
   position. Nothing is divided by w, so w may have any sign. `sx` and `sy` are the width and height
   of a pixel in clip space. */
static inline void corner_edges(
    const double (*positions)[3], const int32_t *corners, const double (*matrix)[4], bool affine,
    double sx, double sy, double (*edges)[3])
{
    double clip[3][4];
    for (int k = 0; k < 3; k++)
        to_clip(matrix, positions[corners[k]], clip[k]);
    if (affine && clip[0][3] > 0.0 && clip[1][3] > 0.0 && clip[2][3] > 0.0) {
        for (int k = 0; k < 3; k++) {
            clip[k][0] /= clip[k][3];
            clip[k][1] /= clip[k][3];
            clip[k][3] = 1.0;
        }
    }
    /* Clip space from columns and rows: x of pixel 0 is -1, y of row 0 is 1. */
    for (int k = 0; k < 3; k++) {
        const double *b = clip[(k + 1) % 3], *c = clip[(k + 2) % 3];
        const double along_x = b[1] * c[3] - b[3] * c[1];
        const double along_y = b[3] * c[0] - b[0] * c[3];
        edges[k][0] = along_x * sx;
        edges[k][1] = -along_y * sy;
        edges[k][2] = b[0] * c[1] - b[1] * c[0] - along_x + along_y;
    }
}

void clip_triangle(
    const double (*positions)[3], const int32_t *corners, const double (*matrix)[4], int64_t width,
    int64_t height, struct clipped_triangle *clipped);
