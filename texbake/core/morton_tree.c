/* A tree of boxes over triangles, sorted along a Morton curve, and within nodes at medians.

   The middles of the triangles are sorted along the curve, by a radix sort whose passes are divided
   among threads: each band counts its digits, Python sums the counts, and each band then moves its
   triangles to their places. The triangles below a node are then halved three times, each time at the
   median along the axis in which their middles extend farthest, so that the boxes of its eight
   children are compact. Each child but the last is full, so that the tree has the same nodes as over
   any other order, and depends on the triangles alone, not on the bands.

   Based on: Morton, "A Computer Oriented Geodetic Data Base and a New Technique in File Sequencing",
   IBM, 1966; Bentley, "Multidimensional Binary Search Trees Used for Associative Searching",
   Communications of the ACM 18(9), 1975; Hoare, "Algorithm 65: Find", 1961, for the median.

   Called from texbake/raycast/morton_tree.py. */

#include <math.h>

#include "core.h"
#include "morton_tree.h"
#include "numbers.h"

#define DIGITS 1024 /* values of a digit of the radix sort */

/* Write the place on the curve of each triangle in the upper half of a number, and which triangle
   it is, counted from `first`, in the lower half. `box` is the least corner of the triangles' box, in
   model units, and a model unit is `cells_per_unit` cells, of 1024 along the longest side. */
EXPORT void place_on_curve(
    int64_t n, int64_t n_vertices, const double positions[n_vertices][3], const int32_t faces[n][3],
    int64_t first, const double box[3], double cells_per_unit, uint64_t places[n])
{
    for (int64_t i = 0; i < n; i++) {
        const double *a = positions[faces[i][0]], *b = positions[faces[i][1]];
        const double *c = positions[faces[i][2]];
        uint32_t key = 0;
        for (int axis = 0; axis < 3; axis++) {
            const double middle = (a[axis] + b[axis] + c[axis]) * (1.0 / 3.0);
            key |= spread_bits((middle - box[axis]) * cells_per_unit) << axis;
        }
        places[i] = (uint64_t)key << 32 | (uint64_t)(first + i);
    }
}

/* Count how often each digit occurs, from bit `shift` on. */
EXPORT void count_digits(int64_t n, const uint64_t places[n], int64_t shift, int64_t counts[1024])
{
    for (int64_t digit = 0; digit < DIGITS; digit++)
        counts[digit] = 0;
    for (int64_t i = 0; i < n; i++)
        counts[(places[i] >> shift) & (DIGITS - 1)]++;
}

/* Move each number to the place that its digit has next; `next` is advanced. */
EXPORT void move_by_digits(
    int64_t n, int64_t n_all, const uint64_t places[n], int64_t shift, int64_t next[1024],
    uint64_t sorted[n_all])
{
    for (int64_t i = 0; i < n; i++)
        sorted[next[(places[i] >> shift) & (DIGITS - 1)]++] = places[i];
}

/* Greatest float that is at most x, and least float that is at least x. */
static float rounded_down(double x)
{
    const float near = (float)x;
    return (double)near > x ? nextafterf(near, -INFINITY) : near;
}

static float rounded_up(double x)
{
    const float near = (float)x;
    return (double)near < x ? nextafterf(near, INFINITY) : near;
}

/* Write the boxes of some triangles of one leaf. Coordinates that are NaN are left out. */
static void bound_leaf(
    const struct tree_mesh *mesh, const int32_t *ids, int64_t n, node boxes, int64_t lane)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int64_t k = 0; k < n; k++)
        for (int corner = 0; corner < 3; corner++) {
            const double *position = mesh->positions[mesh->faces[ids[k]][corner]];
            for (int axis = 0; axis < 3; axis++) {
                low[axis] = position[axis] < low[axis] ? position[axis] : low[axis];
                high[axis] = position[axis] > high[axis] ? position[axis] : high[axis];
            }
        }
    for (int axis = 0; axis < 3; axis++) {
        boxes[axis][lane] = rounded_down((low[axis] - mesh->center[axis]) * mesh->scale);
        boxes[3 + axis][lane] = rounded_up((high[axis] - mesh->center[axis]) * mesh->scale);
    }
}

/* Write the faces of leaves, from the sorted triangles, and the boxes of the lowest nodes. `ids` begin
   with the first triangle of `places`. */
EXPORT void bound_leaves(
    int64_t n, int64_t n_vertices, int64_t n_faces, int64_t n_leaves, int64_t n_nodes,
    const uint64_t places[n], const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], const double center[3], double scale,
    int32_t ids[n_leaves][8], float nodes[n_nodes][6][8])
{
    const struct tree_mesh mesh = {positions, faces, 0, center, scale};
    for (int64_t at = 0; at < n_nodes * WIDTH; at++) {
        if (at >= n_leaves) {
            for (int row = 0; row < 6; row++)
                nodes[at / WIDTH][row][at % WIDTH] = row < 3 ? INFINITY : -INFINITY;
            continue;
        }
        const int64_t n_lanes = min_i64(n - at * WIDTH, WIDTH);
        for (int64_t k = 0; k < WIDTH; k++)
            ids[at][k] = k < n_lanes ? (int32_t)(uint32_t)places[at * WIDTH + k] : -1;
        bound_leaf(&mesh, ids[at], n_lanes, nodes[at / WIDTH], at % WIDTH);
    }
}

/* Write the corners of the triangles of leaves. */
EXPORT void fill_leaves(
    int64_t n_vertices, int64_t n_faces, int64_t n_leaves, const int32_t ids[n_leaves][8],
    const double positions[n_vertices][3], const int32_t faces[n_faces][3], int64_t first,
    const double center[3], double scale, double leaves[n_leaves][9][8])
{
    const struct tree_mesh mesh = {positions, faces, first, center, scale};
    for (int64_t at = 0; at < n_leaves; at++)
        load_corners(&mesh, ids[at], 0, WIDTH, leaves[at]);
}

/* Write the boxes of nodes, each around all boxes of its child. */
EXPORT void join_boxes(
    int64_t n_children, int64_t n_nodes, const float children[n_children][6][8],
    float nodes[n_nodes][6][8])
{
    for (int64_t at = 0; at < n_nodes * WIDTH; at++) {
        for (int row = 0; row < 6; row++) {
            float bound = row < 3 ? INFINITY : -INFINITY;
            if (at < n_children)
                for (int k = 0; k < WIDTH; k++) {
                    const float other = children[at][row][k];
                    bound = row < 3 ? min_f32(bound, other) : max_f32(bound, other);
                }
            nodes[at / WIDTH][row][at % WIDTH] = bound;
        }
    }
}

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
