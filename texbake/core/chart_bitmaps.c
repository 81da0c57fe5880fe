/* Charts rasterized into bitmaps, bitmaps into runs of cells along rows, and charts turned to the
   least bounding box.

   Called from texbake/mapping/atlas/packing/bitmaps.py and from bottom_left.c. */

#include "packing.h"

#include <math.h>
#include <string.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"

struct extent {
    double left, right;
};

/* Widen an extent by the part of a side that lies between two heights. */
static struct extent widened(
    struct extent extent, const double from[2], const double to[2], double bottom, double top)
{
    const double x0 = from[0], y0 = from[1], x1 = to[0], y1 = to[1];
    if (max_f64(y0, y1) < bottom || min_f64(y0, y1) > top)
        return extent;
    double t0 = 0.0, t1 = 1.0;
    if (y0 != y1) {
        const double t_bottom = (bottom - y0) / (y1 - y0), t_top = (top - y0) / (y1 - y0);
        t0 = max_f64(0.0, min_f64(t_bottom, t_top));
        t1 = min_f64(1.0, max_f64(t_bottom, t_top));
    }
    const double begin = x0 + t0 * (x1 - x0), end = x0 + t1 * (x1 - x0);
    return (struct extent){
        min_f64(min_f64(extent.left, begin), end), max_f64(max_f64(extent.right, begin), end)};
}

/* The bitmap of a chart in a pose, and the map from coordinates to cells. */
struct bitmap {
    int64_t width, height;
    double scale, margin;
    const double *shift;
    uint8_t *cells;
};

static void to_cells(const struct bitmap *bitmap, const double uv[2], double at[2])
{
    at[0] = uv[0] * bitmap->scale + bitmap->shift[0];
    at[1] = uv[1] * bitmap->scale + bitmap->shift[1];
}

/* Mark the cells within the margin of a triangle, or of a line with two corners. */
static void mark_polygon(const struct bitmap *bitmap, int n_corners, const double (*corners)[2])
{
    const double margin = bitmap->margin;
    double least = corners[0][1], most = corners[0][1];
    for (int i = 1; i < n_corners; i++) {
        least = min_f64(least, corners[i][1]);
        most = max_f64(most, corners[i][1]);
    }
    const int64_t first = max_i64((int64_t)floor(least - margin), 0);
    const int64_t last = min_i64((int64_t)floor(most + margin), bitmap->height - 1);
    for (int64_t row = first; row <= last; row++) {
        const double bottom = (double)row - margin, top = (double)(row + 1) + margin;
        struct extent extent = {INFINITY, -INFINITY};
        for (int i = 0; i < (n_corners == 2 ? 1 : n_corners); i++)
            extent = widened(extent, corners[i], corners[(i + 1) % n_corners], bottom, top);
        if (!(extent.left <= extent.right))
            continue;
        const int64_t begin = max_i64((int64_t)floor(extent.left - margin), 0);
        const int64_t end = min_i64((int64_t)floor(extent.right + margin), bitmap->width - 1);
        if (begin <= end)
            memset(bitmap->cells + row * bitmap->width + begin, 1, (size_t)(end - begin + 1));
    }
}

/* Where a directed edge crosses the middle of a row, count it at the first cell whose center lies right
   of it: `turns` holds how the number of windings changes along each row. */
static void count_crossings(
    const struct bitmap *bitmap, const double from[2], const double to[2], int32_t *turns)
{
    const int64_t first = max_i64((int64_t)floor(min_f64(from[1], to[1]) - 0.5), 0);
    const int64_t last = min_i64((int64_t)floor(max_f64(from[1], to[1])), bitmap->height - 1);
    for (int64_t row = first; row <= last; row++) {
        const double middle = (double)row + 0.5;
        if ((from[1] <= middle) == (to[1] <= middle))
            continue;
        const double t = (middle - from[1]) / (to[1] - from[1]);
        const double x = from[0] + t * (to[0] - from[0]);
        const double column = clamp_f64(ceil(x - 0.5), 0.0, (double)bitmap->width);
        turns[row * (bitmap->width + 1) + (int64_t)column] += from[1] < to[1] ? 1 : -1;
    }
}

/* The next column from `column` on with a step, or `width`. */
static int64_t next_step(const int32_t *steps, int64_t column, int64_t width)
{
    while (column + 4 <= width
        && !(steps[column] | steps[column + 1] | steps[column + 2] | steps[column + 3]))
        column += 4;
    while (column < width && steps[column] == 0)
        column++;
    return column;
}

/* Mark the cells whose centers the border winds around; empty `turns`. */
static void fill_windings(const struct bitmap *bitmap, int32_t *turns)
{
    const int64_t width = bitmap->width;
    for (int64_t row = 0; row < bitmap->height; row++) {
        uint8_t *cells = bitmap->cells + row * width;
        int32_t *steps = turns + row * (width + 1), windings = 0;
        for (int64_t column = next_step(steps, 0, width); column < width;) {
            windings += steps[column];
            steps[column] = 0;
            const int64_t end = next_step(steps, column + 1, width);
            if (windings != 0)
                memset(cells + column, 1, (size_t)(end - column));
            column = end;
        }
        steps[width] = 0;
    }
}

