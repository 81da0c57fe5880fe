/* Pulling a cage in, vertex by vertex, until a point would come through one of its faces; and finding
   the face under a point, along the interpolated normals of a mesh.

   Each sweep moves every vertex to the least distance at which its faces still enclose all points,
   but only half of the way if that is farther in, so that no vertex leaves its neighbors far outside.
   A face encloses a point behind its plane, which is linear in the distance of each corner: each
   bound has a closed form.

   Newton's method solves position(b, c) + height * normal(b, c) = point for the barycentrics (b, c)
   and the height above a face. A solution outside the face continues on the neighbor across the edge.

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

enum { MOST_FACES = 8, MOST_STEPS = 12 };

static const double TOO_FAR = 1e3;      /* a step of this size does not come back */
static const double CONVERGED = 1e-12;  /* size of the last step */
static const double TOLERANCE = 1e-9;   /* barycentrics on an edge, up to rounding */

/* Positions and normals of a face's corners. */
struct corners {
    const double *positions[3], *normals[3];
};

/* A point above a face, by its barycentrics and height. */
struct place {
    double b, c, height;
};

static struct corners corners_of(
    const int32_t *face, const double (*positions)[3], const double (*normals)[3])
{
    struct corners found;
    for (int k = 0; k < 3; k++) {
        found.positions[k] = positions[face[k]];
        found.normals[k] = normals[face[k]];
    }
    return found;
}

static inline double mix(const double *const *corners, int axis, double b, double c)
{
    return (1.0 - b - c) * corners[0][axis] + b * corners[1][axis] + c * corners[2][axis];
}

/* Height of a point above (b, c) on a face, along the normal there. */
static double height_above(const double *target, const struct corners *at, double b, double c)
{
    double height = 0.0, square = 0.0;
    for (int axis = 0; axis < 3; axis++) {
        const double point = mix(at->positions, axis, b, c);
        const double normal = mix(at->normals, axis, b, c);
        height += normal * (target[axis] - point);
        square += normal * normal;
    }
    return square > 0.0 ? height / square : 0.0;
}

/* Determinant of three vectors. */
static double triple_product(const double *a, const double *b, const double *c)
{
    return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2])
         + a[2] * (b[0] * c[1] - b[1] * c[0]);
}

/* One step by Cramer's rule; returns its size, infinite if the system is singular. */
static double newton_step(
    const double *target, const struct corners *at, const struct place *place, struct place *step)
{
    double along[3][3], rest[3];
    for (int axis = 0; axis < 3; axis++) {
        const double normal = mix(at->normals, axis, place->b, place->c);
        const double point = mix(at->positions, axis, place->b, place->c);
        for (int k = 0; k < 2; k++) {
            along[k][axis] = at->positions[k + 1][axis] - at->positions[0][axis];
            along[k][axis] += place->height * (at->normals[k + 1][axis] - at->normals[0][axis]);
        }
        along[2][axis] = normal;
        rest[axis] = target[axis] - point - place->height * normal;
    }
    const double volume = triple_product(along[0], along[1], along[2]);
    if (volume == 0.0)
        return INFINITY;
    step->b = triple_product(rest, along[1], along[2]) / volume;
    step->c = triple_product(along[0], rest, along[2]) / volume;
    step->height = triple_product(along[0], along[1], rest) / volume;
    return max_f64(max_f64(fabs(step->b), fabs(step->c)), fabs(step->height));
}

/* Solve for the place above one face; false if the steps do not converge. */
static bool solve_on_face(const double *target, const struct corners *at, struct place *place)
{
    place->height = height_above(target, at, place->b, place->c);
    for (int i = 0; i < MOST_STEPS; i++) {
        struct place step;
        const double size = newton_step(target, at, place, &step);
        if (!(size < TOO_FAR))
            return false;
        place->b += step.b;
        place->c += step.c;
        place->height += step.height;
        if (size < CONVERGED)
            return true;
    }
    return false;
}

/* Write the face under each point, and its height along the interpolated normal. Where none is found
   the face is the closest one, -1 beside a border, and the height the distance to it if outside. */
EXPORT void find_faces_under(
    int64_t n, int64_t n_vertices, int64_t n_faces, int64_t n_half_edges,
    const double targets[n][3], const double distances[n], const int32_t closest[n],
    const double weights[n][3], const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], const double normals[n_vertices][3],
    const int32_t opposite[n_half_edges], int32_t owners[n], double heights[n], bool exact[n])
{
    for (int64_t i = 0; i < n; i++) {
        int64_t face = closest[i];
        struct place place = {weights[i][1], weights[i][2], 0.0};
        bool beside = false, solved = false;
        for (int tried = 0; tried < MOST_FACES; tried++) {
            const struct corners at = corners_of(faces[face], positions, normals);
            solved = solve_on_face(targets[i], &at, &place);
            const double a = 1.0 - place.b - place.c;
            if (!solved || (place.b >= -TOLERANCE && place.c >= -TOLERANCE
                            && place.b + place.c <= 1.0 + TOLERANCE))
                break;
            const double least = min_f64(min_f64(place.b, place.c), a);
            const int corner = least == place.b ? 2 : least == place.c ? 0 : 1;
            const int32_t across = opposite[3 * face + corner];
            solved = false;
            if (across < 0) {
                beside = true;
                break;
            }
            face = across / 3;
            place.b = place.c = 1.0 / 3.0;
        }
        exact[i] = solved;
        if (solved) {
            owners[i] = (int32_t)face;
            heights[i] = place.height;
            continue;
        }
        const struct corners at = corners_of(faces[closest[i]], positions, normals);
        const double outside = height_above(targets[i], &at, weights[i][1], weights[i][2]);
        owners[i] = beside ? -1 : closest[i];
        heights[i] = outside > 0.0 ? distances[i] : 0.0;
    }
}
