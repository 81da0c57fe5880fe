/* Borders between charts moved to cheaper edges of the mesh.

   A border between two charts runs from one junction with other borders to the next. It is replaced
   by the cheapest path through a band of faces about it. An edge costs its length times its weight.
   Turns cost extra, so that of many equally short paths through a grid a straight one is cheapest.

   Based on: Dijkstra, "A Note on Two Problems in Connexion with Graphs", 1959. Caldwell, "On Finding
   Minimum Routes in a Network with Turn Penalties", 1961 (paths over edges instead of vertices).

   Called from texbake/mapping/atlas/joining/straighten.py, and from files that divide charts. */

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "arena.h"
#include "border_straightening.h"
#include "core.h"
#include "numbers.h"
#include "step_heap.h"
#include "union_find.h"

/* Rounds in which all borders move. Closed borders move one half after the other. */
enum { N_ROUNDS = 2 };

/* Rings of faces in the band about a border. */
enum { LEAST_RINGS = 2, MOST_RINGS = 24 };

/* What a turn of 90 degrees costs, in mean edges of the border; turns below 30 degrees cost nothing. */
static const double TURN = 1.5;
static const double FREE_COSINE = 0.866;

/* A surface with labeled faces, and the state of their borders while these move. */
struct borders {
    struct arena *arena;
    int64_t n_faces;
    const double (*points)[3];
    const int32_t (*corners)[3];
    const int32_t *opposite;
    const double (*weights)[3]; /* of half-edges; infinite: no border runs here */
    double width;            /* of bands */
    const int32_t *before;   /* labels at the start */
    int32_t *labels;
    int32_t *tails;          /* vertex at the start of each half-edge: one for each fan of faces */
    int32_t *starts, *leaving; /* half-edges that leave vertex i: starts[i] to starts[i + 1] - 1 */
    bool *is_open;           /* vertices at the boundary of the surface */
    int32_t *n_borders;      /* edges of borders at each vertex */
    int32_t *band, *side;    /* of faces: the round of the last band and flood */
    int32_t *walls, *reached, *own;
    double *costs;           /* of the paths that end with each half-edge */
    int32_t *came_by;
    int32_t *queue;
    struct heap *heap;
    int32_t time;            /* counts bands */
};

static inline int32_t next_of(int32_t edge)
{
    return edge % 3 == 2 ? edge - 2 : edge + 1;
}

static inline int32_t head(const struct borders *borders, int32_t edge)
{
    return borders->tails[next_of(edge)];
}

static double step_along(const struct borders *borders, int32_t edge, double step[3])
{
    const double *a = borders->points[borders->corners[edge / 3][edge % 3]];
    const double *b = borders->points[borders->corners[edge / 3][next_of(edge) % 3]];
    double square = 0.0;
    for (int axis = 0; axis < 3; axis++) {
        step[axis] = b[axis] - a[axis];
        square += step[axis] * step[axis];
    }
    return sqrt(square);
}

/* The cost of continuing a path along an edge; `before`: the last edge of the path, or -1. */
static double cost_of(const struct borders *borders, int32_t before, int32_t edge, double unit)
{
    double step[3], last[3];
    const double length = step_along(borders, edge, step);
    double cost = length * borders->weights[edge / 3][edge % 3];
    if (before >= 0) {
        const double lengths = length * step_along(borders, before, last);
        const double dot = step[0] * last[0] + step[1] * last[1] + step[2] * last[2];
        cost += TURN * unit * max_f64(FREE_COSINE - (lengths > 0.0 ? dot / lengths : 1.0), 0.0);
    }
    return cost;
}

static bool is_border(const struct borders *borders, int32_t edge)
{
    const int32_t across = borders->opposite[edge];
    return across >= 0 && borders->labels[edge / 3] != borders->labels[across / 3];
}

