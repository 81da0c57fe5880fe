/* Values with one row per fragment, or a single row for all of them. */

#pragma once

#include <math.h>
#include <stdint.h>

/* Row of fragment i in values with one row per fragment, or one for all. */
static inline int64_t row_of(int64_t n_rows, int64_t i) { return n_rows > 1 ? i : 0; }

/* Scalar product in single precision. */
static inline float dot_f32(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Scalar product whose terms are in single precision, and their sum in double. */
static inline double sum_products(const float a[3], const float b[3])
{
    double sum = 0.0;
    for (int k = 0; k < 3; k++)
        sum += a[k] * b[k];
    return sum;
}

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
