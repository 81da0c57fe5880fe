/* Normals of faces, and of vertices, weighted by the angle that each face has there; and the mean
   curvature of faces, from the differences between the normals of their vertices.

   Based on: Thürmer, Wüthrich, "Computing Vertex Normals from Polygonal Facets", Journal of Graphics
   Tools 3(1), 1998; Rusinkiewicz, "Estimating Curvatures and Their Derivatives on Triangle Meshes",
   2004; here only the trace is computed, which has a closed form.

   Called from texbake/mesh/normals.py. */

#include <math.h>

#include "core.h"
#include "elementary.h"
#include "numbers.h"
#include "vectors.h"

static const double PI = 3.141592653589793;

/* In radians. A sum of weighted normals below it is what rounding leaves of normals that cancel. */
static const double CANCELED = 1e-12;

static inline struct vector scaled_edge(
    const double (*positions)[3], double scale, int32_t tail, int32_t head)
{
    return (struct vector){
        positions[head][0] * scale - positions[tail][0] * scale,
        positions[head][1] * scale - positions[tail][1] * scale,
        positions[head][2] * scale - positions[tail][2] * scale};
}

/* Length of the cross product of two edges; 0 where it is only rounding. `rounding` is what rounding
   leaves of the square of the longest edge. */
static inline double area_length(
    struct vector ab, struct vector ac, struct vector across, double rounding)
{
    const double length = sqrt(dot(across, across));
    const struct vector bc = minus(ac, ab);
    const double longest_squared = max_f64(max_f64(dot(ab, ab), dot(ac, ac)), dot(bc, bc));
    return length <= rounding * longest_squared ? 0.0 : length;
}

/* Write the unit normals of faces start to stop - 1. */
EXPORT void face_normals(
    int64_t n_vertices, int64_t n_faces, const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], double scale, double rounding, int64_t start, int64_t stop,
    double normals[n_faces][3])
{
    for (int64_t face = start; face < stop; face++) {
        const struct vector ab = scaled_edge(positions, scale, faces[face][0], faces[face][1]);
        const struct vector ac = scaled_edge(positions, scale, faces[face][0], faces[face][2]);
        const struct vector across = cross(ab, ac);
        const double length = area_length(ab, ac, across, rounding);
        normals[face][0] = length > 0.0 ? across.x / length : 0.0;
        normals[face][1] = length > 0.0 ? across.y / length : 0.0;
        normals[face][2] = length > 0.0 ? across.z / length : 0.0;
    }
}

enum { BLOCK = 64 };

/* Some faces, with loops that vector instructions can do: each array has a number of each face. */
struct faces {
    double corners[3][3][BLOCK]; /* coordinates of each corner */
    double lengths[BLOCK];       /* of the cross product; 0 for a face without area */
    double units[3][BLOCK], angles[3][BLOCK];
    int32_t rows[BLOCK][3];
};

/* Compute normals and angles from corners. */
static void weigh_faces(struct faces *some, double scale, double rounding)
{
    for (int i = 0; i < BLOCK; i++) {
        struct vector at[3];
        for (int corner = 0; corner < 3; corner++)
            at[corner] = (struct vector){
                some->corners[corner][0][i] * scale, some->corners[corner][1][i] * scale,
                some->corners[corner][2][i] * scale};
        const struct vector ab = minus(at[1], at[0]), ac = minus(at[2], at[0]);
        const struct vector across = cross(ab, ac);
        const double length = area_length(ab, ac, across, rounding);
        const double divisor = length > 0.0 ? length : 1.0;
        /* A face with area is not so narrow, nor a scaled one so large, that this has another result
           than portable_atan2. */
        const double along = dot(ab, ac), back = -dot(ab, minus(ac, ab));
        some->lengths[i] = length;
        some->units[0][i] = across.x / divisor;
        some->units[1][i] = across.y / divisor;
        some->units[2][i] = across.z / divisor;
        const double angle_a = positive_atan2(divisor, along);
        const double angle_b = positive_atan2(divisor, back);
        some->angles[0][i] = angle_a;
        some->angles[1][i] = angle_b;
        some->angles[2][i] = max_f64(PI - angle_a - angle_b, 0.0);
    }
}

