/* A grid of voxels with distances to a surface in sparse blocks of 8 x 8 x 8 points, in units of a
   voxel, as texbake/mesh/remeshing/band.py makes it. */

#ifndef TEXBAKE_VOXEL_GRID_H
#define TEXBAKE_VOXEL_GRID_H

#include <stdint.h>

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

#endif
