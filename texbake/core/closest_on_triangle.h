/* The closest point of a triangle.

   Based on: Christer Ericson, "Real-Time Collision Detection", 2005, section 5.1.5. Departs from it,
   whose products of products lose all their digits on slivers: weights come from the height over the
   first edge, and a triangle with next to no area is treated as its three edges. */

#pragma once

#include <math.h>
#include <stdbool.h>

#include "numbers.h"
#include "vectors.h"

/* The square of the sine of the angle at its first corner under which a triangle is taken as its
   three edges: its height is then a hundred roundings of its length, or less. */
#define SLIVER_SINE_SQUARED 1e-28

/* A place on a triangle by the weights of its second and third corner, and how far a point is. */
struct nearness {
    double v, w, squared;
};

/* Where on an edge, from 0 to 1; 0 on an edge without length. */
static inline double along_edge(double numerator, double denominator)
{
    return denominator > 0.0 ? min_f64(max_f64(numerator / denominator, 0.0), 1.0) : 0.0;
}

static inline struct nearness nearness_at(
    struct vector ab, struct vector ac, struct vector ap, double v, double w)
{
    const struct vector offset = minus(ap, weighted(ab, ac, v, w));
    return (struct nearness){v, w, dot(offset, offset)};
}

/* The closest point, given the edges from a to b and to c, and the vector from a to p. The weights
   are in [0, 1] and so is their sum, to rounding; that of a is what they leave of 1. */
static inline struct nearness closest_on_triangle(
    struct vector ab, struct vector ac, struct vector ap)
{
    const double ab_ab = dot(ab, ab), ab_ac = dot(ab, ac), ac_ac = dot(ac, ac);
    const double ab_ap = dot(ab, ap), ac_ap = dot(ac, ap);
    double v = 0.0, w = 0.0;
    bool sliver = true;
    if (ab_ab > 0.0) {
        struct vector height = minus(ac, weighted(ab, ab, ab_ac / ab_ab, 0.0));
        /* Twice, because on a needle the first leaves rounding that is not small beside it. */
        height = minus(height, weighted(ab, ab, dot(ab, height) / ab_ab, 0.0));
        const double height_squared = dot(height, height);
        if (height_squared > SLIVER_SINE_SQUARED * ac_ac) {
            sliver = false;
            w = dot(height, ap) / height_squared;
            v = (ab_ap - w * ab_ac) / ab_ab;
            if (v > 0.0 && w > 0.0 && v + w < 1.0)
                return nearness_at(ab, ac, ap, v, w);
        }
    }
    /* The closest point lies on an edge that p is beyond. */
    struct nearness best = {0.0, 0.0, INFINITY};
    if (sliver || w <= 0.0) {
        const struct nearness near = nearness_at(ab, ac, ap, along_edge(ab_ap, ab_ab), 0.0);
        if (near.squared < best.squared)
            best = near;
    }
    if (sliver || v <= 0.0) {
        const struct nearness near = nearness_at(ab, ac, ap, 0.0, along_edge(ac_ap, ac_ac));
        if (near.squared < best.squared)
            best = near;
    }
    if (sliver || v + w >= 1.0) {
        const struct vector bc = minus(ac, ab);
        const double edge_w = along_edge(dot(bc, minus(ap, ab)), dot(bc, bc));
        const struct nearness near = nearness_at(ab, ac, ap, 1.0 - edge_w, edge_w);
        if (near.squared < best.squared)
            best = near;
    }
    return best;
}

/* Whether the plane of a triangle is farther from a point than the square says, by more than rounding
   can change. That is known without a division. */
static inline bool is_beyond(struct vector ab, struct vector ac, struct vector ap, double squared)
{
    const struct vector normal = cross(ab, ac);
    const double height = dot(normal, ap), ab_ab = dot(ab, ab), ac_ac = dot(ac, ac);
    const double rounding = 1e-24 * ab_ab * ac_ac * (ab_ab + ac_ac + dot(ap, ap));
    return height * height > 1.001 * squared * dot(normal, normal) + rounding;
}