/* Number the fans, list the half-edges that leave each, and count those of borders. */
static void connect(struct borders *borders)
{
    struct arena *arena = borders->arena;
    const int32_t n_edges = (int32_t)(3 * borders->n_faces);
    borders->tails = TAKE(arena, int32_t, n_edges);
    for (int32_t edge = 0; edge < n_edges; edge++)
        borders->tails[edge] = edge;
    for (int32_t edge = 0; edge < n_edges; edge++)
        if (borders->opposite[edge] >= 0)
            join_labels(borders->tails, edge, next_of(borders->opposite[edge]));
    const int32_t n = number_labels(borders->tails, n_edges);
    borders->starts = TAKE_ZEROS(arena, int32_t, n + 2);
    borders->leaving = TAKE(arena, int32_t, n_edges);
    borders->is_open = TAKE_ZEROS(arena, bool, n);
    borders->n_borders = TAKE_ZEROS(arena, int32_t, n);
    borders->own = TAKE_ZEROS(arena, int32_t, n);
    for (int32_t edge = 0; edge < n_edges; edge++)
        borders->starts[borders->tails[edge] + 2]++;
    for (int32_t vertex = 2; vertex <= n; vertex++)
        borders->starts[vertex] += borders->starts[vertex - 1];
    for (int32_t edge = 0; edge < n_edges; edge++) {
        const int32_t tail = borders->tails[edge];
        borders->leaving[borders->starts[tail + 1]++] = edge;
        if (borders->opposite[edge] < 0)
            borders->is_open[tail] = borders->is_open[head(borders, edge)] = true;
        else if (is_border(borders, edge))
            borders->n_borders[tail]++;
    }
}

/* A border passes through a vertex: it neither ends there nor meets another. */
static bool is_passed(const struct borders *borders, int32_t vertex)
{
    return borders->n_borders[vertex] == 2 && !borders->is_open[vertex];
}

/* The half-edge of the border after one whose head it passes through; -1 if there is none. */
static int32_t continued(const struct borders *borders, int32_t edge)
{
    const int32_t vertex = head(borders, edge), label = borders->labels[edge / 3];
    for (int32_t i = borders->starts[vertex]; i < borders->starts[vertex + 1]; i++) {
        const int32_t other = borders->leaving[i];
        if (borders->labels[other / 3] == label && is_border(borders, other))
            return other;
    }
    return -1;
}

/* Mark the faces of a band about a border between two labels. */
static void make_band(struct borders *borders, int64_t n, const int32_t *path)
{
    const int32_t one = borders->labels[path[0] / 3];
    const int32_t other = borders->labels[borders->opposite[path[0]] / 3];
    const int64_t n_rings = clamp_i64(
        (int64_t)(borders->width * (double)n), LEAST_RINGS, MOST_RINGS);
    int64_t n_met = 0, first = 0;
    for (int64_t i = 0; i < 2 * n; i++) {
        const int32_t face = (i < n ? path[i] : borders->opposite[path[i - n]]) / 3;
        if (borders->band[face] != borders->time) {
            borders->band[face] = borders->time;
            borders->queue[n_met++] = face;
        }
    }
    for (int64_t ring = 0; ring < n_rings; ring++) {
        for (const int64_t end = n_met; first < end; first++) {
            for (int side = 0; side < 3; side++) {
                const int32_t across = borders->opposite[3 * borders->queue[first] + side];
                const int32_t face = across / 3;
                if (across < 0 || borders->band[face] == borders->time)
                    continue;
                const int32_t label = borders->labels[face], before = borders->before[face];
                if ((label != one && label != other) || (before != one && before != other))
                    continue;
                borders->band[face] = borders->time;
                borders->queue[n_met++] = face;
            }
        }
    }
}

static bool is_in_band(const struct borders *borders, int32_t edge)
{
    const int32_t across = borders->opposite[edge];
    return across >= 0 && borders->band[edge / 3] == borders->time
        && borders->band[across / 3] == borders->time;
}

/* Continue a path along an edge, if no other path to the edge costs less. */
static void offer(struct borders *borders, int32_t before, int32_t edge, double unit)
{
    if (!is_in_band(borders, edge))
        return;
    const double cost =
        (before >= 0 ? borders->costs[before] : 0.0) + cost_of(borders, before, edge, unit);
    if (!(cost < INFINITY) || (borders->reached[edge] == borders->time && cost >= borders->costs[edge]))
        return;
    borders->reached[edge] = borders->time;
    borders->costs[edge] = cost;
    borders->came_by[edge] = before;
    push(borders->heap, (struct step){cost, edge});
}

