/* Faces that fold over, or shrink to nothing, when their vertices move; and quads divided into
   triangles that do not.

   Called from texbake/mesh/remeshing/solid.py and projection.py. */

#include <math.h>
#include <stdbool.h>

#include "core.h"
#include "numbers.h"
#include "vectors.h"

/* Least cosine between the normals of a face before and after, and least area after, in units of a
   voxel's side; a face that was smaller may stay as it was. */
static const double LEAST_COSINE = 0.3, LEAST_AREA = 0.01;

static struct vector doubled_area(const double (*positions)[3], const int32_t face[3])
{
    const struct vector a = vector_at(positions[face[0]]);
    return cross(
        minus(vector_at(positions[face[1]]), a), minus(vector_at(positions[face[2]]), a));
}

static bool folds(
    const double (*before)[3], const double (*after)[3], const int32_t face[3])
{
    const struct vector old = doubled_area(before, face), new = doubled_area(after, face);
    const double old_area = sqrt(dot(old, old)), new_area = sqrt(dot(new, new));
    return new_area < min_f64(old_area, 2.0 * LEAST_AREA)
           || dot(old, new) < LEAST_COSINE * old_area * new_area;
}

/* Find which of the faces start to stop - 1 fold when vertices move from `before` to `after`. */
EXPORT void find_folded(
    int64_t n_vertices, int64_t n_faces, const double before[n_vertices][3],
    const double after[n_vertices][3], const int32_t faces[n_faces][3], bool folded[n_faces],
    int64_t start, int64_t stop)
{
    for (int64_t k = start; k < stop; k++)
        folded[k] = folds(before, after, faces[k]);
}

static void divide(const int32_t quad[4], int diagonal, int32_t faces[2][3])
{
    for (int corner = 0; corner < 3; corner++) {
        faces[0][corner] = quad[(diagonal + corner) % 4];
        faces[1][corner] = quad[(diagonal + corner + 2) % 4];
    }
}

static double smaller_area(const double (*positions)[3], const int32_t faces[2][3])
{
    const struct vector first = doubled_area(positions, faces[0]);
    const struct vector second = doubled_area(positions, faces[1]);
    return min_f64(dot(first, first), dot(second, second));
}

/* Divide a quad by the diagonal that leaves the smaller of its two faces larger. */
static void divide_evenly(const double (*positions)[3], const int32_t quad[4], int32_t faces[2][3])
{
    int32_t others[2][3];
    divide(quad, 0, faces);
    divide(quad, 1, others);
    if (smaller_area(positions, others) > smaller_area(positions, faces))
        divide(quad, 1, faces);
}

/* Divide quads start to stop - 1 evenly after a move; where a face would fold, as before it. */
EXPORT void split_quads(
    int64_t n_vertices, int64_t n_quads, const double before[n_vertices][3],
    const double after[n_vertices][3], const int32_t quads[n_quads][4],
    int32_t faces[n_quads][2][3], int64_t start, int64_t stop)
{
    for (int64_t k = start; k < stop; k++) {
        divide_evenly(after, quads[k], faces[k]);
        if (folds(before, after, faces[k][0]) || folds(before, after, faces[k][1]))
            divide_evenly(before, quads[k], faces[k]);
    }
}
