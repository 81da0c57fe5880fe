/* Sorting triangles so that the boxes of a tree's nodes are compact.

   The triangles below a node are halved three times to give its eight children: each time at the
   median of their middles, along the axis in which the middles extend farthest. Each child but the
   last is full, so that the tree has the same nodes as a tree over any other order.

   Based on: Bentley, "Multidimensional Binary Search Trees Used for Associative Searching",
   Communications of the ACM 18(9), 1975; Hoare, "Algorithm 65: Find", Communications of the ACM
   4(7), 1961, for the median.

   Called from texbake/raycast/morton_tree.py. */

#include "core.h"
#include "morton_tree.h"
#include "numbers.h"

/* Triangles: the middles of their boxes, and the values that are sorted with them. */
struct triangles {
    int64_t n;
    float (*middles)[3];
    uint64_t *places;
};

static inline void exchange(struct triangles some, int64_t i, int64_t j)
{
    for (int axis = 0; axis < 3; axis++) {
        const float middle = some.middles[i][axis];
        some.middles[i][axis] = some.middles[j][axis];
        some.middles[j][axis] = middle;
    }
    const uint64_t place = some.places[i];
    some.places[i] = some.places[j];
    some.places[j] = place;
}

/* Move triangles so that the first `n_first` are those with the least middles along an axis. */
static void divide(struct triangles some, int64_t n_first, int axis)
{
    for (int64_t low = 0, high = some.n - 1; low < high;) {
        const float pivot = some.middles[low + (high - low) / 2][axis];
        int64_t i = low, j = high;
        while (i <= j) {
            while (some.middles[i][axis] < pivot)
                i++;
            while (some.middles[j][axis] > pivot)
                j--;
            if (i <= j)
                exchange(some, i++, j--);
        }
        if (n_first > j && n_first < i)
            return;
        low = n_first < i ? low : i;
        high = n_first > j ? high : j;
    }
}

static int longest_axis(struct triangles some)
{
    float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int64_t i = 0; i < some.n; i++)
        for (int axis = 0; axis < 3; axis++) {
            low[axis] = min_f32(low[axis], some.middles[i][axis]);
            high[axis] = max_f32(high[axis], some.middles[i][axis]);
        }
    int longest = 0;
    for (int axis = 1; axis < 3; axis++)
        if (high[axis] - low[axis] > high[longest] - low[longest])
            longest = axis;
    return longest;
}

/* Divide triangles among children of `unit` each, then those of each child, down to `least`. */
static void divide_among(struct triangles some, int64_t n_children, int64_t unit, int64_t least)
{
    if (n_children == 1) {
        if (unit > least)
            divide_among(some, WIDTH, unit / WIDTH, least);
        return;
    }
    const int64_t n_first = n_children / 2 * unit;
    struct triangles first = some;
    if (some.n > n_first) {
        divide(some, n_first, longest_axis(some));
        first.n = n_first;
        const struct triangles rest = {
            some.n - n_first, some.middles + n_first, some.places + n_first};
        divide_among(rest, n_children / 2, unit, least);
    }
    divide_among(first, n_children / 2, unit, least);
}

/* Sort the triangles of a node among its eight children of `unit` triangles each, and then those of
   all nodes below it whose children have `least` triangles or more. */
EXPORT void sort_into_nodes(
    int64_t n, float middles[n][3], uint64_t places[n], int64_t unit, int64_t least)
{
    divide_among((struct triangles){n, middles, places}, WIDTH, unit, least);
}

/* Write the middles of the triangles' boxes, in local coordinates. */
EXPORT void find_middles(
    int64_t n, int64_t n_vertices, int64_t n_faces, const uint64_t places[n],
    const double positions[n_vertices][3], const int32_t faces[n_faces][3], const double center[3],
    double scale, float middles[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const int32_t *face = faces[(uint32_t)places[i]];
        for (int axis = 0; axis < 3; axis++) {
            const double a = positions[face[0]][axis], b = positions[face[1]][axis];
            const double c = positions[face[2]][axis];
            const double low = min_f64(min_f64(a, b), c), high = max_f64(max_f64(a, b), c);
            middles[i][axis] = (float)((0.5 * (low + high) - center[axis]) * scale);
        }
    }
}
