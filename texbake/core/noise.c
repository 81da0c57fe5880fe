/* Noise: gradient noise and sums of its octaves, value noise, and Worley's cells.

   docs/reference/procedures.md has the formulas and their sources.

   Called from texbake/texture/procedures/noise.py and patterns.c. */

#include <math.h>

#include "core.h"
#include "gradient_noise.h"
#include "numbers.h"
#include "procedure_points.h"

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

/* As in texbake/texture/procedures/noise.py. */
enum { F1, F2_MINUS_F1 };

struct scattered_points {
    const uint8_t *permutation;
    const double (*places)[3]; /* in the unit cube */
    double jitter;             /* 1: anywhere in a cell, 0: in its middle */
    bool is_solid;             /* three dimensions and not two */
};

/* Squared distances. */
struct two_nearest {
    double nearest, second;
};

/* Square of how far the cell `step` cells away is along one axis. */
static inline double squared_gap(double within, int64_t step)
{
    if (step == 0)
        return 0.0;
    const double gap = step > 0 ? (double)step - within : within - (double)step - 1.0;
    return gap * gap;
}

/* Update `found` with the point of the cell that is `cell` cells away. */
static inline void measure_point(
    const struct scattered_points *scattered, int64_t index, const int64_t cell[3],
    const double within[3], struct two_nearest *found)
{
    double squared = 0.0;
    for (int axis = 0; axis < (scattered->is_solid ? 3 : 2); axis++) {
        const double place = scattered->jitter * (scattered->places[index][axis] - 0.5);
        const double off = (double)cell[axis] + 0.5 + place - within[axis];
        squared += off * off;
    }
    found->second = min_f64(found->second, max_f64(found->nearest, squared));
    found->nearest = min_f64(found->nearest, squared);
}

static struct two_nearest find_two_nearest(
    const struct scattered_points *scattered, const struct point *at)
{
    const uint8_t *phi = scattered->permutation;
    double within[3];
    const int64_t i = lattice_cell(at->x, &within[0]), j = lattice_cell(at->y, &within[1]);
    const int64_t k = lattice_cell(at->z, &within[2]);
    struct two_nearest found = {INFINITY, INFINITY};
    for (int64_t reach = 0;; reach++) {
        const int64_t reach_z = scattered->is_solid ? reach : 0;
        for (int64_t dk = -reach_z; dk <= reach_z; dk++) {
            const double gap_k = scattered->is_solid ? squared_gap(within[2], dk) : 0.0;
            const int64_t hash_k = scattered->is_solid ? phi[(k + dk) & 255] : 0;
            for (int64_t dj = -reach; dj <= reach; dj++) {
                const double gap_jk = gap_k + squared_gap(within[1], dj);
                const int64_t hash_j = phi[((j + dj) & 255) + hash_k];
                /* Inside the ring all cells have been searched before. */
                const bool is_inside = dj > -reach && dj < reach && dk > -reach && dk < reach;
                for (int64_t di = -reach; di <= reach; di += is_inside ? 2 * reach : 1) {
                    if (gap_jk + squared_gap(within[0], di) >= found.second)
                        continue;
                    const int64_t cell[3] = {di, dj, dk};
                    measure_point(
                        scattered, phi[((i + di) & 255) + hash_j], cell, within, &found);
                }
            }
        }
        /* What lies further out is at least that far away. */
        if (found.second <= (double)(reach * reach))
            return found;
    }
}

/* F1 or F2 - F1 in cell widths, clamped to 1; wide pixels show `mean`. */
EXPORT void fill_cells(
    int64_t n, int64_t n_coordinates, int64_t n_widths, const double points[n][n_coordinates],
    OPTIONAL const float widths[n][n_widths], const uint8_t permutation[512],
    const double places[256][3], float out[n][1], double jitter, bool is_solid, int64_t feature,
    double mean, int64_t start, int64_t stop)
{
    const struct procedure_points given = {
        points[0], widths ? widths[0] : NULL, n_coordinates, n_widths};
    const struct scattered_points scattered = {permutation, places, jitter, is_solid};
    for (int64_t i = start; i < stop; i++) {
        const struct point at = point_at(&given, i);
        const double kept = contrast_kept(widest(&given, i));
        double value = 0.0;
        if (kept > 0.0) {
            const struct two_nearest found = find_two_nearest(&scattered, &at);
            value = sqrt(found.nearest);
            if (feature == F2_MINUS_F1)
                value = sqrt(found.second) - value;
        }
        out[i][0] = (float)(mean + kept * (min_f64(value, 1.0) - mean));
    }
}