static void add_faces(
    const struct faces *some, int n, int64_t n_normals, int64_t start, int64_t stop,
    double normals[n_normals][3])
{
    for (int i = 0; i < n; i++) {
        if (some->lengths[i] == 0.0)
            continue;
        for (int corner = 0; corner < 3; corner++) {
            const int32_t row = some->rows[i][corner];
            if (row < start || row >= stop)
                continue;
            for (int axis = 0; axis < 3; axis++)
                normals[row][axis] += some->angles[corner][i] * some->units[axis][i];
        }
    }
}

/* Add every face to the normals of its corners that lie in start to stop - 1. `rows` are the normals
   of the corners, -1 for none; they are not normalized. */
EXPORT void add_vertex_normals(
    int64_t n_vertices, int64_t n_faces, int64_t n_normals, const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], const int32_t rows[n_faces][3], double scale, double rounding,
    int64_t start, int64_t stop, double normals[n_normals][3])
{
    struct faces some = {0};
    int n = 0;
    for (int64_t face = 0; face < n_faces; face++) {
        bool is_owned = false;
        for (int corner = 0; corner < 3; corner++)
            is_owned |= start <= rows[face][corner] && rows[face][corner] < stop;
        if (is_owned) {
            for (int corner = 0; corner < 3; corner++) {
                some.rows[n][corner] = rows[face][corner];
                for (int axis = 0; axis < 3; axis++)
                    some.corners[corner][axis][n] = positions[faces[face][corner]][axis];
            }
            n++;
        }
        if (n == BLOCK || face == n_faces - 1) {
            weigh_faces(&some, scale, rounding);
            add_faces(&some, n, n_normals, start, stop, normals);
            n = 0;
        }
    }
}

/* Give sums of normals unit length, or 0 where they cancel. Return how many are zero. */
EXPORT int64_t normalize_sums(int64_t n, double normals[n][3])
{
    int64_t n_zero = 0;
    for (int64_t row = 0; row < n; row++) {
        double *normal = normals[row];
        const double x = normal[0], y = normal[1], z = normal[2];
        const double length = sqrt(x * x + y * y + z * z);
        normal[0] = length > CANCELED ? x / length : 0.0;
        normal[1] = length > CANCELED ? y / length : 0.0;
        normal[2] = length > CANCELED ? z / length : 0.0;
        n_zero += !(length > CANCELED);
    }
    return n_zero;
}

/* Scalar triple product of a face's normal, an edge and a vertex's normal. */
static inline double crossed_dot(struct vector n, struct vector edge, const double normal[3])
{
    return dot(cross(n, edge), vector_at(normal));
}

/* Add the mean curvature of each face times its area, and its area, to its vertices, each to the
   vertex in `firsts`. */
EXPORT void add_curvatures(
    int64_t n_vertices, int64_t n_faces, const double points[n_vertices][3],
    const int32_t faces[n_faces][3], const int32_t firsts[n_vertices],
    const double normals[n_vertices][3], double turns[n_vertices], double areas[n_vertices])
{
    for (int64_t face = 0; face < n_faces; face++) {
        const int32_t a = faces[face][0], b = faces[face][1], c = faces[face][2];
        const struct vector origin = vector_at(points[a]);
        const struct vector ab = minus(vector_at(points[b]), origin);
        const struct vector ac = minus(vector_at(points[c]), origin);
        const struct vector across = cross(ab, ac);
        const double length = sqrt(dot(across, across));
        if (length == 0.0)
            continue;
        const struct vector n = {across.x / length, across.y / length, across.z / length};
        const struct vector back = {-ac.x, -ac.y, -ac.z};
        /* A corner's weight falls off across the face along normal x opposite edge / (2 area). */
        const double turn = (crossed_dot(n, minus(ac, ab), normals[a])
                             + crossed_dot(n, back, normals[b]) + crossed_dot(n, ab, normals[c]))
            / 4.0;
        for (int corner = 0; corner < 3; corner++) {
            const int32_t vertex = firsts[faces[face][corner]];
            turns[vertex] += turn;
            areas[vertex] += length / 2.0;
        }
    }
}
