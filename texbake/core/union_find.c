/* Union-find with path halving: the connected groups of items.

   Roots are the least items of their groups, so that one pass numbers the groups in the order of
   their first items.

   Based on: Tarjan, "Efficiency of a Good But Not Linear Set Union Algorithm", 1975.

   Called from texbake/mapping/seams.py and texbake/mesh/repair.py. */

#include "core.h"

static int32_t find_root(int32_t *labels, int32_t item)
{
    while (labels[item] != item) {
        labels[item] = labels[labels[item]];
        item = labels[item];
    }
    return item;
}

/* Merge the groups of each pair, then replace the label of each item by the number of its group.
   `labels` comes with each item's own number. */
void merge_labels(
    int64_t n_items, int64_t n_pairs,
    int32_t labels[n_items], const int32_t firsts[n_pairs], const int32_t seconds[n_pairs])
{
    for (int64_t pair = 0; pair < n_pairs; pair++) {
        const int32_t one = find_root(labels, firsts[pair]);
        const int32_t other = find_root(labels, seconds[pair]);
        if (one < other)
            labels[other] = one;
        else
            labels[one] = other;
    }
    int32_t n_labels = 0;
    for (int64_t item = 0; item < n_items; item++) {
        if (labels[item] == item)
            labels[item] = n_labels++;
        else
            labels[item] = labels[labels[item]];
    }
}
