/* How far points reach in given directions.

   Called from texbake/rendering/framing.py. */

#include "core.h"
#include "numbers.h"

/* The greatest dot product of points [start, stop) with each direction, into the row of a band. */
void find_extremes(
    int64_t n_points, int64_t n_directions, int64_t n_bands, const double points[n_points][3],
    const double directions[n_directions][3], int64_t band,
    double extremes[n_bands][n_directions], int64_t start, int64_t stop)
{
    for (int64_t k = 0; k < n_directions; k++) {
        const double *d = directions[k];
        double greatest = -INFINITY;
        for (int64_t i = start; i < stop; i++)
            greatest = max_f64(
                greatest, points[i][0] * d[0] + points[i][1] * d[1] + points[i][2] * d[2]);
        extremes[band][k] = greatest;
    }
}
