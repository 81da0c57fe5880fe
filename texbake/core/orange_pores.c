/* The pores of an orange: how deep a direction on the unit sphere lies below its peel.

   Called from texbake/mesh/shapes.py, which places the pores and lists them by cells. */

#include <math.h>

#include "core.h"
#include "numbers.h"

/* The cell of a grid over the cube from -1 to 1 that a direction lies in. */
static int64_t cell_of(const double direction[3], int64_t n_cells)
{
    int64_t cell = 0;
    for (int axis = 0; axis < 3; axis++) {
        const double column = floor((direction[axis] + 1.0) * (0.5 * (double)n_cells));
        cell = cell * n_cells + clamp_i64((int64_t)column, 0, n_cells - 1);
    }
    return cell;
}

/* Write how far the pores sink the peel in each direction, in units of its radius. */
EXPORT void pore_depths(
    int64_t n, int64_t n_pores, int64_t n_starts, int64_t n_entries,
    const double directions[n][3], const double centers[n_pores][3], const double radii[n_pores],
    const double depths_of_pores[n_pores], int64_t n_cells, const int64_t cell_starts[n_starts],
    const int64_t cell_pores[n_entries], double depths[n])
{
    for (int64_t k = 0; k < n; k++) {
        const double *direction = directions[k];
        const int64_t cell = cell_of(direction, n_cells);
        double depth = 0.0;
        for (int64_t slot = cell_starts[cell]; slot < cell_starts[cell + 1]; slot++) {
            const int64_t pore = cell_pores[slot];
            const double *center = centers[pore];
            const double dx = direction[0] - center[0], dy = direction[1] - center[1];
            const double dz = direction[2] - center[2];
            const double squared = dx * dx + dy * dy + dz * dz;
            const double inside = 1.0 - squared / (radii[pore] * radii[pore]);
            if (inside > 0.0) /* cubed: the rim has two continuous derivatives */
                depth += depths_of_pores[pore] * inside * inside * inside;
        }
        depths[k] = depth;
    }
}
