/* Normals of unit length that face the visible side of a surface. */

#ifndef TEXBAKE_UNIT_NORMALS_H
#define TEXBAKE_UNIT_NORMALS_H

#include <math.h>

/* Write a vector normalized and turned by `side`, which is 1 or -1; a vector that has no direction
   becomes `view`. */
static inline void write_normal(
    double x, double y, double z, double side, const double view[3], float out[3])
{
    const double squared = x * x + y * y + z * z;
    if (0.0 < squared && squared < INFINITY) {
        const double scale = side / sqrt(squared);
        out[0] = (float)(x * scale);
        out[1] = (float)(y * scale);
        out[2] = (float)(z * scale);
    } else {
        out[0] = (float)view[0];
        out[1] = (float)view[1];
        out[2] = (float)view[2];
    }
}

#endif
