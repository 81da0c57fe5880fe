/* Union-find with path halving: the connected groups of items, and the shells of a mesh.

   Roots are the least items of their groups, so that one pass numbers the groups in the order of
   their first items.

   Based on: Tarjan, "Efficiency of a Good But Not Linear Set Union Algorithm", 1975.

   Called from texbake/mapping/seams.py, texbake/mesh/hard_edges.py, texbake/mesh/topology.py and
   texbake/mesh/remeshing/boundary.py. */

#include "arena.h"
#include "core.h"
#include "union_find.h"

/* Merge the groups of each pair, then replace the label of each item by the number of its group.
   `labels` comes with each item's own number. */
EXPORT void merge_labels(
    int64_t n_items, int64_t n_pairs,
    int32_t labels[n_items], const int32_t firsts[n_pairs], const int32_t seconds[n_pairs])
{
    for (int64_t pair = 0; pair < n_pairs; pair++)
        join_labels(labels, firsts[pair], seconds[pair]);
    number_labels(labels, n_items);
}

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
