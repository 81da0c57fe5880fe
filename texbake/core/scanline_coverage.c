/* How much of each pixel faces and lines cover, in bounded time.

   A pixel has a fixed number of samples. Once a pixel is full it is skipped, so that a picture of a
   hundred thousand faces on top of one another takes no longer than one of a few dozen, and looks
   the same.

   Based on: Tarjan, "Efficiency of a Good But Not Linear Set Union Algorithm", 1975 (finding the
   next pixel of a row that is not yet full).

   Called from texbake/mapping/layout.py. */

#include <math.h>

#include "arena.h"
#include "core.h"
#include "elementary.h"
#include "numbers.h"

/* Samples along each side of a pixel, which Python knows as well, and in all: as many as an outline
   mask has bits. */
enum { SAMPLES = 4, N_SAMPLES = SAMPLES * SAMPLES };

enum { MOST_LAYERS = 32 }; /* faces over one pixel whose colors are mixed */

/* Most faces or lines drawn in one pixel and in one row: far more than any usable layout has. */
enum { MOST_LOOKS = 512, MOST_ROW_LOOKS = 1 << 18 };

/* What is still to be drawn of a picture. */
struct todo {
    int64_t n_rows, n_columns;
    int32_t *columns;   /* a row has n_columns + 1: each pixel, or one to its right that is not done */
    int32_t *rows;      /* likewise of the n_rows + 1 rows */
    int32_t *looks;     /* how often each pixel was drawn */
    int32_t *row_looks; /* and each row */
};

static struct todo make_todo(struct arena *arena, int64_t n_rows, int64_t n_columns)
{
    const struct todo todo = {
        n_rows, n_columns, TAKE(arena, int32_t, n_rows * (n_columns + 1)),
        TAKE(arena, int32_t, n_rows + 1), TAKE_ZEROS(arena, int32_t, n_rows * n_columns),
        TAKE_ZEROS(arena, int32_t, n_rows)};
    for (int64_t row = 0; row <= n_rows; row++)
        todo.rows[row] = (int32_t)row;
    for (int64_t row = 0; row < n_rows; row++)
        for (int64_t column = 0; column <= n_columns; column++)
            todo.columns[row * (n_columns + 1) + column] = (int32_t)column;
    return todo;
}

/* First place from `place` on that is not done; shortens the path for the next search. */
static inline int64_t next_place(int32_t *after, int64_t place)
{
    while (after[place] != place) {
        after[place] = after[after[place]];
        place = after[place];
    }
    return place;
}

static inline int32_t *columns_of(const struct todo *todo, int64_t row)
{
    return todo->columns + row * (todo->n_columns + 1);
}

static inline void finish_pixel(const struct todo *todo, int64_t row, int64_t column, bool is_full)
{
    const int32_t n_looks = ++todo->looks[row * todo->n_columns + column];
    if (is_full || n_looks == MOST_LOOKS)
        columns_of(todo, row)[column] = (int32_t)column + 1;
}

static inline void finish_row(const struct todo *todo, int64_t row)
{
    if (++todo->row_looks[row] == MOST_ROW_LOOKS
        || next_place(columns_of(todo, row), 0) == todo->n_columns)
        todo->rows[row] = (int32_t)row + 1;
}

struct span {
    double left, right;
};

/* Least and greatest x of a line between two heights; (inf, -inf) if it has no part there. */
static inline struct span span_of_line(
    double x0, double y0, double x1, double y1, double low, double high)
{
    if (y0 > y1) {
        const double x = x0, y = y0;
        x0 = x1, y0 = y1;
        x1 = x, y1 = y;
    }
    if (y1 < low || y0 > high)
        return (struct span){INFINITY, -INFINITY};
    const double start = y0 >= low ? x0 : x0 + (x1 - x0) * ((low - y0) / (y1 - y0));
    const double end = y1 <= high ? x1 : x0 + (x1 - x0) * ((high - y0) / (y1 - y0));
    return (struct span){min_f64(start, end), max_f64(start, end)};
}

