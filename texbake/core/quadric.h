/* Quadrics: sums of weighted squared distances from planes and points, as functions of a place.

   Based on: Garland, Heckbert, "Surface simplification using quadric error metrics", 1997. */

#ifndef TEXBAKE_QUADRIC_H
#define TEXBAKE_QUADRIC_H

#include <stdbool.h>

#include "vectors.h"

/* p A p + 2 b p + c, with a symmetric matrix A. */
struct quadric {
    double xx, xy, xz, yy, yz, zz, bx, by, bz, c;
};

/* Add weight times the squared distance from the plane through a point, with a unit normal. */
static inline void add_plane(struct quadric *q, struct vector n, struct vector point, double weight)
{
    const double d = -dot(n, point);
    const struct vector scaled = {weight * n.x, weight * n.y, weight * n.z};
    q->xx += scaled.x * n.x;
    q->xy += scaled.x * n.y;
    q->xz += scaled.x * n.z;
    q->yy += scaled.y * n.y;
    q->yz += scaled.y * n.z;
    q->zz += scaled.z * n.z;
    q->bx += scaled.x * d;
    q->by += scaled.y * d;
    q->bz += scaled.z * d;
    q->c += weight * d * d;
}

/* Add weight times the squared distance from a point. */
static inline void add_point(struct quadric *q, struct vector point, double weight)
{
    q->xx += weight;
    q->yy += weight;
    q->zz += weight;
    q->bx -= weight * point.x;
    q->by -= weight * point.y;
    q->bz -= weight * point.z;
    q->c += weight * dot(point, point);
}

static inline struct quadric add_quadrics(const struct quadric *a, const struct quadric *b)
{
    return (struct quadric){
        a->xx + b->xx, a->xy + b->xy, a->xz + b->xz, a->yy + b->yy, a->yz + b->yz,
        a->zz + b->zz, a->bx + b->bx, a->by + b->by, a->bz + b->bz, a->c + b->c};
}

static inline struct quadric scaled_quadric(const struct quadric *q, double factor)
{
    return (struct quadric){
        factor * q->xx, factor * q->xy, factor * q->xz, factor * q->yy, factor * q->yz,
        factor * q->zz, factor * q->bx, factor * q->by, factor * q->bz, factor * q->c};
}

/* Half the gradient: A p + b. */
static inline struct vector half_gradient(const struct quadric *q, struct vector p)
{
    return (struct vector){
        q->xx * p.x + q->xy * p.y + q->xz * p.z + q->bx,
        q->xy * p.x + q->yy * p.y + q->yz * p.z + q->by,
        q->xz * p.x + q->yz * p.y + q->zz * p.z + q->bz};
}

static inline double quadric_at(const struct quadric *q, struct vector p)
{
    const struct vector b = {q->bx, q->by, q->bz};
    const double value = dot(half_gradient(q, p), p) + dot(b, p) + q->c;
    return value > 0.0 ? value : 0.0;
}

/* The step from a point to the least value; false where there is none to rounding. By Cholesky's
   factors, without square roots. */
static inline bool step_to_least(const struct quadric *q, struct vector from, struct vector *step)
{
    const struct vector g = half_gradient(q, from);
    const double least = 1e-14 * (q->xx + q->yy + q->zz);
    if (!(q->xx > least))
        return false;
    const double l1 = q->xy / q->xx, l2 = q->xz / q->xx;
    const double d1 = q->yy - l1 * q->xy, e = q->yz - l2 * q->xy;
    if (!(d1 > least))
        return false;
    const double l3 = e / d1, d2 = q->zz - l2 * q->xz - l3 * e;
    if (!(d2 > least))
        return false;
    const double y = g.y - l1 * g.x, z = (g.z - l2 * g.x - l3 * y) / d2;
    const double y2 = y / d1 - l3 * z;
    *step = (struct vector){-(g.x / q->xx - l1 * y2 - l2 * z), -y2, -z};
    return true;
}

#endif
