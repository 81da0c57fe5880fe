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

/* Least and greatest x of the part of a triangle that lies between two heights. */
static struct extent extent_between(
    const double x[3], const double y[3], double bottom, double top)
{
    struct extent extent = {INFINITY, -INFINITY};
    for (int i = 0; i < 3; i++) {
        const int next = (i + 1) % 3;
        const double x0 = x[i], y0 = y[i], x1 = x[next], y1 = y[next];
        if (max_f64(y0, y1) < bottom || min_f64(y0, y1) > top)
            continue;
        double t0 = 0.0, t1 = 1.0;
        if (y0 != y1) {
            const double t_bottom = (bottom - y0) / (y1 - y0), t_top = (top - y0) / (y1 - y0);
            t0 = max_f64(0.0, min_f64(t_bottom, t_top));
            t1 = min_f64(1.0, max_f64(t_bottom, t_top));
        }
        const double begin = x0 + t0 * (x1 - x0), end = x0 + t1 * (x1 - x0);
        extent.left = min_f64(min_f64(extent.left, begin), end);
        extent.right = max_f64(max_f64(extent.right, begin), end);
    }
    return extent;
}

/* More than coordinates can be wrong by rounding, in cells. */
static const double ROUNDING = 1e-6;

/* Whether all cells of some rows and columns are marked. */
static bool is_marked(
    const uint8_t *cells, int64_t width, int64_t first, int64_t last, int64_t begin, int64_t end)
{
    for (int64_t row = first; row <= last; row++)
        for (int64_t column = begin; column <= end; column++)
            if (!cells[row * width + column])
                return false;
    return true;
}

/* Mark the gap between marked cells of a row that a cell lies in. */
static void fill_gap(uint8_t *cells, int64_t width, int64_t column)
{
    int64_t begin = column, end = column;
    while (begin > 0 && !cells[begin - 1])
        begin--;
    while (end < width && !cells[end])
        end++;
    memset(cells + begin, 1, (size_t)(end - begin));
}

/* Mark the cells within `margin` of a triangle in a bitmap. One inside a chart whose border is
   marked has the whole of a gap if it has any of it. */
static void mark_triangle(
    const double x[3], const double y[3], double margin, bool is_inside, const int64_t box[2],
    uint8_t *cells)
{
    const double least = min_f64(min_f64(y[0], y[1]), y[2]);
    const double most = max_f64(max_f64(y[0], y[1]), y[2]);
    const int64_t width = box[0], height = box[1];
    const int64_t first = max_i64((int64_t)floor(least - margin), 0);
    const int64_t last = min_i64((int64_t)floor(most + margin), height - 1);
    if (is_inside) {
        const double left = min_f64(min_f64(x[0], x[1]), x[2]) - margin - ROUNDING;
        const double right = max_f64(max_f64(x[0], x[1]), x[2]) + margin + ROUNDING;
        if (is_marked(cells, width, first, last, max_i64((int64_t)floor(left), 0),
                min_i64((int64_t)floor(right), width - 1)))
            return;
    }
    for (int64_t row = first; row <= last; row++) {
        const struct extent extent =
            extent_between(x, y, (double)row - margin, (double)(row + 1) + margin);
        if (!(extent.left <= extent.right))
            continue;
        uint8_t *const own = cells + row * width;
        const int64_t begin = max_i64((int64_t)floor(extent.left - margin), 0);
        const int64_t end = min_i64((int64_t)floor(extent.right + margin), width - 1);
        if (begin > end)
            continue;
        const int64_t middle = (int64_t)floor(0.5 * (extent.left + extent.right));
        if (is_inside && margin >= ROUNDING && middle >= begin && middle <= end && !own[middle])
            fill_gap(own, width, middle);
        memset(own + begin, 1, (size_t)(end - begin + 1));
    }
}

/* Mark each cell within `margin` of a face, in the bitmap of its chart and pose. The first `n_outer`
   faces are those at the borders of charts and in charts that are folded. */
EXPORT void mark_faces(
    int64_t n_faces, int64_t n_charts, int64_t n_poses, int64_t n_cells,
    const double corners[n_faces][3][n_poses][2], const int32_t face_charts[n_faces],
    int64_t n_outer, double scale, const double shifts[n_charts][n_poses][2], double margin,
    const int64_t boxes[n_charts][n_poses][2], const int64_t starts[n_charts][n_poses],
    uint8_t masks[n_cells])
{
    for (int64_t face = 0; face < n_faces; face++) {
        const int32_t chart = face_charts[face];
        for (int64_t pose = 0; pose < n_poses; pose++) {
            double x[3], y[3];
            for (int corner = 0; corner < 3; corner++) {
                x[corner] = corners[face][corner][pose][0] * scale + shifts[chart][pose][0];
                y[corner] = corners[face][corner][pose][1] * scale + shifts[chart][pose][1];
            }
            mark_triangle(x, y, margin, face >= n_outer, boxes[chart][pose],
                masks + starts[chart][pose]);
        }
    }
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
