/* Projecting points into light cookies and other pictures, with the changes from pixel to pixel.

   Based on: Segal, Korobkin, van Widenfelt, Foran, Haeberli, "Fast shadows and lighting effects using
   texture mapping", SIGGRAPH 1992; texbake/rendering/effects/projectors.py has the derivation.

   Called from texbake/rendering/effects/projectors.py. */

#include <math.h>

#include "core.h"
#include "numbers.h"

/* Write the motion of points in world space per pixel to the right, then down. */
EXPORT void find_pixel_steps(
    int64_t n, int64_t n_corners, int64_t n_faces, const double points[n][3],
    const double corners[n_corners][3], const int32_t faces[n_faces][3],
    const int32_t drawn_faces[n], const float places[n][2], const double rays[3][3],
    const double eye[3], double out[n][2][3])
{
    for (int64_t i = 0; i < n; i++) {
        const int32_t *face = faces[drawn_faces[i]];
        const double *a = corners[face[0]], *b = corners[face[1]], *c = corners[face[2]];
        double normal[3], ray[3], facing = 0.0, length = 0.0, squared = 0.0;
        for (int k = 0; k < 3; k++) {
            const int y = (k + 1) % 3, z = (k + 2) % 3;
            normal[k] = (b[y] - a[y]) * (c[z] - a[z]) - (b[z] - a[z]) * (c[y] - a[y]);
            ray[k] = rays[0][k] + places[i][0] * rays[1][k] + places[i][1] * rays[2][k];
            facing += normal[k] * ray[k];
            length += (points[i][k] - eye[k]) * ray[k];
            squared += ray[k] * ray[k];
        }
        const double along = length / squared;
        for (int j = 0; j < 2; j++) {
            double turn = 0.0;
            for (int k = 0; k < 3; k++)
                turn += normal[k] * rays[1 + j][k];
            for (int k = 0; k < 3; k++)
                out[i][j][k] = along * (rays[1 + j][k] - turn / facing * ray[k]);
        }
    }
}

/* Growth of s/q or t/q with a step, from the rows of the matrix; at most 1, for a pixel that holds
   the whole picture or is seen edge-on. */
static inline double change_along(
    const double row[4], const double last[4], double at, double q, const double step[3])
{
    double ds = 0.0, dq = 0.0;
    for (int k = 0; k < 3; k++) {
        ds += row[k] * step[k];
        dq += last[k] * step[k];
    }
    const double change = (ds - at * dq) / q;
    return fabs(change) <= 1.0 ? change : 1.0;
}

/* Write the picture coordinates of points and the share of each pixel that is covered; with steps,
   the changes of the coordinates too. */
EXPORT void project_points(
    int64_t n, int64_t n_steps, const double points[n][3], const double steps[n_steps][2][3],
    const double matrix[4][4], double places[n][2], float changes[n][4], float coverage[n])
{
    for (int64_t i = 0; i < n; i++) {
        double q = matrix[3][3];
        for (int k = 0; k < 3; k++)
            q += matrix[3][k] * points[i][k];
        coverage[i] = q > 0.0 ? 1.0f : 0.0f;
        for (int j = 0; j < 2; j++) {
            double at = matrix[j][3];
            for (int k = 0; k < 3; k++)
                at += matrix[j][k] * points[i][k];
            at = q > 0.0 ? at / q : 0.0;
            double width = 0.0;
            for (int d = 0; n_steps > 0 && d < 2; d++) {
                const double change = change_along(matrix[j], matrix[3], at, q, steps[i][d]);
                changes[i][2 * d + j] = (float)change;
                width += fabs(change);
            }
            /* Share of the pixel's width inside the picture. */
            if (width > 0.0) {
                const double inside = min_f64(at + 0.5 * width, 1.0) - max_f64(at - 0.5 * width, 0.0);
                coverage[i] = (float)(coverage[i] * clamp_f64(inside / width, 0.0, 1.0));
            } else if (!(0.0 <= at && at <= 1.0)) {
                coverage[i] = 0.0f;
            }
            places[i][j] = isfinite(at) ? at : 0.0;
        }
    }
}
