/* The points of a grid that can be reached from one of them through those that are not blocked.

   Based on: Alvy Ray Smith, "Tint Fill", SIGGRAPH 1979: whole runs of a row at a time.

   Called from texbake/mesh/remeshing/solid.py. */

#include <stdbool.h>
#include <string.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"
#include "voxel_grid.h"

/* Add a seed for each run of free points from `first` to `last` of a row. */
static void add_runs(
    struct places *seeds, const bool *blocked, const uint8_t *labels, uint8_t label, int64_t first,
    int64_t last)
{
    bool in_run = false;
    for (int64_t place = first; place <= last; place++) {
        const bool is_free = !blocked[place] && labels[place] != label;
        if (is_free && !in_run)
            add_place(seeds, place);
        in_run = is_free;
    }
}

/* Give a label to what is reached from a point, none of which has the label yet; return how many
   points that is. */
EXPORT int64_t flood_room(
    int64_t nx, int64_t ny, int64_t nz, const bool blocked[nx][ny][nz], uint8_t labels[nx][ny][nz],
    int64_t start, int64_t label)
{
    OPEN_ARENA(arena);
    struct places seeds = new_places(arena);
    const bool *walls = &blocked[0][0][0];
    const uint8_t mark = (uint8_t)label;
    int64_t n_points = 0;
    uint8_t *found = &labels[0][0][0];
    add_runs(&seeds, walls, found, mark, start, start);
    while (seeds.count > 0) {
        const int64_t place = seeds.items[--seeds.count];
        if (found[place] == mark)
            continue;
        const int64_t row = place / nz, x = row / ny, y = row % ny;
        int64_t first = place, last = place;
        while (first > row * nz && !walls[first - 1])
            first--;
        while (last < row * nz + nz - 1 && !walls[last + 1])
            last++;
        memset(found + first, mark, (size_t)(last - first + 1));
        n_points += last - first + 1;
        if (x > 0)
            add_runs(&seeds, walls, found, mark, first - ny * nz, last - ny * nz);
        if (x < nx - 1)
            add_runs(&seeds, walls, found, mark, first + ny * nz, last + ny * nz);
        if (y > 0)
            add_runs(&seeds, walls, found, mark, first - nz, last - nz);
        if (y < ny - 1)
            add_runs(&seeds, walls, found, mark, first + nz, last + nz);
    }
    close_arena(arena);
    return n_points;
}

/* The first free point from a place on that no flood has reached; the number of points if none. */
EXPORT int64_t next_room(
    int64_t nx, int64_t ny, int64_t nz, const bool blocked[nx][ny][nz],
    const uint8_t labels[nx][ny][nz], int64_t start)
{
    const bool *walls = &blocked[0][0][0];
    const uint8_t *found = &labels[0][0][0];
    int64_t place = start;
    while (place < nx * ny * nz && (walls[place] || found[place] != CORE))
        place++;
    return place;
}
