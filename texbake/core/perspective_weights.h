/* Barycentric weights on the screen, for the shading of fragments and the scanline rasterizer. */

#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "clipping.h"

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
