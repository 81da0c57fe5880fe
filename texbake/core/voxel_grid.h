/* A grid of voxels with distances to a surface in sparse blocks of 8 x 8 x 8 points, in units of a
   voxel, as texbake/mesh/remeshing/band.py makes it. */

#pragma once

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "arena.h"

enum { BLOCK_SIDE = 8, BLOCK_POINTS = BLOCK_SIDE * BLOCK_SIDE * BLOCK_SIDE };

/* What the points of a grid are, as in texbake/mesh/remeshing/band.py: in the solid or not looked at
   yet; near the surface; outside; in a room that may be solid or a cavity. */
enum { CORE = 0, SHELL = 1, OUTSIDE = 2, ROOM = 3 };

struct blocks {
    int64_t ny, nz;       /* blocks along the second and third axis */
    const int32_t *slots; /* of each block, -1 where it is far from the surface */
};

/* Place of a grid point in an array of one value per point of a block, -1 where it has none. */
static inline int64_t place_in_blocks(const struct blocks *blocks, int64_t x, int64_t y, int64_t z)
{
    const int64_t block = ((x >> 3) * blocks->ny + (y >> 3)) * blocks->nz + (z >> 3);
    const int64_t slot = blocks->slots[block];
    return slot < 0 ? -1 : slot * BLOCK_POINTS + ((x & 7) << 6 | (y & 7) << 3 | (z & 7));
}

/* A list of grid points that grows. */
struct places {
    struct arena *arena;
    int64_t *items, count, room;
};

static inline struct places new_places(struct arena *arena)
{
    return (struct places){arena, TAKE(arena, int64_t, 1 << 16), 0, 1 << 16};
}

static inline void add_place(struct places *list, int64_t place)
{
    if (list->count == list->room) {
        int64_t *more = TAKE(list->arena, int64_t, 2 * list->room);
        memcpy(more, list->items, (size_t)list->count * sizeof *more);
        list->items = more;
        list->room *= 2;
    }
    list->items[list->count++] = place;
}

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