/* Mark each cell within `margin` of a chart, in the bitmap of each chart and pose. Charts that are
   folded are drawn by their `triangles`; of the others, the directed `edges` at their borders are drawn,
   sorted by chart, and what they wind around is filled. */
EXPORT int64_t mark_charts(
    int64_t n_uvs, int64_t n_triangles, int64_t n_edges, int64_t n_charts, int64_t n_poses,
    int64_t n_cells, const double uvs[n_uvs][n_poses][2], const int32_t chart_ids[n_uvs],
    const int32_t triangles[n_triangles][3], const int32_t edges[n_edges][2], double scale,
    const double shifts[n_charts][n_poses][2], double margin,
    const int64_t boxes[n_charts][n_poses][2], const int64_t starts[n_charts][n_poses],
    uint8_t masks[n_cells])
{
    OPEN_ARENA(arena);
    int64_t most = 0;
    for (int64_t chart = 0; chart < n_charts; chart++)
        for (int64_t pose = 0; pose < n_poses; pose++)
            most = max_i64(most, (boxes[chart][pose][0] + 1) * boxes[chart][pose][1]);
    int32_t *turns = TAKE_ZEROS(arena, int32_t, most);
    double corners[3][2];
    for (int64_t pose = 0; pose < n_poses; pose++) {
        for (int64_t i = 0; i < n_triangles; i++) {
            const int32_t chart = chart_ids[triangles[i][0]];
            const struct bitmap bitmap = {boxes[chart][pose][0], boxes[chart][pose][1], scale,
                margin, shifts[chart][pose], masks + starts[chart][pose]};
            for (int corner = 0; corner < 3; corner++)
                to_cells(&bitmap, uvs[triangles[i][corner]][pose], corners[corner]);
            mark_polygon(&bitmap, 3, (const double (*)[2])corners);
        }
        for (int64_t i = 0; i < n_edges;) {
            const int32_t chart = chart_ids[edges[i][0]];
            const struct bitmap bitmap = {boxes[chart][pose][0], boxes[chart][pose][1], scale,
                margin, shifts[chart][pose], masks + starts[chart][pose]};
            for (; i < n_edges && chart_ids[edges[i][0]] == chart; i++) {
                for (int end = 0; end < 2; end++)
                    to_cells(&bitmap, uvs[edges[i][end]][pose], corners[end]);
                mark_polygon(&bitmap, 2, (const double (*)[2])corners);
                count_crossings(&bitmap, corners[0], corners[1], turns);
            }
            fill_windings(&bitmap, turns);
        }
    }
    close_arena(arena);
    return 0;
}

int64_t largest_mask(const struct chart_masks *masks, int64_t n_charts)
{
    int64_t most = 1;
    for (int64_t at = 0; at < n_charts * masks->n_poses; at++)
        most = max_i64(most, masks->boxes[at][0] * masks->boxes[at][1]);
    return most;
}

/* Side of the squares in which masks are transposed: their rows stay in the cache. */
enum { TILE = 16 };

struct mask transposed(struct mask mask, uint8_t *cells)
{
    for (int64_t y = 0; y < mask.height; y += TILE) {
        for (int64_t x = 0; x < mask.width; x += TILE) {
            const int64_t bottom = min_i64(y + TILE, mask.height);
            const int64_t right = min_i64(x + TILE, mask.width);
            for (int64_t column = x; column < right; column++)
                for (int64_t row = y; row < bottom; row++)
                    cells[column * mask.height + row] = mask.cells[row * mask.width + column];
        }
    }
    return (struct mask){mask.height, mask.width, cells};
}

/* Write the runs of marked cells of a row, `is_mirrored` or not; return how many. */
static int64_t write_row(
    const uint8_t *cells, int64_t width, int32_t row, bool is_mirrored, struct span *spans)
{
    int64_t count = 0;
    const uint8_t *const end = cells + width;
    const uint8_t *at = cells;
    while (at < end && (at = memchr(at, 1, (size_t)(end - at)))) {
        const uint8_t *after = memchr(at, 0, (size_t)(end - at));
        after = after ? after : end;
        spans[count++] = (struct span){row, (int32_t)(at - cells), (int32_t)(after - cells)};
        at = after;
    }
    for (int64_t i = 0; is_mirrored && 2 * i < count; i++) {
        const struct span one = spans[i], other = spans[count - 1 - i];
        const int32_t last = (int32_t)width;
        spans[i] = (struct span){row, last - other.end, last - other.begin};
        spans[count - 1 - i] = (struct span){row, last - one.end, last - one.begin};
    }
    return count;
}

