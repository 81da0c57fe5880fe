/* Union-find with path halving: the connected groups of items.

   Roots are the least items of their groups, so that one pass numbers the groups in the order of
   their first items.

   Based on: Tarjan, "Efficiency of a Good But Not Linear Set Union Algorithm", 1975.

   Called from texbake/mapping/seams.py and texbake/mesh/hard_edges.py. */

#include "union_find.h"

#include "core.h"

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
