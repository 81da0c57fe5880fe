/* Gradient noise, and sums of its octaves.

   Noise is 0 at every lattice point, with a random slope there, and smooth in between. The hash of the
   lattice point (i, j, k) is phi(i + phi(j + phi(k))) modulo 256 for a permutation phi.

   Based on: Perlin, "An Image Synthesizer", 1985; Perlin, "Improving Noise", 2002. Departs from the
   latter in the order of the hash, which is that of 1985 for both.

   Called from texbake/texture/procedures/noise.py and solid_patterns.c. */

#include "gradient_noise.h"

#include <math.h>

#include "core.h"
#include "numbers.h"

/* 1 - w(t) for t in [0, 1]. */
static inline double rise(double t, bool quintic)
{
    return quintic ? t * t * t * (t * (t * 6.0 - 15.0) + 10.0) : t * t * (3.0 - 2.0 * t);
}

/* Slopes of the two corners of an edge along x, interpolated; `left` and `right` are hashes. */
static inline double along_edge(
    const struct noise_lattice *lattice, int64_t left, int64_t right, double to_right, double u,
    double v, double t)
{
    const double *a = lattice->gradients[lattice->permutation[left]];
    const double *b = lattice->gradients[lattice->permutation[right]];
    const double at_left = a[0] * u + a[1] * v + a[2] * t;
    const double at_right = b[0] * (u - 1.0) + b[1] * v + b[2] * t;
    return at_left + to_right * (at_right - at_left);
}

/* Signed noise at a point with finite coordinates. */
double noise_at(const struct noise_lattice *lattice, double x, double y, double z)
{
    const uint8_t *phi = lattice->permutation;
    double u, v, t;
    const int64_t i = lattice_cell(x, &u), j = lattice_cell(y, &v), k = lattice_cell(z, &t);
    /* w(t - 1) = 1 - w(t), so that the sum over corners is one interpolation after another. */
    const double to_right = rise(u, lattice->quintic), to_back = rise(v, lattice->quintic);
    const double to_top = rise(t, lattice->quintic);
    const int64_t right = (i + 1) & 255, back = (j + 1) & 255;
    const int64_t below = phi[k], above = phi[k + 1];
    const int64_t front_below = phi[j + below], back_below = phi[back + below];
    const int64_t front_above = phi[j + above], back_above = phi[back + above];
    double low = along_edge(lattice, i + front_below, right + front_below, to_right, u, v, t);
    double far = along_edge(lattice, i + back_below, right + back_below, to_right, u, v - 1.0, t);
    low += to_back * (far - low);
    t -= 1.0;
    double high = along_edge(lattice, i + front_above, right + front_above, to_right, u, v, t);
    far = along_edge(lattice, i + back_above, right + back_above, to_right, u, v - 1.0, t);
    high += to_back * (far - high);
    return low + to_top * (high - low);
}

double sum_octaves(
    const struct noise_lattice *lattice, const struct octaves *octaves, const struct point *point,
    double width, double *lost)
{
    /* Cells that each octave is moved along x, y and z beyond the one before it. */
    const double shift_x = 37.0, shift_y = 17.0, shift_z = 59.0;
    const double mean = octaves->mean;
    double scale = 1.0, amplitude = 1.0, total = 0.0;
    *lost = 0.0;
    for (int64_t octave = 0; octave < octaves->count; octave++) {
        const double shift = mean < 0.0 ? (double)octave : 0.0;
        const double kept = width > 0.0 ? contrast_kept(width * scale) : 1.0;
        double value = 0.0;
        if (kept > 0.0)
            value = noise_at(
                lattice, point->x * scale + shift * shift_x, point->y * scale + shift * shift_y,
                point->z * scale + shift * shift_z);
        if (mean >= 0.0)
            value = mean + kept * (fabs(value) - mean);
        else
            value *= kept;
        total += amplitude * value;
        *lost += amplitude * amplitude * (1.0 - kept * kept);
        scale *= octaves->lacunarity;
        amplitude *= octaves->gain;
    }
    return total;
}

/* Noise, scaled to [0, 1]; `bound` is the upper bound on its size. */
EXPORT void fill_noise(
    int64_t n, int64_t n_coordinates, int64_t n_widths, const double points[n][n_coordinates],
    OPTIONAL const float widths[n][n_widths], const uint8_t permutation[512],
    const double gradients[256][3], float out[n][1], bool quintic, double bound, int64_t start,
    int64_t stop)
{
    const struct procedure_points given = {
        points[0], widths ? widths[0] : NULL, n_coordinates, n_widths};
    const struct noise_lattice lattice = {permutation, gradients, quintic};
    for (int64_t i = start; i < stop; i++) {
        const struct point at = point_at(&given, i);
        const double kept = contrast_kept(widest(&given, i));
        const double value = kept > 0.0 ? kept * noise_at(&lattice, at.x, at.y, at.z) : 0.0;
        out[i][0] = (float)(0.5 + 0.5 * value / bound);
    }
}

/* Sums of octaves. */
EXPORT void fill_octave_sums(
    int64_t n, int64_t n_coordinates, int64_t n_widths, const double points[n][n_coordinates],
    OPTIONAL const float widths[n][n_widths], const uint8_t permutation[512],
    const double gradients[256][3], double sums[n], bool quintic, int64_t n_octaves,
    double lacunarity, double gain, double mean, int64_t start, int64_t stop)
{
    const struct procedure_points given = {
        points[0], widths ? widths[0] : NULL, n_coordinates, n_widths};
    const struct noise_lattice lattice = {permutation, gradients, quintic};
    const struct octaves octaves = {n_octaves, lacunarity, gain, mean};
    double lost;
    for (int64_t i = start; i < stop; i++) {
        const struct point at = point_at(&given, i);
        sums[i] = sum_octaves(&lattice, &octaves, &at, widest(&given, i), &lost);
    }
}

/* Sums of octaves, scaled and clamped to [0, 1]. */
EXPORT void fill_octave_values(
    int64_t n, int64_t n_coordinates, int64_t n_widths, const double points[n][n_coordinates],
    OPTIONAL const float widths[n][n_widths], const uint8_t permutation[512],
    const double gradients[256][3], float out[n][1], bool quintic, int64_t n_octaves,
    double lacunarity, double gain, double mean, double offset, double scale, int64_t start,
    int64_t stop)
{
    const struct procedure_points given = {
        points[0], widths ? widths[0] : NULL, n_coordinates, n_widths};
    const struct noise_lattice lattice = {permutation, gradients, quintic};
    const struct octaves octaves = {n_octaves, lacunarity, gain, mean};
    double lost;
    for (int64_t i = start; i < stop; i++) {
        const struct point at = point_at(&given, i);
        const double total = sum_octaves(&lattice, &octaves, &at, widest(&given, i), &lost);
        out[i][0] = (float)clamp_f64(offset + scale * total, 0.0, 1.0);
    }
}
