/* Rasterizing triangles into a visibility buffer.

   Two passes, each split into independent bands of work. The first sorts triangles into bands of rows
   and drops those that face away, are off the screen or fall between samples. The second draws each
   band on one thread, in the order of the triangles.

   Coverage is decided with integers: edge functions of grid positions in int64 and the top-left
   rule, so each sample on a shared edge belongs to exactly one of the triangles. The nearest surface
   wins; at equal depth, the triangle with the lower index wins.

   With a layer to peel, only surfaces between two depth layers are drawn.

   Based on: Pineda, "A parallel algorithm for polygon rasterization", SIGGRAPH 1988; Burns and Hunt,
   "The visibility buffer", JCGT 2(2), 2013; Everitt, "Interactive order-independent transparency",
   2001, for peeling. Unlike Pineda, the first and last sample of a row of a wide triangle are
   computed by division instead of a search.

   Called from texbake/rendering/rasterize.py. */

#include <stdlib.h>

#include "clipping.h"
#include "core.h"
#include "numbers.h"
#include "objects.h"

/* Rows of samples in a band, as in texbake/rendering/rasterize.py. */
enum { BAND_ROWS = 32 };

/* Which faces of an object are drawn, as in texbake/rendering/rasterize.py. */
enum { SKIP, CULL_BACK, SHOW_BACK };

/* Up to this many samples in a row, testing each one is faster than dividing. */
enum { NARROW = 12 };

struct box {
    int64_t left, right, top, bottom;
};

/* What is drawn into, and what is peeled from it; arrays of `width` columns. The first sample of the
   arrays is at column `left` and row `top` of the screen. */
struct target {
    int64_t left, top, width, first_row, stop_row;
    int32_t *face_ids;
    float *depths;
    uint32_t *tries;            /* NULL: not counted */
    const float *layer_depths;  /* NULL: nothing is peeled */
    const int32_t *layer_faces;
    const float *last_depths;
};

/* The first sample whose center is at a place of the grid or after it, and the last one up to it. */
static inline int64_t first_sample(int64_t place)
{
    return (place + HALF_SAMPLE - 1) >> SUBPIXEL_BITS;
}

static inline int64_t last_sample(int64_t place)
{
    return (place - HALF_SAMPLE) >> SUBPIXEL_BITS;
}

/* Sort pass */

/* Bounding box of a triangle with all corners on the grid; false if it is not drawn. */
static bool box_on_grid(
    const int32_t *a, const int32_t *b, const int32_t *c, bool shows_back, struct box *box)
{
    const int64_t ax = a[0], ay = a[1], bx = b[0], by = b[1], cx = c[0], cy = c[1];
    const int64_t area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
    if (area == 0 || (area > 0 && !shows_back))
        return false;
    box->left = min_i64(min_i64(ax, bx), cx);
    box->right = max_i64(max_i64(ax, bx), cx);
    box->top = min_i64(min_i64(ay, by), cy);
    box->bottom = max_i64(max_i64(ay, by), cy);
    return true;
}

static bool box_of_clipped(const struct clipped_triangle *clipped, struct box *box)
{
    if (clipped->n_corners < 3)
        return false;
    const int64_t (*points)[2] = clipped->points;
    *box = (struct box){points[0][0], points[0][0], points[0][1], points[0][1]};
    for (int64_t i = 1; i < clipped->n_corners; i++) {
        box->left = min_i64(box->left, points[i][0]);
        box->right = max_i64(box->right, points[i][0]);
        box->top = min_i64(box->top, points[i][1]);
        box->bottom = max_i64(box->bottom, points[i][1]);
    }
    return true;
}

/* Find the triangles from `start` to `stop` that may cover a sample of a part of the screen, and the
   bands of the part that each spans. Writes from `start` on; adds to the count of each band; returns
   how many there are. */