/* The pixels of a row that a span meets: from the first that is not done to before `until`. */
static inline int64_t first_column(const struct todo *todo, int64_t row, struct span span)
{
    const double column = min_f64(max_f64(span.left, 0.0), (double)todo->n_columns);
    return next_place(columns_of(todo, row), (int64_t)column);
}

static inline int64_t until_column(const struct todo *todo, struct span span)
{
    return span.right >= 0.0 ? (int64_t)min_f64(span.right, todo->n_columns - 1.0) + 1 : 0;
}

/* A face: its corners, and for each edge a x + b y + c, the distance inwards. */
struct face {
    double x[3], y[3];
    double lines[3][3];
    const double *color;
    double half_edge, edge_light;
};

static void set_lines(struct face *face, double area)
{
    const double *x = face->x, *y = face->y;
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3;
        const double length = copysign(portable_hypot(x[j] - x[i], y[j] - y[i]), area);
        double *line = face->lines[i];
        line[0] = (y[i] - y[j]) / length;
        line[1] = (x[j] - x[i]) / length;
        line[2] = -(line[0] * x[i] + line[1] * y[i]);
    }
}

/* Add the samples of a pixel that an edge of the face may cross. */
static void add_face_samples(const struct face *face, int64_t row, int64_t column, double sum[4])
{
    for (int sample = 0; sample < N_SAMPLES; sample++) {
        const double x = column + (sample % SAMPLES + 0.5) * (1.0 / SAMPLES);
        const double y = row + (sample / SAMPLES + 0.5) * (1.0 / SAMPLES);
        double inwards = INFINITY;
        for (int i = 0; i < 3; i++) {
            const double *line = face->lines[i];
            inwards = min_f64(inwards, line[0] * x + line[1] * y + line[2]);
        }
        if (inwards < 0.0)
            continue;
        const double light = inwards < face->half_edge ? face->edge_light : 1.0;
        for (int channel = 0; channel < 3; channel++)
            sum[channel] += light * face->color[channel];
        sum[3] += 1.0;
    }
}

static inline void add_pixel(const struct face *face, int64_t row, int64_t column, double sum[4])
{
    double nearest = INFINITY, farthest = INFINITY; /* distances of the pixel's corners to an edge */
    for (int i = 0; i < 3; i++) {
        const double *line = face->lines[i];
        const double middle = line[0] * (column + 0.5) + line[1] * (row + 0.5) + line[2];
        const double reach = 0.5 * (fabs(line[0]) + fabs(line[1]));
        nearest = min_f64(nearest, middle - reach);
        farthest = min_f64(farthest, middle + reach);
    }
    if (nearest >= face->half_edge) {
        for (int channel = 0; channel < 3; channel++)
            sum[channel] += N_SAMPLES * face->color[channel];
        sum[3] += N_SAMPLES;
    } else if (farthest >= 0.0) {
        add_face_samples(face, row, column, sum);
    }
}

static void add_face_row(
    const struct face *face, const struct todo *todo, int64_t row, double (*sums)[4])
{
    struct span span = {INFINITY, -INFINITY};
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3;
        const struct span edge = span_of_line(
            face->x[i], face->y[i], face->x[j], face->y[j], (double)row, row + 1.0);
        span.left = min_f64(span.left, edge.left);
        span.right = max_f64(span.right, edge.right);
    }
    const int64_t until = until_column(todo, span);
    int64_t column = first_column(todo, row, span);
    while (column < until) {
        double *sum = sums[row * todo->n_columns + column];
        add_pixel(face, row, column, sum);
        finish_pixel(todo, row, column, sum[3] >= MOST_LAYERS * N_SAMPLES);
        column = next_place(columns_of(todo, row), column + 1);
    }
    finish_row(todo, row);
}

/* Add the colors of the samples that each face covers, and their number, to `sums`. Samples within
   `half_edge` of an edge have their color multiplied by `edge_light`; `top` is the y of row 0. */
