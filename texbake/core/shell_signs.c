/* On which side of the surface the grid points next to it lie.

   A ball around a point that is as large as its distance from the surface holds no surface, so that
   all points in it lie on its side. Points that are seen only so from outside, and have solid behind
   the surface, are outside. Where both sides of a surface are outside, it is a sheet, and all points
   near it are taken into the solid, which gives it a thickness.

   Called from texbake/mesh/remeshing/solid.py. */

#include <math.h>

#include "core.h"
#include "numbers.h"
#include "voxel_grid.h"

enum { REACH = 2 }; /* points whose balls are looked at, along each axis */
enum { SEEN_FROM_OUTSIDE = 1, SEEN_FROM_CORE = 2 };

struct shell {
    struct blocks blocks;
    int64_t sizes[3];
    const uint8_t *labels;
    const float *distances;
};

static uint8_t label_at(const struct shell *shell, int64_t x, int64_t y, int64_t z)
{
    return shell->labels[(x * shell->sizes[1] + y) * shell->sizes[2] + z];
}

/* From which sides a point of the shell is seen. */
static uint8_t sides_that_see(const struct shell *shell, int64_t x, int64_t y, int64_t z)
{
    uint8_t seen = 0;
    for (int64_t dx = -REACH; dx <= REACH; dx++)
        for (int64_t dy = -REACH; dy <= REACH; dy++)
            for (int64_t dz = -REACH; dz <= REACH; dz++) {
                const uint8_t label = label_at(shell, x + dx, y + dy, z + dz);
                const uint8_t side = label == OUTSIDE ? SEEN_FROM_OUTSIDE : SEEN_FROM_CORE;
                if (label == SHELL || (seen & side))
                    continue;
                const int64_t place =
                    place_in_blocks(&shell->blocks, x + dx, y + dy, z + dz);
                if (place < 0)
                    continue;
                const float distance = shell->distances[place];
                if ((float)(dx * dx + dy * dy + dz * dz) < distance * distance)
                    seen |= side;
            }
    return seen;
}

/* Tell for the points of blocks start to stop - 1 from which sides they are seen. */
EXPORT void see_shell(
    int64_t n_slots, int64_t nx, int64_t ny, int64_t nz, int64_t width, int64_t height,
    int64_t depth, const int32_t slots[nx][ny][nz], const int32_t corners[n_slots][3],
    const float distances[n_slots][512], const uint8_t labels[width][height][depth],
    uint8_t seen[n_slots][512], int64_t start, int64_t stop)
{
    const struct shell shell = {
        {ny, nz, &slots[0][0][0]}, {width, height, depth}, &labels[0][0][0], &distances[0][0]};
    for (int64_t slot = start; slot < stop; slot++)
        for (int64_t k = 0; k < BLOCK_POINTS; k++) {
            const int64_t x = corners[slot][0] + (k >> 6), y = corners[slot][1] + (k >> 3 & 7);
            const int64_t z = corners[slot][2] + (k & 7);
            const uint8_t label = label_at(&shell, x, y, z);
            seen[slot][k] = label == OUTSIDE ? SEEN_FROM_OUTSIDE
                            : label == CORE  ? SEEN_FROM_CORE
                                             : sides_that_see(&shell, x, y, z);
        }
}

static bool has_core_near(
    const struct shell *shell, const uint8_t *seen, int64_t x, int64_t y, int64_t z)
{
    for (int64_t dx = -REACH; dx <= REACH; dx++)
        for (int64_t dy = -REACH; dy <= REACH; dy++)
            for (int64_t dz = -REACH; dz <= REACH; dz++) {
                const int64_t place =
                    place_in_blocks(&shell->blocks, x + dx, y + dy, z + dz);
                if (place >= 0 && seen[place] == SEEN_FROM_CORE)
                    return true;
            }
    return false;
}

/* The signed field at the points of blocks start to stop - 1, negative in the solid, and which of
   the points belong to a sheet. */
EXPORT void sign_shell(
    int64_t n_slots, int64_t nx, int64_t ny, int64_t nz, int64_t width, int64_t height,
    int64_t depth, const int32_t slots[nx][ny][nz], const int32_t corners[n_slots][3],
    const float distances[n_slots][512], const uint8_t labels[width][height][depth],
    const uint8_t seen[n_slots][512], float field[n_slots][512], bool thin[n_slots][512],
    double thickness, int64_t start, int64_t stop)
{
    const struct shell shell = {
        {ny, nz, &slots[0][0][0]}, {width, height, depth}, &labels[0][0][0], &distances[0][0]};
    for (int64_t slot = start; slot < stop; slot++)
        for (int64_t k = 0; k < BLOCK_POINTS; k++) {
            const int64_t x = corners[slot][0] + (k >> 6), y = corners[slot][1] + (k >> 3 & 7);
            const int64_t z = corners[slot][2] + (k & 7);
            const uint8_t label = label_at(&shell, x, y, z), sides = seen[slot][k];
            const float distance = distances[slot][k];
            thin[slot][k] = false;
            if (label == OUTSIDE || label == CORE) {
                field[slot][k] = label == OUTSIDE ? distance : -distance;
            } else if (sides == SEEN_FROM_CORE) {
                field[slot][k] = -distance;
            } else if (
                sides != (SEEN_FROM_OUTSIDE | SEEN_FROM_CORE)
                && has_core_near(&shell, &seen[0][0], x, y, z)) {
                field[slot][k] = sides == SEEN_FROM_OUTSIDE ? distance : -distance;
            } else {
                field[slot][k] = distance - (float)thickness;
                thin[slot][k] = true;
            }
        }
}