/* Find the cheapest path from one vertex to another through the band; return its number of edges, 0 if
   there is none. Vertices of other borders are not passed. */
static int64_t find_path(
    struct borders *borders, int32_t from, int32_t to, double unit, int32_t *path)
{
    borders->heap->n = 0;
    for (int32_t i = borders->starts[from]; i < borders->starts[from + 1]; i++)
        offer(borders, -1, borders->leaving[i], unit);
    while (borders->heap->n > 0) {
        const struct step step = pop(borders->heap);
        if (step.cost > borders->costs[step.item])
            continue;
        const int32_t vertex = head(borders, step.item);
        if (vertex == to) {
            int64_t n = 0;
            for (int32_t edge = step.item; edge >= 0; edge = borders->came_by[edge])
                n++;
            int64_t at = n;
            for (int32_t edge = step.item; edge >= 0; edge = borders->came_by[edge])
                path[--at] = edge;
            return n;
        }
        const bool is_free = borders->n_borders[vertex] == 0 || borders->own[vertex] == borders->time;
        if (!is_free || borders->is_open[vertex])
            continue;
        for (int32_t i = borders->starts[vertex]; i < borders->starts[vertex + 1]; i++)
            if (borders->leaving[i] != borders->opposite[step.item])
                offer(borders, step.item, borders->leaving[i], unit);
    }
    return 0;
}

static void set_walls(struct borders *borders, int64_t n, const int32_t *path, int32_t mark)
{
    for (int64_t i = 0; i < n; i++)
        borders->walls[path[i]] = borders->walls[borders->opposite[path[i]]] = mark;
}

/* Flood both sides of a path through the band; return how many faces are met, in the queue, with
   `side` twice the time and the side. 0 if the sides meet. */
static int64_t flood(struct borders *borders, int64_t n, const int32_t *path)
{
    int64_t n_met = 0;
    for (int32_t i = 0; i < 2 * n; i++) {
        const int32_t side = i >= n, face = (side ? borders->opposite[path[i - n]] : path[i]) / 3;
        if (borders->side[face] == 2 * borders->time + 1 - side)
            return 0;
        if (borders->side[face] != 2 * borders->time + side) {
            borders->side[face] = 2 * borders->time + side;
            borders->queue[n_met++] = face;
        }
    }
    for (int64_t at = 0; at < n_met; at++) {
        const int32_t own = borders->side[borders->queue[at]];
        for (int k = 0; k < 3; k++) {
            const int32_t edge = 3 * borders->queue[at] + k, across = borders->opposite[edge];
            if (!is_in_band(borders, edge) || borders->walls[edge] == 2 * borders->time + 1)
                continue;
            /* Another border between the same labels. */
            if (is_border(borders, edge) && borders->walls[edge] != 2 * borders->time)
                continue;
            const int32_t there = borders->side[across / 3];
            if (there >> 1 != borders->time) {
                borders->side[across / 3] = own;
                borders->queue[n_met++] = across / 3;
            } else if (there != own) {
                return 0;
            }
        }
    }
    return n_met;
}

/* Whether the faces met may get the labels of their sides: those that change meet no other face of the
   two labels that keeps its own, nor another border between the two. */
static bool is_clean(const struct borders *borders, int64_t n_met, const int32_t sides[2])
{
    for (int64_t at = 0; at < n_met; at++) {
        const int32_t face = borders->queue[at], label = sides[borders->side[face] & 1];
        for (int k = 0; k < 3 && label != borders->labels[face]; k++) {
            const int32_t edge = 3 * face + k, across = borders->opposite[edge];
            if (across < 0)
                continue;
            const int32_t there = borders->labels[across / 3];
            const bool is_met = borders->side[across / 3] >> 1 == borders->time;
            const bool is_other = is_border(borders, edge) && borders->walls[edge] >> 1 != borders->time;
            if ((there == sides[0] || there == sides[1]) && (!is_met || is_other))
                return false;
        }
    }
    return true;
}

