/* Checkers and stripes, averaged over each pixel.

   Based on: pulse_train.h.

   Called from texbake/texture/procedures/patterns.py. */

#include "pulse_train.h"

#include "core.h"
#include "procedure_points.h"

/* A checker of unit squares or cubes. */
EXPORT void fill_checker(
    int64_t n, int64_t n_coordinates, int64_t n_widths, const double points[n][n_coordinates],
    OPTIONAL const float widths[n][n_widths], float out[n][1], int64_t n_dimensions,
    int64_t start, int64_t stop)
{
    const struct procedure_points given = {
        points[0], widths ? widths[0] : NULL, n_coordinates, n_widths};
    for (int64_t i = start; i < stop; i++) {
        const struct point at = point_at(&given, i);
        const double place[3] = {at.x, at.y, at.z};
        double sign = 1.0;
        for (int64_t axis = 0; axis < n_dimensions; axis++) {
            /* A coordinate that points do not have is 0 all over the pixel. */
            const double span = axis < n_coordinates ? width_along(&given, i, axis) : 0.0;
            sign *= 2.0 * pulse_mean(PULSE_HARD, 0.5, 0.5 * place[axis], 0.5 * span) - 1.0;
        }
        out[i][0] = (float)(0.5 + 0.5 * sign);
    }
}

/* Stripes across a direction, `width` of each period. */
EXPORT void fill_stripes(
    int64_t n, int64_t n_coordinates, int64_t n_widths, const double points[n][n_coordinates],
    OPTIONAL const float widths[n][n_widths], const double direction[3], float out[n][1],
    int64_t pattern, double width, int64_t start, int64_t stop)
{
    const struct procedure_points given = {
        points[0], widths ? widths[0] : NULL, n_coordinates, n_widths};
    for (int64_t i = start; i < stop; i++) {
        const struct point at = point_at(&given, i);
        const double along = direction[0] * at.x + direction[1] * at.y + direction[2] * at.z;
        out[i][0] = (float)pulse_mean(pattern, width, along, span_along(&given, i, direction));
    }
}
