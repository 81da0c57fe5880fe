/* The points of a grid that can be reached from one of them through those that are not blocked; and
   the points within a distance of the marked ones, exactly, axis by axis.

   Based on: Alvy Ray Smith, "Tint Fill", SIGGRAPH 1979: whole runs of a row at a time; Meijster,
   Roerdink and Hesselink, "A General Algorithm for Computing Distance Transforms in Linear Time", 2000.
   Departs from the latter in that the later axes are searched in a window of the radius, which
   vectorizes.

   Called from texbake/mesh/remeshing/solid.py. */

#include <stdbool.h>
#include <stdlib.h>
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

/* Steps along a row to the nearest marked point, `cap` where it is that far or farther; whether
   there is one in the row. */
static bool measure_row(int64_t n, const uint8_t *labels, uint8_t label, uint8_t cap, uint8_t *steps)
{
    if (memchr(labels, label, (size_t)n) == NULL)
        return false;
    uint8_t count = cap;
    for (int64_t k = 0; k < n; k++) {
        count = labels[k] == label ? 0 : count < cap ? (uint8_t)(count + 1) : cap;
        steps[k] = count;
    }
    count = cap;
    for (int64_t k = n - 1; k >= 0; k--) {
        count = steps[k] == 0 ? 0 : count < cap ? (uint8_t)(count + 1) : cap;
        if (count < steps[k])
            steps[k] = count;
    }
    return true;
}

/* Squared distances within planes start to stop - 1 to the nearest point with a label; where it is
   farther than the radius, a square beyond the radius's. */
EXPORT int64_t measure_planes(
    int64_t nx, int64_t ny, int64_t nz, const uint8_t labels[nx][ny][nz],
    uint16_t squares[nx][ny][nz], int64_t label, int64_t radius, int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    uint8_t *steps = TAKE(arena, uint8_t, ny * nz);
    bool *is_marked = TAKE(arena, bool, ny);
    const uint16_t beyond = (uint16_t)((radius + 1) * (radius + 1));
    for (int64_t x = start; x < stop; x++) {
        for (int64_t y = 0; y < ny; y++)
            is_marked[y] = measure_row(
                nz, labels[x][y], (uint8_t)label, (uint8_t)(radius + 1), steps + y * nz);
        for (int64_t y = 0; y < ny; y++) {
            uint16_t *row = squares[x][y];
            for (int64_t z = 0; z < nz; z++)
                row[z] = beyond;
            const int64_t first = max_i64(y - radius, 0), last = min_i64(y + radius, ny - 1);
            for (int64_t other = first; other <= last; other++) {
                if (!is_marked[other])
                    continue;
                const uint8_t *near = steps + other * nz;
                const uint16_t across = (uint16_t)((other - y) * (other - y));
                for (int64_t z = 0; z < nz; z++) {
                    const uint16_t square = (uint16_t)(near[z] * near[z] + across);
                    row[z] = square < row[z] ? square : row[z];
                }
            }
        }
    }
    close_arena(arena);
    return 0;
}

/* Whether points of planes start to stop - 1 lie within the radius, whose square is given. */
EXPORT void reach_planes(
    int64_t nx, int64_t ny, int64_t nz, const uint16_t squares[nx][ny][nz],
    bool reached[nx][ny][nz], int64_t radius, int64_t radius_squared, int64_t start, int64_t stop)
{
    for (int64_t x = start; x < stop; x++)
        for (int64_t y = 0; y < ny; y++) {
            bool *row = reached[x][y];
            memset(row, 0, (size_t)nz * sizeof *row);
            for (int64_t d = -radius; d <= radius; d++) {
                const int64_t other = x + d, left = radius_squared - d * d;
                if (other < 0 || other >= nx || left < 0)
                    continue;
                const uint16_t *near = squares[other][y], most = (uint16_t)left;
                for (int64_t z = 0; z < nz; z++)
                    row[z] |= near[z] <= most;
            }
        }
}
