/* The classical scanline rasterizer: walk down the edges row by row, then along each row.

   All values are updated incrementally: the two edges from row to row, the values on a row from
   sample to sample. Edge positions are integers over the edge's height, so coverage is exact and the
   same as in visibility_buffer.c.

   The values are depth and the three corner weights divided by w, which are linear on the screen up
   to a common factor. Dividing by their sum at each sample makes the interpolation correct in
   perspective. Rounding errors accumulate along a span.

   Based on: Wylie, Romney, Evans and Erdahl, "Half-tone perspective drawings by computer", 1967;
   Blinn, "Hyperbolic interpolation", IEEE Computer Graphics and Applications 12(4), 1992; Hecker,
   "Perspective texture mapping", 1995.

   Called from texbake/rendering/rasterize.py. */

#include "clipping.h"
#include "core.h"
#include "numbers.h"

/* Which faces of an object are drawn, as in texbake/rendering/rasterize.py. */
enum { SKIP, CULL_BACK, SHOW_BACK };

/* Values that are updated incrementally: three corner weights before division, and depth. */
enum { N_VALUES = 4 };

/* Corners of a clipped triangle, a fan, with the values there. */
struct fan {
    struct clipped_triangle corners;
    double values[MAX_CORNERS][N_VALUES];
};

/* Where an edge meets a row of samples. */
struct side {
    int64_t x, step, height; /* column times the edge's height, in grid units, and its growth */
    double values[N_VALUES], growth[N_VALUES];
};

struct target {
    int64_t height, width;
    int32_t *face_ids;
    float *depths;
    double (*weights)[2];
};

static void value_corners(struct fan *fan, const double (*edges)[3])
{
    for (int64_t i = 0; i < fan->corners.n_corners; i++) {
        const double x = (double)fan->corners.points[i][0] / SUBPIXELS;
        const double y = (double)fan->corners.points[i][1] / SUBPIXELS;
        for (int k = 0; k < 3; k++)
            fan->values[i][k] = edges[k][0] * x + edges[k][1] * y + edges[k][2];
        fan->values[i][3] = fan->corners.depths[i];
    }
}

/* Start an edge of a fan at a row of samples. */
static struct side start_side(const struct fan *fan, int64_t top, int64_t bottom, int64_t row)
{
    const int64_t *from = fan->corners.points[top], *to = fan->corners.points[bottom];
    const int64_t tall = to[1] - from[1], across = to[0] - from[0];
    const int64_t down = row * SUBPIXELS + HALF_SAMPLE - from[1];
    struct side side = {.x = from[0] * tall + down * across, .step = SUBPIXELS * across};
    side.height = tall;
    for (int k = 0; k < N_VALUES; k++) {
        const double slope = (fan->values[bottom][k] - fan->values[top][k]) / tall;
        side.values[k] = fan->values[top][k] + down * slope;
        side.growth[k] = SUBPIXELS * slope;
    }
    return side;
}

/* Step an edge down by one row. */
static void step_down(struct side *side)
{
    side->x += side->step;
    for (int k = 0; k < N_VALUES; k++)
        side->values[k] += side->growth[k];
}

/* The first column whose sample lies on or right of an edge. */
static int64_t first_column(const struct side *side)
{
    return -floor_div(HALF_SAMPLE * side->height - side->x, SUBPIXELS * side->height);
}

