/* Barycentric weights of fragments, correct in perspective.

   Based on: Olano and Greer, "Triangle scan conversion using 2D homogeneous coordinates", Graphics
   Hardware 1997: weights are computed from the corners in clip space, so the triangle need not be
   clipped.

   Called from texbake/rendering/fragments.py. */

#include "perspective_weights.h"

#include "core.h"
#include "numbers.h"

/* Write the weights of the second and third corner, whether the triangle is seen from behind, and
   the growth of both weights for one pixel to the right, then for one pixel down. */
EXPORT void weigh_fragments(
    int64_t n, int64_t n_vertices, int64_t n_faces, const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], const double matrix[4][4], double width, double height,
    bool affine, const int32_t face_ids[n], const float places[n][2], double weights[n][2],
    bool back_facing[n], OPTIONAL float changes[n][4])
{
    double e[3][3] = {{0.0}};
    int32_t known = -1; /* neighbors mostly see the same triangle */
    for (int64_t i = 0; i < n; i++) {
        if (face_ids[i] != known) {
            known = face_ids[i];
            corner_edges(positions, faces[known], matrix, affine, 2.0 / width, 2.0 / height, e);
        }
        const double x = places[i][0], y = places[i][1];
        double weight0 = e[0][0] * x + e[0][1] * y + e[0][2];
        double weight1 = e[1][0] * x + e[1][1] * y + e[1][2];
        double weight2 = e[2][0] * x + e[2][1] * y + e[2][2];
        const double sign = weight0 + weight1 + weight2 < 0.0 ? -1.0 : 1.0;
        back_facing[i] = sign < 0.0;
        /* Snapping moves edges by up to half a grid step, so a position may lie just outside. */
        weight0 = max_f64(sign * weight0, 0.0);
        weight1 = max_f64(sign * weight1, 0.0);
        weight2 = max_f64(sign * weight2, 0.0);
        const double total = weight0 + weight1 + weight2;
        const double scale = 0.0 < total && total < INFINITY ? 1.0 / total : 0.0;
        weights[i][0] = weight1 * scale;
        weights[i][1] = weight2 * scale;
        for (int axis = 0; changes && axis < 2; axis++) {
            const double slope = sign * (e[0][axis] + e[1][axis] + e[2][axis]);
            changes[i][2 * axis] = (float)((sign * e[1][axis] - weights[i][0] * slope) * scale);
            changes[i][2 * axis + 1] = (float)((sign * e[2][axis] - weights[i][1] * slope) * scale);
        }
    }
}
