/* Carves a solid down to a smaller one inside it, from outside, without opening a tunnel.

   A point is removed if the outside points next to it are connected around it, so that removing it
   joins no two parts of the outside: a wall one point thick stays between them. A handle may be cut
   and a part may split; the topology does not change otherwise.

   Based on: Andrzej Szymczak, James Vanderhyde, "Extraction of Topologically Simple Isosurfaces from
   Volume Datasets", IEEE Visualization 2003; Gilles Bertrand, Grégoire Malandain, "A new
   characterization of three-dimensional simple points", Pattern Recognition Letters 15, 1994. Departs
   from them in that handles may be cut.

   Called from texbake/mesh/wrapping.py. */

#include <stdbool.h>
#include <string.h>

#include "arena.h"
#include "core.h"
#include "voxel_grid.h"

/* Whether the points outside among the six neighbors of a point are joined by those at its edges. */
static bool is_outside_joined(const bool *solid, const int64_t steps[6])
{
    unsigned outside = 0, reached = 0;
    for (int side = 0; side < 6; side++)
        outside |= (unsigned)!solid[steps[side]] << side;
    if (outside == 0)
        return false;
    reached = outside & -outside;
    for (unsigned before = 0; before != reached;) {
        before = reached;
        for (int a = 0; a < 6; a++)
            for (int b = 0; b < 6; b++)
                if ((reached >> a & 1) && (outside >> b & 1) && a / 2 != b / 2
                    && !solid[steps[a] + steps[b]])
                    reached |= 1u << b;
    }
    return reached == outside;
}

/* Remove points of the solid that are not kept, at most so many steps from outside; return how many.
   No point at the border of the grid is solid. */
EXPORT int64_t carve_tunnels(
    int64_t nx, int64_t ny, int64_t nz, const bool kept[nx][ny][nz], bool solid[nx][ny][nz],
    int64_t most_steps)
{
    OPEN_ARENA(arena);
    bool *is_solid = &solid[0][0][0];
    const bool *stays = &kept[0][0][0];
    const int64_t steps[6] = {-ny * nz, ny * nz, -nz, nz, -1, 1};
    uint8_t *waits = TAKE_ZEROS(arena, uint8_t, nx * ny * nz);
    struct places lists[2] = {new_places(arena), new_places(arena)};
    int64_t n_gone = 0;
    for (int64_t x = 1; x < nx - 1; x++)
        for (int64_t y = 1; y < ny - 1; y++)
            for (int64_t z = 1; z < nz - 1; z++) {
                const int64_t place = (x * ny + y) * nz + z;
                bool is_reached = false;
                for (int side = 0; side < 6 && is_solid[place] && !stays[place]; side++)
                    is_reached = is_reached || !is_solid[place + steps[side]];
                if (is_reached) {
                    add_place(&lists[0], place);
                    waits[place] = true;
                }
            }
    for (int64_t step = 0; step < most_steps && lists[step & 1].count > 0; step++) {
        struct places *now = &lists[step & 1], *next = &lists[1 - (step & 1)];
        for (int64_t i = 0; i < now->count; i++) {
            const int64_t place = now->items[i];
            waits[place] = false;
            if (!is_outside_joined(is_solid + place, steps))
                continue;
            is_solid[place] = false;
            n_gone++;
            for (int64_t dx = -1; dx <= 1; dx++)
                for (int64_t dy = -1; dy <= 1; dy++)
                    for (int64_t dz = -1; dz <= 1; dz++) {
                        const int64_t near = place + (dx * ny + dy) * nz + dz;
                        if (!is_solid[near] || stays[near] || waits[near])
                            continue;
                        waits[near] = true;
                        add_place(next, near);
                    }
        }
        now->count = 0;
    }
    close_arena(arena);
    return n_gone;
}
