/* Union-find with path halving, for other files of the core. */

#pragma once

#include <stdint.h>

/* The least item of a group; `labels` leads there from each item. */
static inline int32_t find_label(int32_t *labels, int32_t item)
{
    while (labels[item] != item) {
        labels[item] = labels[labels[item]];
        item = labels[item];
    }
    return item;
}

static inline void join_labels(int32_t *labels, int32_t first, int32_t second)
{
    const int32_t one = find_label(labels, first), other = find_label(labels, second);
    if (one < other)
        labels[other] = one;
    else
        labels[one] = other;
}

/* Number the groups in the order of their first items; return how many there are. */
static inline int32_t number_labels(int32_t *labels, int64_t n_items)
{
    int32_t n_labels = 0;
    for (int64_t item = 0; item < n_items; item++) {
        if (labels[item] == item)
            labels[item] = n_labels++;
        else
            labels[item] = labels[labels[item]];
    }
    return n_labels;
}