EXPORT int64_t sort_triangles(
    int64_t n_vertices, int64_t n_faces, int64_t n_objects, int64_t n_bands,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int64_t starts[n_objects + 1], const uint8_t modes[n_objects],
    const double matrix[4][4], const int32_t grid[n_vertices][2], int64_t width, int64_t height,
    int64_t left, int64_t top, int64_t n_columns, int64_t n_rows, int32_t survivors[n_faces],
    int16_t spans[n_faces][2], int64_t counts[n_bands], int64_t start, int64_t stop)
{
    int64_t n_survivors = 0;
    int64_t owner = object_of(start, n_objects, starts);
    for (int64_t face = start; face < stop; face++) {
        while (face >= starts[owner + 1])
            owner++;
        if (modes[owner] == SKIP)
            continue;
        const int32_t *a = grid[faces[face][0]], *b = grid[faces[face][1]];
        const int32_t *c = grid[faces[face][2]];
        struct box box;
        if (a[0] != OFF_GRID && b[0] != OFF_GRID && c[0] != OFF_GRID) {
            if (!box_on_grid(a, b, c, modes[owner] == SHOW_BACK, &box))
                continue;
        } else {
            struct clipped_triangle clipped;
            clip_triangle(positions, faces[face], matrix, width, height, &clipped);
            if (!box_of_clipped(&clipped, &box))
                continue;
        }
        /* Samples within the bounding box; most tiny triangles contain none. */
        const int64_t first = max_i64(first_sample(box.left) - left, 0);
        const int64_t last = min_i64(last_sample(box.right) - left, n_columns - 1);
        const int64_t first_row = max_i64(first_sample(box.top) - top, 0);
        const int64_t last_row = min_i64(last_sample(box.bottom) - top, n_rows - 1);
        if (first > last || first_row > last_row)
            continue;
        const int64_t first_band = first_row / BAND_ROWS, last_band = last_row / BAND_ROWS;
        survivors[start + n_survivors] = (int32_t)face;
        spans[start + n_survivors][0] = (int16_t)first_band;
        spans[start + n_survivors][1] = (int16_t)last_band;
        n_survivors++;
        for (int64_t band = first_band; band <= last_band; band++)
            counts[band]++;
    }
    return n_survivors;
}

/* Write triangles to the places of their bands. */
EXPORT void scatter_triangles(
    int64_t n, int64_t n_bands, int64_t n_places, const int32_t survivors[n],
    const int16_t spans[n][2], int64_t next_places[n_bands], int32_t sorted_faces[n_places])
{
    for (int64_t i = 0; i < n; i++)
        for (int64_t band = spans[i][0]; band <= spans[i][1]; band++)
            sorted_faces[next_places[band]++] = survivors[i];
}

/* Draw pass */

/* Twice the area of triangle i of a fan, in grid units squared; negative if front-facing. */
static int64_t doubled_area(const int64_t (*points)[2], int64_t i)
{
    const int64_t along_x = points[i + 1][0] - points[0][0];
    const int64_t along_y = points[i + 1][1] - points[0][1];
    return along_x * (points[i + 2][1] - points[0][1]) - along_y * (points[i + 2][0] - points[0][0]);
}

/* Narrow first..last to the k for which value + k * step is at least `least`. */
static void narrow_range(int64_t value, int64_t step, int64_t least, int64_t *first, int64_t *last)
{
    if (step > 0)
        *first = max_i64(*first, -floor_div(value - least, step));
    else if (step < 0)
        *last = min_i64(*last, floor_div(value - least, -step));
    else if (value < least)
        *last = *first - 1;
}

/* Whether a point lies on or before the layer already peeled, or behind the last surface. */
static bool is_peeled(const struct target *target, int64_t at, float depth, int64_t face)
{
    const float layer = target->layer_depths[at];
    if (depth > layer || (depth == layer && face <= target->layer_faces[at]))
        return true;
    return depth <= target->last_depths[at];
}

static inline void draw_sample(const struct target *target, int64_t at, float depth, int64_t face)
{
    if (target->tries)
        target->tries[at]++;
    if (depth > target->depths[at]) {
        if (target->layer_depths && is_peeled(target, at, depth, face))
            return;
        target->depths[at] = depth;
        target->face_ids[at] = (int32_t)face;
    }
}

/* One edge of a triangle: its function is 0 on the edge, and grows towards the corner opposite. */
struct edge {
    int64_t px, py, dx, dy; /* a corner on it, and the way to the next */
    int64_t least;          /* value from which on a sample is inside */
    int64_t step;           /* growth from a sample to the next */
    double depth;           /* of the corner opposite */
};

/* By the top-left rule a sample on a left edge (going up) or a top edge (going right) is inside. */
static struct edge make_edge(const int64_t *from, const int64_t *to, float depth)
{
    const int64_t dx = to[0] - from[0], dy = to[1] - from[1];
    const int64_t least = dy < 0 || (dy == 0 && dx > 0) ? 0 : 1;
    return (struct edge){from[0], from[1], dx, dy, least, -dy * SUBPIXELS, depth};
}

static void draw_row(
    const struct target *target, const struct edge *edges, int64_t x, int64_t y, int64_t first,
    int64_t last, int64_t at, double scale, int64_t face)
{
    const struct edge *a = edges, *b = edges + 1, *c = edges + 2;
    int64_t value_a = a->dx * (y - a->py) - a->dy * (x - a->px);
    int64_t value_b = b->dx * (y - b->py) - b->dy * (x - b->px);
    int64_t value_c = c->dx * (y - c->py) - c->dy * (x - c->px);
    const bool is_wide = last >= NARROW;
    if (is_wide) {
        narrow_range(value_a, a->step, a->least, &first, &last);
        narrow_range(value_b, b->step, b->least, &first, &last);
        narrow_range(value_c, c->step, c->least, &first, &last);
        value_a += first * a->step;
        value_b += first * b->step;
        value_c += first * c->step;
    }
    for (int64_t k = first; k <= last; k++) {
        if (is_wide || (value_a >= a->least && value_b >= b->least && value_c >= c->least)) {
            /* z / w is linear on the screen; a weighted mean stays within the corners' range. */
            const double sum = value_a * a->depth + value_b * b->depth + value_c * c->depth;
            draw_sample(target, at + k, (float)(sum * scale), face);
        }
        value_a += a->step;
        value_b += b->step;
        value_c += c->step;
    }
}

