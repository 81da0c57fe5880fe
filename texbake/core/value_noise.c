/* Value noise: a random number at each lattice point, and what lies between them.

   The number of the lattice point (i, j, k) is that of its hash, phi(i + phi(j + phi(k))) modulo 256.
   A point shows the number of the corner of its cell nearest to the origin of the lattice, or the
   eight corners interpolated along x, y and z in turn, by a straight line or by a smooth step.

   Based on: Perlin, "An Image Synthesizer", 1985; Ebert et al., "Texturing and Modeling", 2003,
   chapter 2.

   Called from texbake/texture/procedures/noise.py. */

#include "core.h"
#include "gradient_noise.h"
#include "numbers.h"

enum interpolation { NONE, LINEAR, CUBIC, QUINTIC };

/* Share of the far corner at t in [0, 1) between two corners. */
static inline double share_at(double t, int64_t interpolation)
{
    switch (interpolation) {
    case NONE:
        return 0.0;
    case LINEAR:
        return t;
    case CUBIC:
        return t * t * (3.0 - 2.0 * t);
    default:
        return t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    }
}

static double value_at(
    const uint8_t *phi, const double *values, int64_t interpolation, const struct point *at)
{
    double u, v, t;
    const int64_t i = lattice_cell(at->x, &u), j = lattice_cell(at->y, &v);
    const int64_t k = lattice_cell(at->z, &t);
    u = share_at(u, interpolation), v = share_at(v, interpolation), t = share_at(t, interpolation);
    double layers[2];
    for (int64_t up = 0; up < 2; up++) {
        double rows[2];
        for (int64_t back = 0; back < 2; back++) {
            const int64_t row = phi[((j + back) & 255) + phi[(k + up) & 255]];
            const double left = values[phi[i + row]], right = values[phi[((i + 1) & 255) + row]];
            rows[back] = left + u * (right - left);
        }
        layers[up] = rows[0] + v * (rows[1] - rows[0]);
    }
    return layers[0] + t * (layers[1] - layers[0]);
}

/* Values in [0, 1], which fade to 1/2 where the pixel is wide. */
EXPORT void fill_value_noise(
    int64_t n, int64_t n_coordinates, int64_t n_widths, const double points[n][n_coordinates],
    OPTIONAL const float widths[n][n_widths], const uint8_t permutation[512],
    const double values[256], float out[n][1], int64_t interpolation, int64_t start, int64_t stop)
{
    const struct procedure_points given = {
        points[0], widths ? widths[0] : NULL, n_coordinates, n_widths};
    for (int64_t i = start; i < stop; i++) {
        const struct point at = point_at(&given, i);
        const double kept = contrast_kept(widest(&given, i));
        const double value = kept > 0.0 ? value_at(permutation, values, interpolation, &at) : 0.5;
        out[i][0] = (float)(0.5 + kept * (value - 0.5));
    }
}
