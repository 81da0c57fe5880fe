/* Charts grown over faces whose normals lie in one cone.

   A chart grows twice from the first face that has none yet: first about the normal of that face,
   to find the mean normal of the neighborhood; then about that mean.

   Called from texbake/mapping/atlas/cutting/xatlas_charts.py. */

#include <float.h>
#include <math.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"

static const double CONE = 0.5000000000000001; /* cos(60°) */

struct growth {
    const int32_t (*neighbors)[3];
    const double (*normals)[3];
    int32_t *charts;
    int32_t *stack;
    int64_t *seen; /* the last round that met each face */
};

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Grow from a face about an axis; add the normals of all faces met to `mean` if `chart` is -1, else
   put the faces into that chart. */
static void grow(
    const struct growth *growth, int32_t first, const double axis[3], int64_t round, int32_t chart,
    double mean[3])
{
    int64_t height = 1;
    growth->stack[0] = first;
    growth->seen[first] = round;
    while (height > 0) {
        const int32_t face = growth->stack[--height];
        if (chart >= 0)
            growth->charts[face] = chart;
        for (int i = 0; chart < 0 && i < 3; i++)
            mean[i] += growth->normals[face][i];
        for (int side = 0; side < 3; side++) {
            const int32_t other = growth->neighbors[face][side];
            if (other < 0 || growth->charts[other] >= 0 || growth->seen[other] == round)
                continue;
            const double *normal = growth->normals[other];
            const double length = sqrt(dot(normal, normal));
            if (length > 0.0 && dot(normal, axis) >= CONE * length) {
                growth->seen[other] = round;
                growth->stack[height++] = other;
            }
        }
    }
}

static void make_unit(double axis[3])
{
    const double length = max_f64(sqrt(dot(axis, axis)), DBL_MIN);
    for (int i = 0; i < 3; i++)
        axis[i] /= length;
}

/* Grow a chart from each face that has none yet, and write its axis; return the number of charts.
   `charts` comes with -1. */
EXPORT int64_t grow_charts(
    int64_t n_faces, const int32_t neighbors[n_faces][3], const double normals[n_faces][3],
    int32_t charts[n_faces], double axes[n_faces][3])
{
    OPEN_ARENA(arena);
    const struct growth growth = {
        neighbors, normals, charts, TAKE(arena, int32_t, n_faces), TAKE(arena, int64_t, n_faces)};
    for (int64_t face = 0; face < n_faces; face++)
        growth.seen[face] = -1;
    int32_t n_charts = 0;
    for (int32_t first = 0; first < n_faces; first++) {
        if (charts[first] >= 0)
            continue;
        double axis[3] = {normals[first][0], normals[first][1], normals[first][2]};
        double *mean = axes[n_charts];
        make_unit(axis);
        mean[0] = mean[1] = mean[2] = 0.0;
        grow(&growth, first, axis, 2 * (int64_t)n_charts, -1, mean);
        make_unit(mean);
        grow(&growth, first, mean, 2 * (int64_t)n_charts + 1, n_charts, NULL);
        n_charts++;
    }
    close_arena(arena);
    return n_charts;
}
