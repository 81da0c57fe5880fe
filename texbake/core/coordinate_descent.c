/* Pulling a cage in, vertex by vertex, until a point would come through one of its faces.

   Each sweep moves every vertex to the least distance at which its faces still enclose all points,
   but only half of the way if that is farther in, so that no vertex leaves its neighbors far outside.
   A face encloses a point behind its plane, which is linear in the distance of each corner: each
   bound has a closed form.

   Called from texbake/baking/cage.py. */

#include <math.h>

#include "core.h"
#include "numbers.h"

/* Share of a point's weight below which a corner leaves the point to the two others: it depends on
   their side of the face, and the bound on this corner would be rounding. */
static const double LEAST_WEIGHT = 1e-4;

/* A sweep that moves no vertex by more than this is the last. */
static const double LEAST_CHANGE = 1e-9;

struct cage {
    int64_t n_faces;
    const double (*positions)[3];
    const int32_t (*faces)[3];
    const double (*normals)[3];
    const double (*points)[3];     /* sorted by face */
    const int64_t *first_points;   /* of each face */
    const double *distances;
};

/* The positions of a face's corners in the cage. */
static void place_corners(const struct cage *cage, int64_t face, double (*corners)[3])
{
    for (int corner = 0; corner < 3; corner++) {
        const int32_t vertex = cage->faces[face][corner];
        for (int axis = 0; axis < 3; axis++) {
            const double moved = cage->distances[vertex] * cage->normals[vertex][axis];
            corners[corner][axis] = cage->positions[vertex][axis] + moved;
        }
    }
}

/* Normal of a triangle, twice its area long. */
static inline void area_vector(const double *a, const double *b, const double *c, double *vector)
{
    const double x0 = b[0] - a[0], y0 = b[1] - a[1], z0 = b[2] - a[2];
    const double x1 = c[0] - a[0], y1 = c[1] - a[1], z1 = c[2] - a[2];
    vector[0] = y0 * z1 - z0 * y1;
    vector[1] = z0 * x1 - x0 * z1;
    vector[2] = x0 * y1 - y0 * x1;
}

static inline double norm(const double *v)
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* Least distance of a vertex, a corner of a face, at which all points over the face lie behind it. */
static double least_distance(
    const struct cage *cage, int64_t face, int64_t corner, const double (*corners)[3],
    int64_t vertex)
{
    const double *here = corners[corner];
    const double *after = corners[(corner + 1) % 3], *last = corners[(corner + 2) % 3];
    const double *normal = cage->normals[vertex];
    double v[3];
    area_vector(here, after, last, v);
    const double least_slope = LEAST_WEIGHT * norm(v);
    double least = -INFINITY;
    for (int64_t i = cage->first_points[face]; i < cage->first_points[face + 1]; i++) {
        /* The corner must lie in front of the plane through the point and the two others. */
        const double *point = cage->points[i];
        area_vector(point, after, last, v);
        const double slope = v[0] * normal[0] + v[1] * normal[1] + v[2] * normal[2];
        const double volume = v[0] * (here[0] - point[0]) + v[1] * (here[1] - point[1])
                            + v[2] * (here[2] - point[2]);
        if (slope > least_slope)
            least = max_f64(least, cage->distances[vertex] - volume / slope);
    }
    return least;
}

/* How far the farthest point lies in front of its face. */
static double farthest_outside(const struct cage *cage)
{
    double farthest = 0.0;
    for (int64_t face = 0; face < cage->n_faces; face++) {
        if (cage->first_points[face] == cage->first_points[face + 1])
            continue;
        double corners[3][3], v[3];
        place_corners(cage, face, corners);
        area_vector(corners[0], corners[1], corners[2], v);
        const double length = norm(v);
        if (length == 0.0)
            continue;
        for (int64_t i = cage->first_points[face]; i < cage->first_points[face + 1]; i++) {
            const double *point = cage->points[i];
            const double height =
                (v[0] * (point[0] - corners[0][0]) + v[1] * (point[1] - corners[0][1])
                 + v[2] * (point[2] - corners[0][2]))
                / length;
            farthest = max_f64(farthest, height);
        }
    }
    return farthest;
}

/* Fit the distances of all vertices; return how far the farthest point lies outside. `order` lists
   the corners, 3 * face + corner, around each vertex from `first_corners` on. */
EXPORT double fit_cage(
    int64_t n_vertices, int64_t n_faces, int64_t n_points, int64_t n_corners,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const double normals[n_vertices][3], const double points[n_points][3],
    const int64_t first_points[n_faces + 1], const int64_t order[n_corners],
    const int64_t first_corners[n_vertices + 1], const double floors[n_vertices],
    const double ceilings[n_vertices], int64_t n_sweeps, double distances[n_vertices])
{
    const struct cage cage = {n_faces, positions, faces, normals, points, first_points, distances};
    for (int64_t sweep = 0; sweep < n_sweeps; sweep++) {
        double greatest = 0.0;
        for (int64_t vertex = 0; vertex < n_vertices; vertex++) {
            double bound = floors[vertex];
            for (int64_t at = first_corners[vertex]; at < first_corners[vertex + 1]; at++) {
                const int64_t face = order[at] / 3, corner = order[at] % 3;
                double corners[3][3];
                place_corners(&cage, face, corners);
                bound = max_f64(bound, least_distance(&cage, face, corner, corners, vertex));
            }
            bound = min_f64(bound, ceilings[vertex]);
            double change = bound - distances[vertex];
            if (change < 0.0 && sweep < n_sweeps - 1)
                change *= 0.5;
            distances[vertex] += change;
            greatest = max_f64(greatest, fabs(change));
        }
        if (greatest < LEAST_CHANGE)
            break;
    }
    return farthest_outside(&cage);
}
