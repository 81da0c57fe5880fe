/* Rasterizing triangles of a texture with integer edge functions: which face owns each sample.

   Based on: Pineda, "A Parallel Algorithm for Polygon Rasterization", 1988. Departs from it by
   solving each edge function for its span of a row, exactly, instead of testing every sample.

   Called from texbake/baking/texels.py. */

#include "core.h"
#include "edge_functions.h"
#include "numbers.h"

/* Narrow the span of a row at height y to the samples inside an edge. */
static void narrow_span(
    const int64_t *p, const int64_t *q, int64_t y, int64_t *left, int64_t *right)
{
    const int64_t dx = q[0] - p[0], dy = q[1] - p[1];
    /* Inside where dx (y - py) - dy (x - px) > 0, or = 0 on a top or left edge. */
    const int64_t limit = dy < 0 || (dy == 0 && dx > 0) ? 0 : 1;
    const int64_t rest = dx * (y - p[1]) + dy * (p[0] - UNIT / 2) - limit;
    /* rest - dy * UNIT * column >= 0, solved for the column. */
    if (dy > 0)
        *right = min_i64(*right, floor_div(rest, dy * UNIT));
    else if (dy < 0)
        *left = max_i64(*left, -floor_div(rest, -dy * UNIT));
    else if (rest < 0)
        *right = -1;
}

/* Fill rows start to stop of the grid; `owners` and `overlapped` begin at row start. */
EXPORT void rasterize_uvs(
    int64_t n_faces, int64_t n_rows, int64_t n_columns, const int64_t corners[n_faces][3][2],
    const int32_t first_rows[n_faces], const int32_t last_rows[n_faces], int64_t start,
    int64_t stop, int32_t owners[n_rows][n_columns], bool overlapped[n_rows][n_columns])
{
    for (int64_t face = 0; face < n_faces; face++) {
        const int64_t first = max_i64(first_rows[face], start);
        const int64_t last = min_i64(last_rows[face], stop - 1);
        if (last < first)
            continue;
        const int64_t *a = corners[face][0], *b = corners[face][1], *c = corners[face][2];
        if ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) < 0) {
            const int64_t *kept = b;
            b = c;
            c = kept;
        }
        for (int64_t row = first; row <= last; row++) {
            const int64_t y = row * UNIT + UNIT / 2;
            int64_t left = 0, right = n_columns - 1;
            narrow_span(a, b, y, &left, &right);
            narrow_span(b, c, y, &left, &right);
            narrow_span(c, a, y, &left, &right);
            int32_t *owned = owners[row - start];
            for (int64_t column = left; column <= right; column++) {
                if (owned[column] == NO_FACE)
                    owned[column] = (int32_t)face;
                else
                    overlapped[row - start][column] = true;
            }
        }
    }
}

/* List the samples of one row of tiles, squares of `side` samples, which begins at line `first_line`
   of `owners`; from place `at` on. */
EXPORT void list_tiles(
    int64_t n_lines, int64_t n_columns, int64_t n_faces, int64_t n,
    const int32_t owners[n_lines][n_columns], const int64_t corners[n_faces][3][2],
    int64_t side, int64_t first_line, int64_t first_row, int64_t per_side, int64_t at,
    int32_t texel_ids[n], int32_t faces[n], double barycentrics[n][2])
{
    const int64_t width = n_columns / per_side;
    const int64_t stop_line = min_i64(first_line + side, n_lines);
    for (int64_t tile = 0; tile < n_columns; tile += side) {
        const int64_t stop_column = min_i64(tile + side, n_columns);
        for (int64_t line = first_line; line < stop_line; line++) {
            const int64_t row = first_row + line;
            for (int64_t column = tile; column < stop_column; column++) {
                const int32_t face = owners[line][column];
                if (face == NO_FACE)
                    continue;
                texel_ids[at] = (int32_t)(row / per_side * width + column / per_side);
                faces[at] = face;
                const int64_t x = column * UNIT + UNIT / 2, y = row * UNIT + UNIT / 2;
                write_point_weights(corners[face], x, y, barycentrics[at]);
                at++;
            }
        }
    }
}
