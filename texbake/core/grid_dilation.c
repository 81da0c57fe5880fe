/* The points of a grid within a distance of the marked ones, exactly, axis by axis.

   Based on: Meijster, Roerdink and Hesselink, "A General Algorithm for Computing Distance Transforms
   in Linear Time", 2000. Departs from it in that the later axes are searched in a window of the
   radius, which vectorizes.

   Called from texbake/mesh/remeshing/solid.py. */

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"

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
