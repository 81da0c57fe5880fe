/* A part of a mesh with holes, such as a tube, cut open along the shortest path between two of them.

   Based on: Dijkstra, "A Note on Two Problems in Connexion with Graphs", 1959.

   Called from chart_cutting.c. */

#include <math.h>
#include <string.h>

#include "chart_cutting.h"
#include "core.h"
#include "numbers.h"
#include "step_heap.h"
#include "union_find.h"

/* A cut leads to another loop of the boundary only if that is at least this share of the longest
   one: shorter loops, such as those of screw holes, cause little stretch. At most `MOST_CUTS` cuts
   are tried. */
static const double LEAST_LOOP = 0.1;

/* How much longer a cut may be that does not cut through polygons. */
static const double DETOUR = 10.0;
enum { MOST_CUTS = 4 };

/* The vertices of a part, and the half-edges from each to the next corner of its face. */
struct graph {
    int64_t n;
    const double (*places)[3];
    int32_t *starts, *half_edges; /* those of vertex i: starts[i] to starts[i + 1] - 1 */
    int32_t *loops;               /* of each vertex; -1 inside */
    double *loop_lengths;
    int32_t n_loops;
};

static double distance(const double a[3], const double b[3])
{
    const double x = b[0] - a[0], y = b[1] - a[1], z = b[2] - a[2];
    return sqrt(x * x + y * y + z * z);
}

static inline int32_t tail(const struct part *part, int32_t half_edge)
{
    return part->faces[half_edge / 3][half_edge % 3];
}

static inline int32_t head(const struct part *part, int32_t half_edge)
{
    return tail(part, next_corner(half_edge));
}

/* List the half-edges of each vertex, and number the loops of the boundary. */
static struct graph make_graph(
    struct arena *arena, const struct part *part, const double (*places)[3])
{
    const int32_t n = (int32_t)part->n_vertices, n_half_edges = (int32_t)(3 * part->n_faces);
    struct graph graph = {
        n, places, TAKE_ZEROS(arena, int32_t, n + 2), TAKE(arena, int32_t, n_half_edges),
        TAKE(arena, int32_t, n), TAKE_ZEROS(arena, double, n), 0};
    for (int32_t edge = 0; edge < n_half_edges; edge++)
        graph.starts[tail(part, edge) + 2]++;
    for (int32_t vertex = 2; vertex <= n; vertex++)
        graph.starts[vertex] += graph.starts[vertex - 1];
    for (int32_t edge = 0; edge < n_half_edges; edge++)
        graph.half_edges[graph.starts[tail(part, edge) + 1]++] = edge;
    for (int32_t vertex = 0; vertex < n; vertex++)
        graph.loops[vertex] = vertex;
    bool *is_open = TAKE_ZEROS(arena, bool, n);
    for (int32_t edge = 0; edge < n_half_edges; edge++) {
        if (part->opposite[edge] < 0) {
            join_labels(graph.loops, tail(part, edge), head(part, edge));
            is_open[tail(part, edge)] = true;
        }
    }
    for (int32_t vertex = 0; vertex < n; vertex++) {
        if (!is_open[vertex])
            graph.loops[vertex] = -1;
        else if (graph.loops[vertex] == vertex)
            graph.loops[vertex] = graph.n_loops++;
        else
            graph.loops[vertex] = graph.loops[graph.loops[vertex]];
    }
    for (int32_t edge = 0; edge < n_half_edges; edge++)
        if (part->opposite[edge] < 0)
            graph.loop_lengths[graph.loops[tail(part, edge)]] +=
                distance(places[tail(part, edge)], places[head(part, edge)]);
    return graph;
}

/* Cut the shortest path from loop `from` to loop `to`; return whether there is one. */
static bool cut_between(
    const struct cutting *cutting, struct part *part, const struct graph *graph, int32_t from,
    int32_t to)
{
    struct arena *arena = cutting->arena;
    double *distances = TAKE(arena, double, graph->n);
    int32_t *came_by = TAKE(arena, int32_t, graph->n); /* half-edge towards each vertex */
    const int64_t room = 3 * part->n_faces + graph->n;
    struct heap heap = {0, room, TAKE(arena, struct step, room)};
    for (int32_t vertex = 0; vertex < graph->n; vertex++) {
        distances[vertex] = INFINITY;
        came_by[vertex] = -1;
        if (graph->loops[vertex] == from) {
            distances[vertex] = 0.0;
            push(&heap, (struct step){0.0, vertex});
        }
    }
    while (heap.n > 0) {
        const struct step step = pop(&heap);
        if (step.cost > distances[step.item])
            continue;
        if (graph->loops[step.item] == to) {
            for (int32_t at = step.item; came_by[at] >= 0;) {
                const int32_t edge = came_by[at];
                at = tail(part, edge);
                part->opposite[part->opposite[edge]] = -1;
                part->opposite[edge] = -1;
            }
            return true;
        }
        for (int32_t i = graph->starts[step.item]; i < graph->starts[step.item + 1]; i++) {
            const int32_t edge = graph->half_edges[i], next = head(part, edge);
            const double length = distance(graph->places[step.item], graph->places[next]);
            const double far =
                step.cost + (is_in_polygon(cutting, part, edge) ? DETOUR : 1.0) * length;
            if (part->opposite[edge] >= 0 && far < distances[next]) {
                distances[next] = far;
                came_by[next] = edge;
                push(&heap, (struct step){far, next});
            }
        }
    }
    return false;
}

/* Cut from the longest loop of the boundary to the next one, unless that is short. */
static bool cut_once(const struct cutting *cutting, struct part *part)
{
    struct arena *arena = cutting->arena;
    const arena_mark mark = mark_arena(arena);
    const double (*places)[3] = (const double (*)[3])place_vertices(cutting, part);
    const struct graph graph = make_graph(arena, part, places);
    int32_t first = -1, second = -1;
    for (int32_t loop = 0; loop < graph.n_loops; loop++) {
        if (first < 0 || graph.loop_lengths[loop] > graph.loop_lengths[first]) {
            second = first;
            first = loop;
        } else if (second < 0 || graph.loop_lengths[loop] > graph.loop_lengths[second]) {
            second = loop;
        }
    }
    const bool is_cut = second >= 0
        && graph.loop_lengths[second] >= LEAST_LOOP * graph.loop_lengths[first]
        && cut_between(cutting, part, &graph, first, second);
    reset_arena(arena, mark);
    return is_cut;
}

bool cut_open(struct cutting *cutting, struct part *part)
{
    struct arena *arena = cutting->arena;
    struct part opened = *part;
    opened.opposite = TAKE(arena, int32_t, 3 * part->n_faces);
    memcpy(opened.opposite, part->opposite, (size_t)(3 * part->n_faces) * sizeof *part->opposite);
    for (int n_cuts = 0; n_cuts < MOST_CUTS && cut_once(cutting, &opened); n_cuts++) {
        lay_out(cutting, &opened);
        if (!opened.is_laid || opened.l2 > cutting->limits.most_l2
            || (part->is_laid && opened.l2 > part->l2))
            continue;
        for (int32_t i = 0; i < 3 * part->n_faces; i++)
            if (part->opposite[i] >= 0 && opened.opposite[i] < 0)
                cutting->opposite[3 * part->face_ids[i / 3] + i % 3] = -1;
        opened.halves = NULL;
        opened.n_halves = 0;
        *part = opened;
        return true;
    }
    return false;
}
