/* Whether the boundary of a flat patch stays clear of itself, touches itself, or crosses itself.

   Where no triangle is flipped, a point is covered as often as the boundary winds around it, so that
   the boundary decides whether triangles overlap. Each edge is compared with earlier edges that
   share a cell of a grid with it. Common vertices do not count.

   Based on: Lipman, "Bijective Mappings of Meshes with Boundary and the Degree in Mesh Processing",
   2014 (why the boundary is enough where no triangle is flipped).

   Called from flatten.c and symmetric_dirichlet.c. */

#include "flattening.h"

#include <math.h>
#include <stdbool.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"

enum { MOST_CELLS = 1024 };

/* A square grid over the layout. */
struct grid {
    double low[2];
    double extent;
    int64_t n_cells; /* along each side */
};

/* An edge in the list of a cell. */
struct link {
    int64_t edge, next;
};

static struct grid grid_around(const double (*uvs)[2], const struct boundary *boundary)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int64_t edge = 0; edge < boundary->n_edges; edge++) {
        const double *uv = uvs[boundary->edges[edge][0]];
        for (int axis = 0; axis < 2; axis++) {
            low[axis] = min_f64(low[axis], uv[axis]);
            high[axis] = max_f64(high[axis], uv[axis]);
        }
    }
    const int64_t n_cells = (int64_t)(2.0 * sqrt((double)boundary->n_edges));
    return (struct grid){
        {low[0], low[1]}, max_f64(high[0] - low[0], high[1] - low[1]),
        max_i64(1, min_i64(n_cells, MOST_CELLS))};
}

static int64_t cell_of(double x, int64_t n_cells)
{
    if (!(x > 0.0)) /* also for what is not a number */
        return 0;
    return x < (double)n_cells ? (int64_t)x : n_cells - 1;
}

/* Cells from the first to the last. */
struct cells {
    int64_t first, last;
};

static struct cells cells_between(double low, double high, double origin, const struct grid *grid)
{
    const double scale = grid->n_cells / grid->extent, depth = TOUCH_DEPTH * grid->extent;
    return (struct cells){
        cell_of((low - depth - origin) * scale, grid->n_cells),
        cell_of((high + depth - origin) * scale, grid->n_cells)};
}

static struct cells rows_of_edge(const double p[2], const double q[2], const struct grid *grid)
{
    return cells_between(min_f64(p[1], q[1]), max_f64(p[1], q[1]), grid->low[1], grid);
}

/* The columns in which an edge, or what touches it, crosses a row. */
static struct cells columns_in_row(
    const double p[2], const double q[2], int64_t row, const struct grid *grid)
{
    const double height = grid->extent / (double)grid->n_cells, depth = TOUCH_DEPTH * grid->extent;
    const double bottom = grid->low[1] + (double)row * height - depth;
    const double top = bottom + height + 2.0 * depth, rise = q[1] - p[1];
    double t0 = 0.0, t1 = 1.0;
    if (fabs(rise) > depth) {
        const double t_bottom = (bottom - p[1]) / rise, t_top = (top - p[1]) / rise;
        t0 = clamp_f64(min_f64(t_bottom, t_top), 0.0, 1.0);
        t1 = clamp_f64(max_f64(t_bottom, t_top), 0.0, 1.0);
    }
    const double a = p[0] + t0 * (q[0] - p[0]), b = p[0] + t1 * (q[0] - p[0]);
    return cells_between(min_f64(a, b), max_f64(a, b), grid->low[0], grid);
}

/* Whether more than one loop runs counter-clockwise. */
static bool encloses_twice(
    struct arena *arena, const double (*uvs)[2], const struct boundary *boundary)
{
    int64_t n_loops = 1;
    for (int64_t edge = 0; edge < boundary->n_edges; edge++)
        n_loops = max_i64(n_loops, boundary->loops[edge] + 1);
    double *areas = TAKE_ZEROS(arena, double, n_loops);
    const double *origin = uvs[boundary->edges[0][0]];
    for (int64_t edge = 0; edge < boundary->n_edges; edge++) {
        const double *one = uvs[boundary->edges[edge][0]], *other = uvs[boundary->edges[edge][1]];
        const double ax = one[0] - origin[0], ay = one[1] - origin[1];
        const double bx = other[0] - origin[0], by = other[1] - origin[1];
        areas[boundary->loops[edge]] += ax * by - ay * bx;
    }
    int64_t n_enclosing = 0;
    for (int64_t loop = 0; loop < n_loops; loop++)
        n_enclosing += areas[loop] > 0.0;
    return n_enclosing > 1;
}

/* Signed distance of r from the line through p and q; 0 where p and q coincide. */
static inline double distance_from_line(const double p[2], const double q[2], const double r[2])
{
    const double x = q[0] - p[0], y = q[1] - p[1];
    const double length = sqrt(x * x + y * y);
    const double area = x * (r[1] - p[1]) - y * (r[0] - p[0]);
    return length > 0.0 ? area / length : 0.0;
}

