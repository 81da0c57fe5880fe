/* Vectors of three float64 numbers. */

#pragma once

struct vector {
    double x, y, z;
};

static inline struct vector vector_at(const double values[3])
{
    return (struct vector){values[0], values[1], values[2]};
}

static inline struct vector minus(struct vector a, struct vector b)
{
    return (struct vector){a.x - b.x, a.y - b.y, a.z - b.z};
}

static inline double dot(struct vector a, struct vector b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline struct vector cross(struct vector a, struct vector b)
{
    return (struct vector){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/* v a + w b. */
static inline struct vector weighted(struct vector a, struct vector b, double v, double w)
{
    return (struct vector){v * a.x + w * b.x, v * a.y + w * b.y, v * a.z + w * b.z};
}
