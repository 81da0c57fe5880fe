/* Shortest paths from the vertices of a graph to the nearest of some sources.

   Based on: Dijkstra, "A Note on Two Problems in Connexion with Graphs", 1959.

   Called from texbake/mesh/topology.py. */

#include "arena.h"
#include "core.h"
#include "step_heap.h"

/* Lower `distances` to those from further sources, and write the vertex before each on its path, -1 at
   a source. No path takes an edge of infinite cost. With a target, not -1, only distances up to its own
   are final.

   The edges from vertex i lead to `ends[rows[i]]` to `ends[rows[i + 1] - 1]`. The first call gets
   infinite distances; a later one those of the call before it. Returns 1. */
EXPORT int64_t find_shortest_paths(
    int64_t n, int64_t n_ends, int64_t n_sources, const int64_t rows[n + 1],
    const int32_t ends[n_ends], const double costs[n_ends], const int32_t sources[n_sources],
    int64_t target, double distances[n], int32_t before[n])
{
    OPEN_ARENA(arena);
    const int64_t room = n_ends + n_sources;
    struct heap heap = {0, room, TAKE(arena, struct step, room)};
    for (int64_t i = 0; i < n_sources; i++) {
        distances[sources[i]] = 0.0;
        before[sources[i]] = -1;
        push(&heap, (struct step){0.0, sources[i]});
    }
    while (heap.n > 0) {
        const struct step step = pop(&heap);
        if (step.item == target)
            break;
        if (step.cost > distances[step.item])
            continue;
        for (int64_t at = rows[step.item]; at < rows[step.item + 1]; at++) {
            const double distance = step.cost + costs[at];
            if (distance < distances[ends[at]]) {
                distances[ends[at]] = distance;
                before[ends[at]] = step.item;
                push(&heap, (struct step){distance, ends[at]});
            }
        }
    }
    close_arena(arena);
    return 1;
}