EXPORT int64_t cover_faces(
    int64_t n_faces, int64_t n_rows, int64_t n_columns,
    const double corners[n_faces][3][2], const double colors[n_faces][3], double top,
    double half_edge, double edge_light, double sums[n_rows][n_columns][4])
{
    OPEN_ARENA(arena);
    const struct todo todo = make_todo(arena, n_rows, n_columns);
    for (int64_t index = 0; index < n_faces; index++) {
        struct face face = {
            .color = colors[index], .half_edge = half_edge, .edge_light = edge_light};
        double *x = face.x, *y = face.y;
        for (int i = 0; i < 3; i++) {
            x[i] = corners[index][i][0];
            y[i] = corners[index][i][1] - top;
        }
        const double first = max_f64(min_f64(min_f64(y[0], y[1]), y[2]), 0.0);
        const double last = max_f64(max_f64(y[0], y[1]), y[2]);
        const double area = (x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0]);
        if (!(last >= 0.0 && first < n_rows && (area < 0.0 || area > 0.0)))
            continue;
        set_lines(&face, area);
        const int64_t stop = (int64_t)min_f64(last, n_rows - 1.0) + 1;
        int64_t row = next_place(todo.rows, (int64_t)first);
        while (row < stop) {
            add_face_row(&face, &todo, row, (double (*)[4])sums);
            row = next_place(todo.rows, row + 1);
        }
    }
    close_arena(arena);
    return 0;
}

struct line {
    double x0, y0, x1, y1;
    double radius;
};

static void add_line_row(
    const struct line *line, const struct todo *todo, int64_t row, uint16_t *masks)
{
    const double dx = line->x1 - line->x0, dy = line->y1 - line->y0;
    const double square = max_f64(dx * dx + dy * dy, 1e-300); /* a point is a line as well */
    struct span span = span_of_line(
        line->x0, line->y0, line->x1, line->y1, row - line->radius, row + 1.0 + line->radius);
    span.left -= line->radius;
    span.right += line->radius;
    const int64_t until = until_column(todo, span);
    int64_t column = first_column(todo, row, span);
    while (column < until) {
        uint16_t *mask = &masks[row * todo->n_columns + column];
        for (int sample = 0; sample < N_SAMPLES; sample++) {
            const double x = column + (sample % SAMPLES + 0.5) / SAMPLES - line->x0;
            const double y = row + (sample / SAMPLES + 0.5) / SAMPLES - line->y0;
            const double t = min_f64(max_f64((x * dx + y * dy) / square, 0.0), 1.0);
            if (portable_hypot(x - t * dx, y - t * dy) <= line->radius)
                *mask |= (uint16_t)(1u << sample);
        }
        finish_pixel(todo, row, column, *mask == UINT16_MAX);
        column = next_place(columns_of(todo, row), column + 1);
    }
    finish_row(todo, row);
}

/* Set the bit of each sample that lies within `radius` of a line; `top` is the y of row 0. */
EXPORT int64_t cover_lines(
    int64_t n_lines, int64_t n_rows, int64_t n_columns,
    const double ends[n_lines][2][2], double top, double radius,
    uint16_t masks[n_rows][n_columns])
{
    OPEN_ARENA(arena);
    const struct todo todo = make_todo(arena, n_rows, n_columns);
    for (int64_t index = 0; index < n_lines; index++) {
        const struct line line = {
            ends[index][0][0], ends[index][0][1] - top, ends[index][1][0],
            ends[index][1][1] - top, radius};
        const double first = max_f64(min_f64(line.y0, line.y1) - radius, 0.0);
        const double last = max_f64(line.y0, line.y1) + radius;
        if (!(last >= 0.0 && first < n_rows))
            continue;
        const int64_t stop = (int64_t)min_f64(last, n_rows - 1.0) + 1;
        int64_t row = next_place(todo.rows, (int64_t)first);
        while (row < stop) {
            add_line_row(&line, &todo, row, (uint16_t *)masks);
            row = next_place(todo.rows, row + 1);
        }
    }
    close_arena(arena);
    return 0;
}
