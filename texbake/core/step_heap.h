/* A binary heap of items by their costs, the least first, and of equal ones the lower item. */

#pragma once

#include <stdbool.h>
#include <stdint.h>

struct step {
    double cost;
    int32_t item;
};

struct heap {
    int64_t n, room; /* what does not fit is left out */
    struct step *steps;
};

static inline bool comes_before(struct step a, struct step b)
{
    return a.cost < b.cost || (a.cost == b.cost && a.item < b.item);
}

static inline void push(struct heap *heap, struct step step)
{
    if (heap->n == heap->room)
        return;
    int64_t at = heap->n++;
    while (at > 0 && comes_before(step, heap->steps[(at - 1) / 2])) {
        heap->steps[at] = heap->steps[(at - 1) / 2];
        at = (at - 1) / 2;
    }
    heap->steps[at] = step;
}

static inline struct step pop(struct heap *heap)
{
    const struct step first = heap->steps[0], last = heap->steps[--heap->n];
    int64_t at = 0;
    while (2 * at + 1 < heap->n) {
        int64_t child = 2 * at + 1;
        if (child + 1 < heap->n && comes_before(heap->steps[child + 1], heap->steps[child]))
            child++;
        if (!comes_before(heap->steps[child], last))
            break;
        heap->steps[at] = heap->steps[child];
        at = child;
    }
    heap->steps[at] = last;
    return first;
}
