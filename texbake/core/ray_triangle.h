/* Where the line of a ray meets a triangle, with the exact side on which it passes each edge.

   Space is sheared so that the ray is an axis; the signs of the three edges then decide whether it
   meets the triangle. Triangles that share an edge agree on its sign, so that no ray passes between
   them.

   Based on: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", Journal of Computer Graphics
   Techniques 2(1), 2013 (here in float64, with exact products where rounding could change a sign). */

#pragma once

#include "elementary.h"
#include "morton_tree.h"

/* The line of a ray in coordinates x, y, z, where z is the axis along which it goes farthest. */
struct ray_line {
    double x, y, z, slope_x, slope_y, along;
};

/* A hit of a ray's line: its weights times `total`, which is positive where the ray meets the front;
   total is 0 for a miss. */
struct crossing {
    double distance, second, third, total;
};

/* px qy - py qx with the exact sign. */
static inline double exact_cross(double px, double py, double qx, double qy)
{
    const double one = px * qy, two = py * qx, difference = one - two;
    /* Each product has a relative error of 2^-53: beyond 4 times that, the sign is certain. */
    if (fabs(difference) > 4.5e-16 * (fabs(one) + fabs(two)))
        return difference;
    return difference + (exact_product(px, qy).low - exact_product(py, qx).low);
}

/* Where a line meets triangle `k` of a leaf; `order` holds the axes of space that x, y, z are. */
static inline struct crossing intersect(
    const struct ray_line *line, const int order[3], const leaf corners, int64_t k)
{
    double px[3], py[3], pz[3];
    for (int c = 0; c < 3; c++) {
        pz[c] = corners[3 * c + order[2]][k] - line->z;
        px[c] = corners[3 * c + order[0]][k] - line->x - line->slope_x * pz[c];
        py[c] = corners[3 * c + order[1]][k] - line->y - line->slope_y * pz[c];
    }
    const double u = exact_cross(px[2], py[2], px[1], py[1]);
    const double v = exact_cross(px[0], py[0], px[2], py[2]);
    const double w = exact_cross(px[1], py[1], px[0], py[0]);
    if ((u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0))
        return (struct crossing){0};
    const double total = u + v + w;
    const double distance = (u * pz[0] + v * pz[1] + w * pz[2]) / (total * line->along);
    return (struct crossing){distance, v, w, total};
}
