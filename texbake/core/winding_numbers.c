/* How often a surface, closed or torn, winds around points.

   Based on: Alec Jacobson, Ladislav Kavan, Olga Sorkine-Hornung, "Robust Inside-Outside Segmentation
   using Generalized Winding Numbers", ACM Transactions on Graphics 32(4), 2013; the solid angle of a
   triangle after A. van Oosterom and J. Strackee, 1983; far clusters of faces as one dipole after
   Gavin Barill et al., "Fast Winding Numbers for Soups and Clouds", 2018. Departs from it in that
   clusters are the cells of one grid and no tree.

   Called from texbake/mesh/remeshing/parts.py. */

#include <math.h>

#include "core.h"
#include "elementary.h"
#include "numbers.h"
#include "vectors.h"

/* Clusters at least this many times as far as they are large are dipoles. */
static const double FAR = 4.0;

static const double FULL_SPHERE = 12.566370614359172;

/* The center, the vector area and the radius of clusters start to stop - 1. */
EXPORT void gather_clusters(
    int64_t n_vertices, int64_t n_faces, int64_t n_clusters, const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], const int64_t starts[n_clusters + 1],
    double clusters[n_clusters][7], int64_t start, int64_t stop)
{
    for (int64_t k = start; k < stop; k++) {
        struct vector sum = {0.0, 0.0, 0.0}, area = {0.0, 0.0, 0.0};
        for (int64_t face = starts[k]; face < starts[k + 1]; face++) {
            const struct vector a = vector_at(positions[faces[face][0]]);
            const struct vector b = vector_at(positions[faces[face][1]]);
            const struct vector c = vector_at(positions[faces[face][2]]);
            const struct vector normal = cross(minus(b, a), minus(c, a));
            sum = weighted(sum, weighted(a, weighted(b, c, 1.0, 1.0), 1.0, 1.0), 1.0, 1.0);
            area = weighted(area, normal, 1.0, 0.5);
        }
        const double share = 1.0 / (double)(3 * (starts[k + 1] - starts[k]));
        const struct vector center = weighted(sum, sum, share, 0.0);
        double radius_squared = 0.0;
        for (int64_t face = starts[k]; face < starts[k + 1]; face++)
            for (int corner = 0; corner < 3; corner++) {
                const struct vector offset =
                    minus(vector_at(positions[faces[face][corner]]), center);
                radius_squared = max_f64(radius_squared, dot(offset, offset));
            }
        const double cluster[7] = {center.x, center.y, center.z, area.x,
                                   area.y,   area.z,   sqrt(radius_squared)};
        for (int i = 0; i < 7; i++)
            clusters[k][i] = cluster[i];
    }
}

/* The signed solid angle of a triangle, positive where its back is seen. */
static double solid_angle(const double (*positions)[3], const int32_t face[3], struct vector p)
{
    const struct vector a = minus(vector_at(positions[face[0]]), p);
    const struct vector b = minus(vector_at(positions[face[1]]), p);
    const struct vector c = minus(vector_at(positions[face[2]]), p);
    const double la = sqrt(dot(a, a)), lb = sqrt(dot(b, b)), lc = sqrt(dot(c, c));
    const double below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
    return 2.0 * portable_atan2(dot(a, cross(b, c)), below);
}

/* The winding numbers of points start to stop - 1, none of which lies on the surface. The faces of
   cluster k are those from starts[k] to starts[k + 1]. */
EXPORT void measure_winding(
    int64_t n_vertices, int64_t n_faces, int64_t n_clusters, int64_t n,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int64_t starts[n_clusters + 1], const double clusters[n_clusters][7],
    const double points[n][3], double windings[n], int64_t start, int64_t stop)
{
    for (int64_t i = start; i < stop; i++) {
        const struct vector p = vector_at(points[i]);
        double sum = 0.0;
        for (int64_t k = 0; k < n_clusters; k++) {
            const struct vector offset = minus(vector_at(clusters[k]), p);
            const double squared = dot(offset, offset), reach = FAR * clusters[k][6];
            if (squared > reach * reach) {
                sum += dot(vector_at(clusters[k] + 3), offset) / (squared * sqrt(squared));
                continue;
            }
            for (int64_t face = starts[k]; face < starts[k + 1]; face++)
                sum += solid_angle(positions, faces[face], p);
        }
        windings[i] = sum / FULL_SPHERE;
    }
}