/* Draw triangle i of a fan (corners 0, i + 1 and i + 2). */
static void draw_triangle(
    const struct target *target, const struct clipped_triangle *fan, int64_t i, int64_t face,
    bool shows_back)
{
    const int64_t (*points)[2] = fan->points;
    const int64_t area = doubled_area(points, i);
    if (area == 0 || (area > 0 && !shows_back))
        return;
    /* Order the corners so that the area is positive: clockwise on the screen, as rows go down. */
    const int64_t b = area > 0 ? i + 1 : i + 2, c = area > 0 ? i + 2 : i + 1;
    const int64_t *p0 = points[0], *p1 = points[b], *p2 = points[c];
    const int64_t least_x = min_i64(min_i64(p0[0], p1[0]), p2[0]);
    const int64_t most_x = max_i64(max_i64(p0[0], p1[0]), p2[0]);
    const int64_t least_y = min_i64(min_i64(p0[1], p1[1]), p2[1]);
    const int64_t most_y = max_i64(max_i64(p0[1], p1[1]), p2[1]);
    const int64_t left = max_i64(first_sample(least_x) - target->left, 0);
    const int64_t right = min_i64(last_sample(most_x) - target->left, target->width - 1);
    const int64_t top = max_i64(first_sample(least_y) - target->top, target->first_row);
    const int64_t bottom = min_i64(last_sample(most_y) - target->top, target->stop_row - 1);
    const struct edge edges[3] = {
        make_edge(p1, p2, fan->depths[0]), make_edge(p2, p0, fan->depths[b]),
        make_edge(p0, p1, fan->depths[c])};
    const double scale = 1.0 / llabs(area);
    const int64_t x = (target->left + left) * SUBPIXELS + HALF_SAMPLE;
    for (int64_t row = top; row <= bottom; row++)
        draw_row(
            target, edges, x, (target->top + row) * SUBPIXELS + HALF_SAMPLE, 0, right - left,
            row * target->width + left, scale, face);
}

/* Draw the triangles of a band of rows of a part of the screen. With a layer, only what lies behind it (or at the same depth
   with a higher index) and in front of the last depths is drawn. */
EXPORT void draw_triangles(
    int64_t n_vertices, int64_t n_faces, int64_t n_objects, int64_t n_in_band, int64_t n_rows,
    int64_t n_columns, const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int64_t starts[n_objects + 1], const uint8_t modes[n_objects],
    const double matrix[4][4], const int32_t grid[n_vertices][2], const float depths[n_vertices],
    int64_t width, int64_t height, int64_t left, int64_t top, const int32_t in_band[n_in_band],
    int64_t first_row, int64_t stop_row, OPTIONAL const float layer_depths[n_rows][n_columns],
    OPTIONAL const int32_t layer_faces[n_rows][n_columns],
    OPTIONAL const float last_depths[n_rows][n_columns],
    OPTIONAL uint32_t tries[n_rows][n_columns], int32_t face_ids[n_rows][n_columns],
    float depth_buffer[n_rows][n_columns])
{
    const struct target target = {
        left, top, n_columns, first_row, stop_row, face_ids[0], depth_buffer[0], (uint32_t *)tries,
        (const float *)layer_depths, (const int32_t *)layer_faces, (const float *)last_depths};
    struct clipped_triangle fan;
    for (int64_t k = 0; k < n_in_band; k++) {
        const int64_t face = in_band[k];
        bool shows_back = true; /* culled faces were dropped when sorting */
        fan.n_corners = 3;
        for (int i = 0; i < 3; i++) {
            const int32_t v = faces[face][i];
            fan.points[i][0] = grid[v][0];
            fan.points[i][1] = grid[v][1];
            fan.depths[i] = depths[v];
            if (grid[v][0] == OFF_GRID)
                fan.n_corners = 0;
        }
        if (fan.n_corners == 0) {
            shows_back = modes[object_of(face, n_objects, starts)] == SHOW_BACK;
            clip_triangle(positions, faces[face], matrix, width, height, &fan);
        }
        for (int64_t i = 0; i + 2 < fan.n_corners; i++)
            draw_triangle(&target, &fan, i, face, shows_back);
    }
}
