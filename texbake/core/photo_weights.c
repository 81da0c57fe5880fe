/* Projecting points into a photograph, and weighting what is found there.

   A photograph counts fully where its camera faces the surface. Its weight falls with the angle, and
   towards the border of the photograph so that none of its edges shows in the texture.

   Based on: Debevec, Taylor, Malik, "Modeling and rendering architecture from photographs", SIGGRAPH
   1996 (photographs weighted by direction and feathered at their borders).

   Called from texbake/baking/texture/photo_mappings.py. */

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