int64_t write_spans(struct mask mask, struct mask across, int64_t turn, struct span *spans)
{
    const struct mask lying = turn % 2 == 0 ? mask : across;
    int64_t count = 0;
    for (int64_t row = 0; row < lying.height; row++) {
        const int64_t from = turn < 2 ? row : lying.height - 1 - row;
        count += write_row(lying.cells + from * lying.width, lying.width, (int32_t)row,
            turn == 1 || turn == 2, spans + count);
    }
    return count;
}

/* Write the runs of all charts, poses and quarter turns, and where those of each begin and end;
   return how many. */
EXPORT int64_t list_spans(
    int64_t n_cells, int64_t n_charts, int64_t n_poses, int64_t most,
    const uint8_t masks[n_cells], const int64_t mask_starts[n_charts][n_poses],
    const int64_t mask_boxes[n_charts][n_poses][2], int64_t turns, int32_t spans[most][3],
    int64_t starts[n_charts][n_poses * turns][2])
{
    OPEN_ARENA(arena);
    const struct chart_masks all = {n_poses, masks, mask_starts[0], mask_boxes[0]};
    struct span *written = (struct span *)spans;
    uint8_t *cells = TAKE(arena, uint8_t, largest_mask(&all, n_charts));
    int64_t count = 0;
    for (int64_t chart = 0; chart < n_charts; chart++) {
        for (int64_t pose = 0; pose < n_poses; pose++) {
            const struct mask mask = mask_of(&all, chart, pose);
            const struct mask across = turns > 1 ? transposed(mask, cells) : mask;
            for (int64_t turn = 0; turn < turns; turn++) {
                int64_t *range = starts[chart][pose * turns + turn];
                range[0] = count;
                count += write_spans(mask, across, turn, written + count);
                range[1] = count;
            }
        }
    }
    close_arena(arena);
    return count;
}

/* Write the runs of cells that other charts may not touch; return how many. */
EXPORT int64_t list_reach(
    int64_t n_spans, int64_t n_charts, int64_t n_orientations, int64_t n_widths, int64_t most,
    const int32_t spans[n_spans][3], const int64_t starts[n_charts][n_orientations][2],
    const int32_t boxes[n_charts][n_orientations][2], const int32_t half_widths[n_widths],
    int32_t reach[most][3], int64_t reach_starts[n_charts][n_orientations][2])
{
    OPEN_ARENA(arena);
    const int32_t margin = (int32_t)(n_widths / 2);
    /* Charts in all their orientations, one after another. */
    const int32_t (*const box)[2] = boxes[0];
    const int64_t (*const start)[2] = starts[0];
    int64_t (*const reach_start)[2] = reach_starts[0];
    int64_t count = 0;
    for (int64_t at = 0; at < n_charts * n_orientations; at++) {
        const arena_mark before = mark_arena(arena);
        const int64_t width = box[at][0] + 2 * (int64_t)margin;
        const int64_t height = box[at][1] + 2 * (int64_t)margin;
        uint8_t *cells = TAKE_ZEROS(arena, uint8_t, width * height);
        for (int64_t i = start[at][0]; i < start[at][1]; i++) {
            for (int64_t step = 0; step <= 2 * margin; step++) {
                const int64_t aside = half_widths[step], row = spans[i][0] + step;
                const int64_t begin = spans[i][1] + margin - aside;
                const int64_t end = spans[i][2] + margin + aside;
                memset(cells + row * width + begin, 1, (size_t)(end - begin));
            }
        }
        reach_start[at][0] = count;
        struct span *written = (struct span *)reach[count];
        const struct mask mask = {width, height, cells};
        const int64_t n_written = write_spans(mask, mask, 0, written);
        for (int64_t i = 0; i < n_written; i++) {
            written[i].row -= margin;
            written[i].begin -= margin;
            written[i].end -= margin;
        }
        count += n_written;
        reach_start[at][1] = count;
        reset_arena(arena, before);
    }
    close_arena(arena);
    return count;
}

/* Write the index of the angle at which each chart has the smallest bounding box. */
EXPORT void find_least_boxes(
    int64_t n_points, int64_t n_charts, int64_t n_angles, const double uvs[n_points][2],
    const int64_t starts[n_charts + 1], const double cosines[n_angles],
    const double sines[n_angles], int64_t best[n_charts])
{
    for (int64_t chart = 0; chart < n_charts; chart++) {
        double least = INFINITY;
        for (int64_t i = 0; i < n_angles; i++) {
            double left = INFINITY, right = -INFINITY, bottom = INFINITY, top = -INFINITY;
            for (int64_t j = starts[chart]; j < starts[chart + 1]; j++) {
                const double x = uvs[j][0] * cosines[i] - uvs[j][1] * sines[i];
                const double y = uvs[j][0] * sines[i] + uvs[j][1] * cosines[i];
                left = min_f64(left, x);
                right = max_f64(right, x);
                bottom = min_f64(bottom, y);
                top = max_f64(top, y);
            }
            const double area = (right - left) * (top - bottom);
            if (area < least * (1.0 - 1e-9)) { /* more than rounding */
                least = area;
                best[chart] = i;
            }
        }
    }
}
