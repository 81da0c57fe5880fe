/* Projecting points into pictures: photographs, with the weight of what is found there; and light
   cookies and others, with the changes from pixel to pixel.

   A photograph counts fully where its camera faces the surface. Its weight falls with the angle, and
   towards the border of the photograph so that none of its edges shows in the texture.

   Based on: Debevec, Taylor, Malik, "Modeling and rendering architecture from photographs", SIGGRAPH
   1996 (photographs weighted by direction and feathered at their borders); Segal, Korobkin, van
   Widenfelt, Foran, Haeberli, "Fast shadows and lighting effects using texture mapping", SIGGRAPH
   1992; texbake/rendering/effects/projectors.py has the derivation.

   Called from texbake/baking/texture/photo_mappings.py and
   texbake/rendering/effects/projectors.py. */

#include <math.h>

#include "core.h"
#include "elementary.h"
#include "numbers.h"

/* 0 outside the unit square and on its border, 1 from `feather` inwards, smoothly between. */
static double border_weight(double u, double v, double feather)
{
    if (!(0.0 < u && u < 1.0 && 0.0 < v && v < 1.0))
        return 0.0;
    const double inside = min_f64(min_f64(u, 1.0 - u), min_f64(v, 1.0 - v));
    if (inside >= feather)
        return 1.0;
    const double share = inside / feather;
    return share * share * (3.0 - 2.0 * share);
}

static inline double transform(const double *row, const double *p)
{
    return row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
}

/* Write the weights of points by viewing angle and, where above 0, their UVs in the photo. */
EXPORT void weigh_by_camera(
    int64_t n, int64_t n_faces, const int32_t faces[n], const double positions[n][3],
    const double normals[n][3], const double matrix[3][4], const double seen_from[4],
    const double face_normals[n_faces][3], const double steps[n_faces][3][2], double least_cosine,
    double falloff, double feather, double coordinates[n][2], float derivatives[n][4],
    double weights[n])
{
    for (int64_t i = 0; i < n; i++) {
        weights[i] = 0.0;
        const double q = transform(matrix[2], positions[i]);
        if (!(q > 0.0))
            continue;
        const double u = transform(matrix[0], positions[i]) / q;
        const double v = transform(matrix[1], positions[i]) / q;
        const double border = border_weight(u, v, feather);
        if (border == 0.0)
            continue;
        double square = 0.0, smooth = 0.0, flat = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            const double towards = seen_from[axis] - seen_from[3] * positions[i][axis];
            square += towards * towards;
            smooth += towards * normals[i][axis];
            flat += towards * face_normals[faces[i]][axis];
        }
        /* The face itself decides whether it is seen; the smooth normal makes the weight smooth. */
        const double share = (smooth / sqrt(square) - least_cosine) / (1.0 - least_cosine);
        if (!(flat > 0.0 && share > 0.0))
            continue;
        weights[i] = border * short_power(min_f64(share, 1.0), falloff);
        coordinates[i][0] = u;
        coordinates[i][1] = v;
        const double (*step)[2] = steps[faces[i]];
        for (int axis = 0; axis < 2; axis++) {
            derivatives[i][2 * axis] = (float)((step[0][axis] - u * step[2][axis]) / q);
            derivatives[i][2 * axis + 1] = (float)((step[1][axis] - v * step[2][axis]) / q);
        }
    }
}

/* Write the UVs of points in a photograph, and their weights by the area it gives them. */
EXPORT void weigh_by_area(
    int64_t n, int64_t n_faces, const int32_t faces[n], const double barycentrics[n][2],
    const double corners[n_faces][3][2], const double facing[n_faces][3], double falloff,
    double feather, double coordinates[n][2], double weights[n])
{
    for (int64_t i = 0; i < n; i++) {
        const double b = barycentrics[i][0], c = barycentrics[i][1];
        const double a = 1.0 - b - c;
        const double (*corner)[2] = corners[faces[i]];
        const double u = a * corner[0][0] + b * corner[1][0] + c * corner[2][0];
        const double v = a * corner[0][1] + b * corner[1][1] + c * corner[2][1];
        const double *turned = facing[faces[i]];
        const double share = min_f64(a * turned[0] + b * turned[1] + c * turned[2], 1.0);
        coordinates[i][0] = u;
        coordinates[i][1] = v;
        weights[i] = share > 0.0 ? border_weight(u, v, feather) * short_power(share, falloff) : 0.0;
    }
}

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
