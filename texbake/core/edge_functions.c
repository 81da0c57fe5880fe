/* How much of a texel the low-poly mesh covers, and which of its faces owns a point of the map.

   Coverage is decided with integers on a fixed-point grid, by the edge functions of each face and
   the top-left rule, so that neighboring faces own every point exactly once.

   Based on: Pineda, "A Parallel Algorithm for Polygon Rasterization", SIGGRAPH 1988.

   Called from texbake/baking/adaptive_texels/coverage.py. */

#include "edge_functions.h"

#include <math.h>

#include "core.h"
#include "numbers.h"

static const int64_t SLACK = 2; /* units by which a line is widened, against rounding */

struct rectangle {
    int64_t left, top, right, bottom;
};

static struct rectangle bounds_of(const struct triangle *t)
{
    return (struct rectangle){
        min_i64(min_i64(t->ax, t->bx), t->cx), min_i64(min_i64(t->ay, t->by), t->cy),
        max_i64(max_i64(t->ax, t->bx), t->cx), max_i64(max_i64(t->ay, t->by), t->cy)};
}

/* Whether a square of a bin's size lies wholly on the outer side of an edge. */
static bool is_beyond(int64_t px, int64_t py, int64_t qx, int64_t qy, int64_t x, int64_t y)
{
    const int64_t dx = qx - px, dy = qy - py, side = BIN * TEXEL;
    const int64_t innermost_x = dy > 0 ? x : x + side, innermost_y = dx > 0 ? y + side : y;
    return dx * (innermost_y - py) - dy * (innermost_x - px) < 0;
}

/* Count the faces of each bin in `firsts`, or list them in `faces` from these places on. */
EXPORT void bin_faces(
    int64_t n_faces, int64_t n_listed, const int64_t corners[n_faces][3][2], int64_t n_rows,
    int64_t n_columns, int64_t firsts[n_rows * n_columns + 1], OPTIONAL int32_t faces[n_listed])
{
    const int64_t side = BIN * TEXEL;
    for (int64_t face = 0; face < n_faces; face++) {
        if (doubled_area(corners[face]) == 0)
            continue;
        const struct triangle t = oriented(corners[face]);
        const struct rectangle box = bounds_of(&t);
        const int64_t top = max_i64(floor_div(box.top, side), 0);
        const int64_t bottom = min_i64(floor_div(box.bottom, side), n_rows - 1);
        const int64_t left = max_i64(floor_div(box.left, side), 0);
        const int64_t right = min_i64(floor_div(box.right, side), n_columns - 1);
        for (int64_t row = top; row <= bottom; row++) {
            for (int64_t column = left; column <= right; column++) {
                const int64_t x = column * side, y = row * side;
                if (is_beyond(t.ax, t.ay, t.bx, t.by, x, y)
                    || is_beyond(t.bx, t.by, t.cx, t.cy, x, y)
                    || is_beyond(t.cx, t.cy, t.ax, t.ay, x, y))
                    continue;
                int64_t *first = &firsts[row * n_columns + column];
                if (faces)
                    faces[*first] = (int32_t)face;
                ++*first;
            }
        }
    }
}

/* The sub-squares of a texel whose centers a face covers, one bit each. */
static uint64_t covered_mask(const int64_t corners[3][2], int64_t left, int64_t top)
{
    const struct triangle t = oriented(corners);
    const struct rectangle box = bounds_of(&t);
    if (box.right < left || box.left > left + TEXEL || box.bottom < top || box.top > top + TEXEL)
        return 0;
    const int64_t x = left + UNIT / 2, y = top + UNIT / 2;
    const int64_t a = edge_side(t.ax, t.ay, t.bx, t.by, x, y);
    const int64_t b = edge_side(t.bx, t.by, t.cx, t.cy, x, y);
    const int64_t c = edge_side(t.cx, t.cy, t.ax, t.ay, x, y);
    uint64_t mask = 0;
    for (int row = 0; row < FINE; row++) {
        for (int column = 0; column < FINE; column++) {
            /* Each is positive on the inner side. */
            const int64_t across = column * UNIT, down = row * UNIT;
            const bool is_covered = a + (t.bx - t.ax) * down - (t.by - t.ay) * across > 0
                                 && b + (t.cx - t.bx) * down - (t.cy - t.by) * across > 0
                                 && c + (t.ax - t.cx) * down - (t.ay - t.cy) * across > 0;
            mask |= (uint64_t)is_covered << (FINE * row + column);
        }
    }
    return mask;
}

