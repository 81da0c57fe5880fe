/* Shells of a mesh, which share no vertex, by union-find.

   Based on: Tarjan, "Efficiency of a Good But Not Linear Set Union Algorithm", 1975.

   Called from texbake/mesh/topology.py. */

#include "arena.h"
#include "core.h"
#include "union_find.h"

/* Number the components in the order of their first faces; return how many. */
EXPORT int64_t number_components(
    int64_t n_vertices, int64_t n_faces, const int32_t faces[n_faces][3],
    int32_t components[n_faces])
{
    OPEN_ARENA(arena);
    int32_t *parents = TAKE(arena, int32_t, n_vertices);
    for (int64_t vertex = 0; vertex < n_vertices; vertex++)
        parents[vertex] = (int32_t)vertex;
    for (int64_t face = 0; face < n_faces; face++)
        for (int corner = 1; corner < 3; corner++)
            join_labels(parents, faces[face][0], faces[face][corner]);
    int32_t *numbers = TAKE(arena, int32_t, n_vertices);
    for (int64_t vertex = 0; vertex < n_vertices; vertex++)
        numbers[vertex] = -1;
    int32_t n_components = 0;
    for (int64_t face = 0; face < n_faces; face++) {
        const int32_t root = find_label(parents, faces[face][0]);
        if (numbers[root] < 0)
            numbers[root] = n_components++;
        components[face] = numbers[root];
    }
    close_arena(arena);
    return n_components;
}