/* How two edges meet that lead from a common vertex to `one` and `other`: in different directions,
   or one along the other. */
static int fans_meet(
    const double common[2], const double one[2], const double other[2], double depth)
{
    const double ax = one[0] - common[0], ay = one[1] - common[1];
    const double bx = other[0] - common[0], by = other[1] - common[1];
    const double longest = sqrt(max_f64(ax * ax + ay * ay, bx * bx + by * by));
    const bool on = ax * bx + ay * by > 0.0 && fabs(ax * by - ay * bx) <= depth * longest;
    return on ? TOUCHING : APART;
}

/* How two edges meet, which share at most one vertex. */
static int edges_meet(
    const double (*uvs)[2], const int32_t first[2], const int32_t second[2], double depth)
{
    const double *p = uvs[first[0]], *q = uvs[first[1]], *r = uvs[second[0]], *s = uvs[second[1]];
    for (int axis = 0; axis < 2; axis++) {
        if (max_f64(p[axis], q[axis]) < min_f64(r[axis], s[axis]) - depth)
            return APART;
        if (max_f64(r[axis], s[axis]) < min_f64(p[axis], q[axis]) - depth)
            return APART;
    }
    if (first[0] == second[0] || first[0] == second[1])
        return fans_meet(p, q, first[0] == second[0] ? s : r, depth);
    if (first[1] == second[0] || first[1] == second[1])
        return fans_meet(q, p, first[1] == second[0] ? s : r, depth);
    const double far_r = distance_from_line(p, q, r), far_s = distance_from_line(p, q, s);
    if (min_f64(far_r, far_s) > depth || max_f64(far_r, far_s) < -depth)
        return APART;
    const double far_p = distance_from_line(r, s, p), far_q = distance_from_line(r, s, q);
    if (min_f64(far_p, far_q) > depth || max_f64(far_p, far_q) < -depth)
        return APART;
    const double least = min_f64(
        min_f64(fabs(far_r), fabs(far_s)), min_f64(fabs(far_p), fabs(far_q)));
    return least > depth ? CROSSING : TOUCHING;
}

static int64_t count_links(
    const double (*uvs)[2], const struct boundary *boundary, const struct grid *grid)
{
    int64_t n_links = 0;
    for (int64_t edge = 0; edge < boundary->n_edges; edge++) {
        const double *p = uvs[boundary->edges[edge][0]], *q = uvs[boundary->edges[edge][1]];
        const struct cells rows = rows_of_edge(p, q, grid);
        for (int64_t row = rows.first; row <= rows.last; row++) {
            const struct cells columns = columns_in_row(p, q, row, grid);
            n_links += columns.last - columns.first + 1;
        }
    }
    return n_links;
}

/* How the edges meet that share a cell of the grid. */
static int64_t edges_in_cells_meet(
    struct arena *arena, const double (*uvs)[2], const struct boundary *boundary,
    const struct grid *grid)
{
    const double depth = TOUCH_DEPTH * grid->extent;
    const int64_t n_cells = grid->n_cells;
    int64_t n_links = 0, meeting = APART;
    struct link *links = TAKE(arena, struct link, count_links(uvs, boundary, grid));
    int64_t *heads = TAKE(arena, int64_t, n_cells * n_cells);
    for (int64_t cell = 0; cell < n_cells * n_cells; cell++)
        heads[cell] = -1;
    for (int64_t edge = 0; edge < boundary->n_edges; edge++) {
        const int32_t *ends = boundary->edges[edge];
        const struct cells rows = rows_of_edge(uvs[ends[0]], uvs[ends[1]], grid);
        for (int64_t row = rows.first; row <= rows.last; row++) {
            const struct cells columns = columns_in_row(uvs[ends[0]], uvs[ends[1]], row, grid);
            for (int64_t column = columns.first; column <= columns.last; column++) {
                int64_t *head = &heads[row * n_cells + column];
                for (int64_t link = *head; link >= 0; link = links[link].next) {
                    const int64_t other = links[link].edge;
                    const int met = edges_meet(uvs, ends, boundary->edges[other], depth);
                    if (met == CROSSING)
                        return CROSSING;
                    meeting = max_i64(meeting, met);
                }
                links[n_links] = (struct link){edge, *head};
                *head = n_links++;
            }
        }
    }
    return meeting;
}

/* APART, TOUCHING or CROSSING. A boundary with two counter-clockwise loops counts as crossing, one
   without extent as touching. */
int64_t boundary_meets(
    struct arena *arena, const double (*uvs)[2], const struct boundary *boundary)
{
    const struct grid grid = grid_around(uvs, boundary);
    if (!(grid.extent > 0.0))
        return TOUCHING;
    const arena_mark mark = mark_arena(arena);
    int64_t meeting = CROSSING;
    if (!encloses_twice(arena, uvs, boundary))
        meeting = edges_in_cells_meet(arena, uvs, boundary, &grid);
    reset_arena(arena, mark);
    return meeting;
}
