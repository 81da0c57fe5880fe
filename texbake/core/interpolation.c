/* Interpolating positions, directions and texture coordinates at fragments, by barycentric weights
   that are correct in perspective.

   Each function writes one row per fragment. Weights are those of the triangle's second and third
   corner; `changes` are their growth for one pixel to the right, then for one pixel down. They are
   computed from the corners in clip space, so the triangle need not be clipped.

   Based on: Heckbert, "Fundamentals of Texture Mapping and Image Warping", 1989; Olano and Greer,
   "Triangle scan conversion using 2D homogeneous coordinates", Graphics Hardware 1997.

   Called from texbake/rendering/fragments.py, and from points.py and slots.py of its effects. */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "clipping.h"
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

/* Convert weights on pieces, and their changes if there are any, to weights on the base triangles;
   `corners` has those of each piece. */
EXPORT void move_to_base(
    int64_t n, int64_t n_changes, int64_t n_pieces, const int32_t faces[n],
    const double weights[n][2], const float changes[n_changes][4],
    const float corners[n_pieces][3][2], double weights_out[n][2], float changes_out[n_changes][4])
{
    for (int64_t i = 0; i < n; i++) {
        const float (*piece)[2] = corners[faces[i]];
        for (int k = 0; k < 2; k++) {
            const double along = piece[1][k] - piece[0][k], up = piece[2][k] - piece[0][k];
            weights_out[i][k] = piece[0][k] + weights[i][0] * along + weights[i][1] * up;
            if (n_changes > 0) {
                const float *change = changes[i];
                changes_out[i][k] = (float)(change[0] * along + change[1] * up);
                changes_out[i][2 + k] = (float)(change[2] * along + change[3] * up);
            }
        }
    }
}

/* Write the position of each fragment in world space. */
EXPORT void interpolate_positions(
    int64_t n_points, int64_t n_faces, int64_t n, const double points[n_points][3],
    const int32_t corners[n_faces][3], const int32_t faces[n], const double weights[n][2],
    double out[restrict n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const int32_t *corner = corners[faces[i]];
        const double *a = points[corner[0]], *b = points[corner[1]], *c = points[corner[2]];
        /* Relative to the first corner, so that weights of 0 give its position exactly. */
        for (int k = 0; k < 3; k++)
            out[i][k] = a[k] + weights[i][0] * (b[k] - a[k]) + weights[i][1] * (c[k] - a[k]);
    }
}

/* Write the unit vector from each fragment to the camera. */
EXPORT void find_view_directions(
    int64_t n, const float places[n][2], const double rays[3][3], float out[restrict n][3])
{
    for (int64_t i = 0; i < n; i++) {
        double squared = 0.0;
        for (int k = 0; k < 3; k++) {
            const double ray = rays[0][k] + places[i][0] * rays[1][k] + places[i][1] * rays[2][k];
            out[i][k] = (float)-ray;
            squared += ray * ray;
        }
        const double scale = 1.0 / sqrt(squared);
        for (int k = 0; k < 3; k++)
            out[i][k] = (float)(out[i][k] * scale);
    }
}

/* Write texture coordinates and, unless `changes_out` is empty, their changes per pixel. */
EXPORT void interpolate_uvs(
    int64_t n_uvs, int64_t n_faces, int64_t n, int64_t n_changes, int64_t n_out,
    const double uvs[n_uvs][2], const int32_t corners[n_faces][3], const int32_t faces[n],
    const double weights[n][2], const float changes[n_changes][4], double out[n][2],
    float changes_out[n_out][4])
{
    for (int64_t i = 0; i < n; i++) {
        const int32_t *corner = corners[faces[i]];
        const double *a = uvs[corner[0]], *b = uvs[corner[1]], *c = uvs[corner[2]];
        for (int k = 0; k < 2; k++) {
            const double along = b[k] - a[k], up = c[k] - a[k];
            out[i][k] = a[k] + weights[i][0] * along + weights[i][1] * up;
            if (n_out > 0) {
                const float *change = changes[i];
                changes_out[i][k] = (float)(change[0] * along + change[1] * up);
                changes_out[i][2 + k] = (float)(change[2] * along + change[3] * up);
            }
        }
    }
}

/* Write points times a matrix and, unless `widths` is empty, the width of a pixel there. */
EXPORT void find_scaled_points(
    int64_t n_positions, int64_t n_faces, int64_t n, int64_t n_changes, int64_t n_widths,
    const double positions[n_positions][3], const int32_t corners[n_faces][3],
    const double matrix[3][4], const int32_t faces[n], const double weights[n][2],
    const float changes[n_changes][4], double out[n][3], float widths[n_widths][3])
{
    double places[3][3] = {{0.0}};
    int32_t known = -1; /* neighbors mostly lie on the same face */
    for (int64_t i = 0; i < n; i++) {
        if (faces[i] != known) {
            known = faces[i];
            for (int corner = 0; corner < 3; corner++) {
                const double *p = positions[corners[known][corner]];
                for (int k = 0; k < 3; k++) {
                    const double *row = matrix[k];
                    places[corner][k] = row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
                }
            }
        }
        for (int k = 0; k < 3; k++) {
            const double along = places[1][k] - places[0][k], up = places[2][k] - places[0][k];
            out[i][k] = places[0][k] + weights[i][0] * along + weights[i][1] * up;
            if (n_widths > 0) {
                const double right = fabs(changes[i][0] * along + changes[i][1] * up);
                const double down = fabs(changes[i][2] * along + changes[i][3] * up);
                widths[i][k] = (float)max_f64(right, down);
            }
        }
    }
}
