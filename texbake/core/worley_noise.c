/* Worley's cells: distances to the nearest and the second nearest of points scattered one per cell.

   Cells are searched in rings until no cell further out can hold a nearer point, so that both are
   exact.

   Based on: Worley, "A Cellular Texture Basis Function", 1996. Departs from it in having one point per
   cell, which leaves no large gaps.

   Called from texbake/texture/procedures/noise.py. */

#include <math.h>

#include "core.h"
#include "gradient_noise.h"
#include "numbers.h"
#include "procedure_points.h"

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