/* Draw the samples of a row from the left edge (included) to the right edge (excluded). */
static void draw_span(
    const struct target *target, int64_t row, const struct side *left, const struct side *right,
    int64_t face)
{
    const int64_t first = max_i64(first_column(left), 0);
    const int64_t stop = min_i64(first_column(right), target->width);
    if (first >= stop)
        return;
    const double start = (double)left->x / left->height;
    const double wide = (double)right->x / right->height - start;
    double value[N_VALUES], slope[N_VALUES];
    for (int k = 0; k < N_VALUES; k++) {
        const double per_unit = (right->values[k] - left->values[k]) / wide;
        value[k] = left->values[k] + (first * SUBPIXELS + HALF_SAMPLE - start) * per_unit;
        slope[k] = SUBPIXELS * per_unit;
    }
    for (int64_t column = first; column < stop; column++) {
        const int64_t at = row * target->width + column;
        const float depth = (float)value[3];
        if (depth > target->depths[at]) {
            const double total = value[0] + value[1] + value[2];
            target->depths[at] = depth;
            target->face_ids[at] = (int32_t)face;
            target->weights[at][0] = clamp_f64(value[1] / total, 0.0, 1.0);
            target->weights[at][1] = clamp_f64(value[2] / total, 0.0, 1.0);
        }
        for (int k = 0; k < N_VALUES; k++)
            value[k] += slope[k];
    }
}

static void swap(int64_t *a, int64_t *b, int64_t *turn)
{
    const int64_t kept = *a;
    *a = *b;
    *b = kept;
    *turn = -*turn;
}

/* Draw triangle i of a fan (corners 0, i + 1 and i + 2), the upper part first. */
static void draw_triangle(
    const struct target *target, const struct fan *fan, int64_t i, int64_t face, bool shows_back)
{
    const int64_t (*points)[2] = fan->corners.points;
    int64_t top = 0, middle = i + 1, bottom = i + 2;
    int64_t turn =
        (points[middle][0] - points[top][0]) * (points[bottom][1] - points[top][1])
        - (points[middle][1] - points[top][1]) * (points[bottom][0] - points[top][0]);
    if (turn == 0 || (turn > 0 && !shows_back))
        return;
    if (points[middle][1] < points[top][1])
        swap(&top, &middle, &turn);
    if (points[bottom][1] < points[top][1])
        swap(&top, &bottom, &turn);
    if (points[bottom][1] < points[middle][1])
        swap(&middle, &bottom, &turn);
    for (int part = 0; part < 2; part++) {
        const int64_t above = part == 0 ? top : middle, below = part == 0 ? middle : bottom;
        const int64_t first = max_i64(-floor_div(HALF_SAMPLE - points[above][1], SUBPIXELS), 0);
        const int64_t stop =
            min_i64(-floor_div(HALF_SAMPLE - points[below][1], SUBPIXELS), target->height);
        if (first >= stop)
            continue;
        struct side longer = start_side(fan, top, bottom, first);
        struct side shorter = start_side(fan, above, below, first);
        for (int64_t row = first; row < stop; row++) {
            if (turn > 0) /* the middle corner is right of the long edge */
                draw_span(target, row, &longer, &shorter, face);
            else
                draw_span(target, row, &shorter, &longer, face);
            step_down(&longer);
            step_down(&shorter);
        }
    }
}

/* Draw all triangles, with the weights of the second and third corner at each sample. */
EXPORT void draw_scanlines(
    int64_t n_vertices, int64_t n_faces, int64_t n_objects, int64_t height, int64_t width,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int64_t starts[n_objects + 1], const uint8_t modes[n_objects],
    const double matrix[4][4], int32_t face_ids[height][width], float depths[height][width],
    double weights[height][width][2])
{
    const struct target target = {height, width, face_ids[0], depths[0], weights[0]};
    struct fan fan;
    double edges[3][3];
    for (int64_t owner = 0; owner < n_objects; owner++) {
        if (modes[owner] == SKIP)
            continue;
        for (int64_t face = starts[owner]; face < starts[owner + 1]; face++) {
            corner_edges(
                positions, faces[face], matrix, false, 2.0 / width, 2.0 / height, edges);
            clip_triangle(positions, faces[face], matrix, width, height, &fan.corners);
            value_corners(&fan, edges);
            for (int64_t i = 0; i + 2 < fan.corners.n_corners; i++)
                draw_triangle(&target, &fan, i, face, modes[owner] == SHOW_BACK);
        }
    }
}
