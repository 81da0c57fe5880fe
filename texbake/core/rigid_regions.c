/* A flat patch halved into regions of equal size, again and again, across their longer sides.

   Based on: Bentley, "Multidimensional Binary Search Trees Used for Associative Searching", 1975;
   Hoare, "Algorithm 65: Find", 1961 (medians).

   Called from flatten.c, for the preconditioner in conjugate_gradient.c. */

#include "flattening.h"

#include <math.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"

/* Least number of vertices in a region, and most halvings of the patch: 64 regions give a system of
   192 unknowns, which takes about as long as ten iterations with 3,000 vertices. */
enum { REGION_SIZE = 64, MOST_HALVINGS = 6 };

struct key {
    double value;
    int32_t vertex;
};

static inline bool comes_before(struct key a, struct key b)
{
    return a.value < b.value || (a.value == b.value && a.vertex < b.vertex);
}

/* Order keys so that the least `middle` of them come first. */
static void part_at(struct key *keys, int64_t n, int64_t middle)
{
    int64_t low = 0, high = n - 1;
    while (low < high) {
        const struct key pivot = keys[low + (high - low) / 2];
        int64_t i = low - 1, j = high + 1;
        while (true) {
            do
                i++;
            while (comes_before(keys[i], pivot));
            do
                j--;
            while (comes_before(pivot, keys[j]));
            if (i >= j)
                break;
            const struct key kept = keys[i];
            keys[i] = keys[j];
            keys[j] = kept;
        }
        if (middle <= j)
            high = j;
        else
            low = j + 1;
    }
}

static int longer_axis(const double (*uvs)[2], int64_t n, const int32_t *order)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int64_t i = 0; i < n; i++) {
        for (int axis = 0; axis < 2; axis++) {
            low[axis] = min_f64(low[axis], uvs[order[i]][axis]);
            high[axis] = max_f64(high[axis], uvs[order[i]][axis]);
        }
    }
    return high[1] - low[1] > high[0] - low[0];
}

void divide_regions(
    struct arena *arena, int64_t n, const double (*uvs)[2], int32_t *regions)
{
    const arena_mark mark = mark_arena(arena);
    int n_halvings = 0;
    while (n_halvings < MOST_HALVINGS && n >= (int64_t)REGION_SIZE << (n_halvings + 1))
        n_halvings++;
    int32_t *order = TAKE(arena, int32_t, n);
    struct key *keys = TAKE(arena, struct key, n);
    for (int64_t i = 0; i < n; i++)
        order[i] = (int32_t)i;
    for (int level = 0; level < n_halvings; level++) {
        for (int64_t region = 0; region < (int64_t)1 << level; region++) {
            const int64_t first = region * n >> level, end = (region + 1) * n >> level;
            const int64_t middle = (2 * region + 1) * n >> (level + 1);
            const int axis = longer_axis(uvs, end - first, order + first);
            for (int64_t i = first; i < end; i++)
                keys[i] = (struct key){uvs[order[i]][axis], order[i]};
            part_at(keys + first, end - first, middle - first);
            for (int64_t i = first; i < end; i++)
                order[i] = keys[i].vertex;
        }
    }
    for (int64_t region = 0; region < (int64_t)1 << n_halvings; region++)
        for (int64_t i = region * n >> n_halvings; i < (region + 1) * n >> n_halvings; i++)
            regions[order[i]] = (int32_t)region;
    reset_arena(arena, mark);
}
