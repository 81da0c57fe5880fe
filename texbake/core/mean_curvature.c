/* Mean curvature of the faces of a mesh, from the differences between the normals of its vertices.

   Based on: Rusinkiewicz, "Estimating Curvatures and Their Derivatives on Triangle Meshes", 2004;
   here only the trace is computed, which has a closed form.

   Called from texbake/mesh/normals.py. */

#include <math.h>

#include "core.h"
#include "vectors.h"

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