/* Write which sub-squares of some texels are covered, and how many. The texels and their owners,
   counts and masks begin at the row `first_row` of the map. */
EXPORT void write_masks(
    int64_t n_faces, int64_t n_bins, int64_t n_listed, int64_t n, int64_t n_texels,
    const int64_t corners[n_faces][3][2], const int64_t firsts[n_bins + 1],
    const int32_t faces[n_listed], int64_t n_columns, int64_t first_row, int64_t width,
    const int64_t texels[n], const int32_t owners[n_texels], uint8_t counts[n_texels],
    int64_t masks[n_texels])
{
    for (int64_t i = 0; i < n; i++) {
        const int64_t texel = texels[i];
        const int64_t column = texel % width, row = first_row + texel / width;
        const int64_t bin = row / BIN * n_columns + column / BIN;
        uint64_t mask = 0;
        for (int64_t at = firsts[bin]; at < firsts[bin + 1]; at++)
            mask |= covered_mask(corners[faces[at]], column * TEXEL, row * TEXEL);
        int count = 0;
        for (uint64_t rest = mask; rest; rest &= rest - 1)
            count++;
        counts[texel] = count > 0 || owners[texel] == NO_FACE ? (uint8_t)count : 1;
        masks[texel] = (int64_t)mask;
    }
}

/* Mark the texels that lines pass through. */
EXPORT void mark_lines(
    int64_t n, int64_t height, int64_t width, const int64_t edges[n][2][2],
    bool marked[height][width])
{
    for (int64_t i = 0; i < n; i++) {
        const int upper = edges[i][0][1] > edges[i][1][1];
        const int64_t ax = edges[i][upper][0], ay = edges[i][upper][1];
        const int64_t bx = edges[i][1 - upper][0], by = edges[i][1 - upper][1];
        const int64_t first = max_i64(floor_div(ay - SLACK, TEXEL), 0);
        const int64_t last = min_i64(floor_div(by + SLACK, TEXEL), height - 1);
        for (int64_t row = first; row <= last; row++) {
            int64_t left = min_i64(ax, bx), right = max_i64(ax, bx);
            if (by > ay) {
                /* Where the line enters and leaves the row. */
                const double slope = (double)(bx - ax) / (double)(by - ay);
                const int64_t above = max_i64(row * TEXEL, ay) - ay;
                const int64_t below = min_i64((row + 1) * TEXEL, by) - ay;
                const double enters = (double)ax + slope * (double)above;
                const double leaves = (double)ax + slope * (double)below;
                left = max_i64(left, (int64_t)floor(min_f64(enters, leaves)));
                right = min_i64(right, (int64_t)ceil(max_f64(enters, leaves)));
            }
            const int64_t begin = max_i64(floor_div(left - SLACK, TEXEL), 0);
            const int64_t end = min_i64(floor_div(right + SLACK, TEXEL), width - 1);
            for (int64_t column = begin; column <= end; column++)
                marked[row][column] = true;
        }
    }
}

/* Write the face that owns each point of the map, in units, and where on it the point lies. */
EXPORT void find_owners(
    int64_t n_faces, int64_t n_bins, int64_t n_listed, int64_t n,
    const int64_t corners[n_faces][3][2], const int64_t firsts[n_bins + 1],
    const int32_t faces[n_listed], int64_t n_columns, const int64_t points[n][2],
    int32_t owners[n], double weights[n][2])
{
    const struct face_bins bins = {corners, firsts, faces, n_columns};
    for (int64_t i = 0; i < n; i++) {
        const int64_t x = points[i][0], y = points[i][1];
        owners[i] = owner_at(&bins, x, y);
        if (owners[i] != NO_FACE)
            write_point_weights(corners[owners[i]], x, y, weights[i]);
    }
}