/* Whether a path passes no vertex twice. Uses up `own`. */
static bool is_simple(const struct borders *borders, int64_t n, const int32_t *path)
{
    for (int64_t i = 0; i + 1 < n; i++) {
        const int32_t vertex = head(borders, path[i]);
        if (borders->own[vertex] == -borders->time)
            return false;
        borders->own[vertex] = -borders->time;
    }
    return true;
}

static void count_borders(struct borders *borders, int64_t n, const int32_t *path, int32_t change)
{
    for (int64_t i = 0; i < n; i++) {
        borders->n_borders[borders->tails[path[i]]] += change;
        borders->n_borders[head(borders, path[i])] += change;
    }
}

/* Move a part of a border, if that is cheaper and leaves both charts whole. */
static void move_border(struct borders *borders, int64_t n, const int32_t *old, int32_t *path)
{
    borders->time++;
    double unit = 0.0, step[3], cost = 0.0;
    for (int64_t i = 0; i < n; i++)
        unit += step_along(borders, old[i], step) / (double)n;
    for (int64_t i = 0; i < n; i++) {
        cost += cost_of(borders, i > 0 ? old[i - 1] : -1, old[i], unit);
        if (i > 0)
            borders->own[borders->tails[old[i]]] = borders->time;
    }
    const int32_t sides[2] = {
        borders->labels[old[0] / 3], borders->labels[borders->opposite[old[0]] / 3]};
    make_band(borders, n, old);
    const int64_t n_new =
        find_path(borders, borders->tails[old[0]], head(borders, old[n - 1]), unit, path);
    if (n_new == 0 || !(borders->costs[path[n_new - 1]] < cost * (1.0 - 1e-9)))
        return;
    set_walls(borders, n, old, 2 * borders->time);
    set_walls(borders, n_new, path, 2 * borders->time + 1);
    const int64_t n_met = flood(borders, n_new, path);
    if (n_met == 0 || !is_clean(borders, n_met, sides) || !is_simple(borders, n_new, path))
        return;
    for (int64_t at = 0; at < n_met; at++)
        borders->labels[borders->queue[at]] = sides[borders->side[borders->queue[at]] & 1];
    count_borders(borders, n, old, -1);
    count_borders(borders, n_new, path, 1);
}

/* Collect the border that a half-edge begins, up to a vertex that it does not pass through or to its
   own start; return the number of half-edges. */
static int64_t collect(const struct borders *borders, int32_t edge, bool *is_seen, int32_t *border)
{
    int64_t n = 0;
    for (int32_t at = edge; at >= 0 && !is_seen[at];) {
        is_seen[at] = true;
        border[n++] = at;
        at = is_passed(borders, head(borders, at)) ? continued(borders, at) : -1;
    }
    return n;
}

/* Move all borders once: those with ends, then closed ones, one half after the other. */
static void move_all(struct borders *borders, int round, bool *is_seen, int32_t *old, int32_t *path)
{
    const int32_t n_edges = (int32_t)(3 * borders->n_faces);
    for (int closed = 0; closed < 2; closed++) {
        memset(is_seen, 0, (size_t)n_edges * sizeof *is_seen);
        for (int32_t edge = 0; edge < n_edges; edge++) {
            const int32_t across = borders->opposite[edge];
            if (is_seen[edge] || !is_border(borders, edge)
                || borders->labels[edge / 3] > borders->labels[across / 3]
                || (!closed && is_passed(borders, borders->tails[edge])))
                continue;
            int64_t n = collect(borders, edge, is_seen, old);
            const bool is_loop = head(borders, old[n - 1]) == borders->tails[old[0]];
            if (is_loop != closed)
                continue;
            if (!is_loop) {
                move_border(borders, n, old, path);
            } else if (n >= 4) {
                /* In each round another pair of vertices stays. */
                const int64_t shift = is_passed(borders, borders->tails[edge]) && round % 2 ? n / 4 : 0;
                memcpy(old + n, old, (size_t)shift * sizeof *old);
                move_border(borders, n / 2, old + shift, path);
                move_border(borders, n - n / 2, old + shift + n / 2, path);
            }
        }
    }
}

