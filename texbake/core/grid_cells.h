/* The cells of a grid whose points are solid or not: cell (x, y, z) lies between the points
   (x, y, z) and (x + 1, y + 1, z + 1). */

#ifndef TEXBAKE_GRID_CELLS_H
#define TEXBAKE_GRID_CELLS_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

enum { ALL_SOLID = 255 };

struct solid_grid {
    int64_t nx, ny, nz;
    const bool *solid;
};

static inline int64_t grid_place(const struct solid_grid *grid, int64_t x, int64_t y, int64_t z)
{
    return (x * grid->ny + y) * grid->nz + z;
}

/* Which corners of a cell are solid: bit 4 dx + 2 dy + dz. */
static inline unsigned cell_corners(const struct solid_grid *grid, int64_t x, int64_t y, int64_t z)
{
    unsigned corners = 0;
    for (unsigned corner = 0; corner < 8; corner++) {
        const int64_t place = grid_place(grid, x + (corner >> 2), y + (corner >> 1 & 1), z + (corner & 1));
        corners |= (unsigned)grid->solid[place] << corner;
    }
    return corners;
}

/* Whether the eight cells from z on, of which z is a multiple of 8, have corners of one kind. */
static inline bool are_uniform(const struct solid_grid *grid, int64_t x, int64_t y, int64_t z)
{
    static const uint64_t ones = 0x0101010101010101u;
    const int64_t next = z + 8 < grid->nz ? 8 : 7;
    const uint64_t first = grid->solid[grid_place(grid, x, y, z)] ? ones : 0;
    for (int64_t side = 0; side < 4; side++) {
        const bool *row = grid->solid + grid_place(grid, x + (side >> 1), y + (side & 1), z);
        uint64_t word;
        memcpy(&word, row, sizeof word);
        if (word != first || row[next] != (first != 0))
            return false;
    }
    return true;
}

#endif
