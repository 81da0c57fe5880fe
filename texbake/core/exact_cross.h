/* On which side of an edge a ray passes, with the exact sign.

   Based on: Dekker, "A Floating-Point Technique for Extending the Available Precision", 1971, for the
   error of a product. */

#ifndef TEXBAKE_EXACT_CROSS_H
#define TEXBAKE_EXACT_CROSS_H

#include <math.h>

/* a b - product, exactly. */
static double product_error(double a, double b, double product)
{
    const double split_a = 134217729.0 * a, split_b = 134217729.0 * b;
    const double a_high = split_a - (split_a - a), b_high = split_b - (split_b - b);
    const double a_low = a - a_high, b_low = b - b_high;
    return ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low;
}

/* px qy - py qx with the exact sign. */
static inline double exact_cross(double px, double py, double qx, double qy)
{
    const double one = px * qy, two = py * qx, difference = one - two;
    /* Each product is rounded by 2^-53 of itself: beyond 4 times that the sign is certain. */
    if (fabs(difference) > 4.5e-16 * (fabs(one) + fabs(two)))
        return difference;
    return difference + (product_error(px, qy, one) - product_error(py, qx, two));
}

#endif