void straighten_labels(
    struct arena *arena, const struct weighted_surface *surface, double width, int32_t *labels)
{
    const arena_mark mark = mark_arena(arena);
    const int64_t n_faces = surface->n_faces, n_edges = 3 * n_faces;
    int32_t *before = TAKE(arena, int32_t, n_faces);
    memcpy(before, labels, (size_t)n_faces * sizeof *labels);
    struct heap heap = {0, 6 * n_edges, take(arena, 6 * n_edges, sizeof *heap.steps)};
    struct borders borders = {
        .arena = arena, .n_faces = n_faces, .points = surface->points, .corners = surface->corners,
        .opposite = surface->opposite, .weights = surface->weights, .width = width,
        .before = before, .labels = labels,
        .band = TAKE_ZEROS(arena, int32_t, n_faces), .side = TAKE_ZEROS(arena, int32_t, n_faces),
        .walls = TAKE_ZEROS(arena, int32_t, n_edges), .reached = TAKE_ZEROS(arena, int32_t, n_edges),
        .costs = TAKE(arena, double, n_edges), .came_by = TAKE(arena, int32_t, n_edges),
        .queue = TAKE(arena, int32_t, n_faces), .heap = &heap};
    connect(&borders);
    bool *is_seen = TAKE(arena, bool, n_edges);
    int32_t *old = TAKE(arena, int32_t, 2 * n_edges), *path = TAKE(arena, int32_t, n_edges);
    for (int round = 0; round < N_ROUNDS; round++)
        move_all(&borders, round, is_seen, old, path);
    reset_arena(arena, mark);
}

/* Move the borders between labels; see `straighten_labels`. */
EXPORT int64_t straighten_borders(
    int64_t n, int64_t n_faces, const double points[n][3], const int32_t corners[n_faces][3],
    const int32_t opposite[3 * n_faces], const double weights[n_faces][3], double width,
    int32_t labels[n_faces])
{
    OPEN_ARENA(arena);
    const struct weighted_surface surface = {n_faces, points, corners, opposite, weights};
    straighten_labels(arena, &surface, width, labels);
    close_arena(arena);
    return 0;
}

/* Place the vertices of triangles that have no place in a layout: each triangle that has two unfolds
   to its shape in space, the nearest to the layout first. */
EXPORT int64_t unfold_triangles(
    int64_t n, int64_t n_faces, const double points[n][3], const int32_t faces[n_faces][3],
    bool is_placed[n], double uvs[n][2])
{
    OPEN_ARENA(arena);
    bool *is_next = TAKE(arena, bool, n);
    bool is_changed = true;
    while (is_changed) {
        is_changed = false;
        memset(is_next, 0, (size_t)n * sizeof *is_next);
        for (int64_t face = 0; face < n_faces; face++) {
            for (int k = 0; k < 3; k++) {
                const int32_t a = faces[face][k], b = faces[face][(k + 1) % 3];
                const int32_t c = faces[face][(k + 2) % 3];
                if (is_placed[c] || is_next[c] || !is_placed[a] || !is_placed[b])
                    continue;
                double along = 0.0, square = 0.0, side = 0.0;
                for (int axis = 0; axis < 3; axis++) {
                    const double x = points[b][axis] - points[a][axis];
                    const double y = points[c][axis] - points[a][axis];
                    square += x * x;
                    along += x * y;
                    side += y * y;
                }
                if (square == 0.0)
                    continue;
                along /= square;
                const double up = sqrt(max_f64(side / square - along * along, 0.0));
                const double u = uvs[b][0] - uvs[a][0], v = uvs[b][1] - uvs[a][1];
                uvs[c][0] = uvs[a][0] + along * u - up * v;
                uvs[c][1] = uvs[a][1] + along * v + up * u;
                is_next[c] = is_changed = true;
            }
        }
        for (int64_t i = 0; i < n; i++)
            is_placed[i] |= is_next[i];
    }
    close_arena(arena);
    return 0;
}
