/* The walk of a single ray through a tree: which boxes of a node it meets, which triangles of a leaf it
   may meet, and where.

   A ray is tested against the eight boxes of a node at a time, in float32; the boxes are enlarged
   by more than the rounding error. */

#pragma once

#if defined(__SSE2__)
#include <immintrin.h>
#endif
#include <stdbool.h>
#include <stdint.h>

#include "morton_tree.h"
#include "numbers.h"
#include "ray_triangle.h"

/* The tree that rays walk: a node is identified by its level and its index there, a leaf by its
   index. */
struct ray_tree {
    const leaf *leaves;          /* NULL where their corners are loaded from `mesh` */
    const int32_t (*ids)[WIDTH]; /* faces of the triangles; NULL where they are not needed */
    struct tree_mesh mesh;
    const node *levels[MAX_LEVELS]; /* the nodes of each level, the lowest first */
    int n_levels;
    double box[6]; /* of all triangles */
    double size;   /* the greatest coordinate of a corner */
};

/* Distances are in units of the direction's length, which need not be 1. */
struct single_ray {
    double origin[3], direction[3], length;
};

#define STACK (MAX_LEVELS * WIDTH + 1)
/* Error of the box tests in float32, relative to the size of the tree and the distance of the ray:
   six roundings of 2^-24, with a margin. */
#define SLACK 0x1p-20
/* The greatest inverse of a direction. A larger one belongs to an axis along which the ray hardly
   moves, so that it never leaves a box there. */
#define MOST_INVERSE 1e18

/* A ray, prepared for the tests of boxes and of triangles. */
struct walk {
    int near[3], far[3]; /* rows of a node: the sides of the boxes that the ray meets first and last */
    float enters[3], leaves[3], inverse[3]; /* where it starts, moved by the slack */
    int order[3];        /* axes; along the last one the ray goes farthest */
    double origin[3], inverses[3];
    struct ray_line line;
    double doubt;        /* an edge function above this has a certain sign */
};

struct place {
    int32_t level, at; /* of a node; a leaf at level -1 */
    float near;
};

static inline struct ray_tree ray_tree_of(
    const node *nodes, int64_t n_levels, const int64_t *starts, const double box[6])
{
    struct ray_tree tree = {.n_levels = (int)min_i64(n_levels, MAX_LEVELS)};
    for (int level = 0; level < tree.n_levels; level++)
        tree.levels[level] = nodes + starts[level];
    for (int k = 0; k < 6; k++) {
        tree.box[k] = box[k];
        tree.size = max_f64(tree.size, fabs(box[k]));
    }
    return tree;
}

/* The corners of a leaf, which are loaded into `scratch` where the tree does not have them. */
static inline const double (*corners_of(const struct ray_tree *tree, int64_t at, leaf scratch))[WIDTH]
{
    if (tree->leaves)
        return tree->leaves[at];
    load_corners(&tree->mesh, tree->ids[at], 0, WIDTH, scratch);
    return (const double (*)[WIDTH])scratch;
}

static inline void start_walk(
    struct walk *walk, const struct ray_tree *tree, const struct single_ray *ray)
{
    const double *o = ray->origin, *d = ray->direction;
    double reach = tree->size;
    int z = 0;
    for (int axis = 0; axis < 3; axis++) {
        reach = max_f64(reach, fabs(o[axis]));
        if (fabs(d[axis]) > fabs(d[z]))
            z = axis;
    }
    for (int axis = 0; axis < 3; axis++) {
        const bool descends = d[axis] < 0.0;
        const double slack = descends ? -2.0 * SLACK * reach : 2.0 * SLACK * reach;
        const double inverse = min_f64(1.0 / fabs(d[axis]), MOST_INVERSE);
        walk->near[axis] = descends ? 3 + axis : axis;
        walk->far[axis] = descends ? axis : 3 + axis;
        walk->enters[axis] = (float)(o[axis] + slack);
        walk->leaves[axis] = (float)(o[axis] - slack);
        walk->origin[axis] = o[axis];
        walk->inverses[axis] = descends ? -inverse : inverse;
        walk->inverse[axis] = (float)walk->inverses[axis];
    }
    /* x and y are swapped if z descends, which preserves the winding. */
    const int x = (z + 1 + (d[z] < 0.0)) % 3, y = (z + 2 - (d[z] < 0.0)) % 3;
    walk->order[0] = x, walk->order[1] = y, walk->order[2] = z;
    walk->line = (struct ray_line){o[x], o[y], o[z], d[x] / d[z], d[y] / d[z], d[z]};
    /* A corner is at most 4 times the reach from the ray, along x or y; a product is at most the square
       of that, and the sign of a difference of two is certain beyond 4 roundings of each. */
    walk->doubt = 16e-15 * reach * reach;
}

/* One bit for each lane that is not 0. */
static inline unsigned mask_of(const int32_t lanes[WIDTH])
{
#if defined(__AVX2__)
    const __m256i all = _mm256_loadu_si256((const __m256i *)lanes);
    return (unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(all));
#elif defined(__SSE2__)
    const __m128i low = _mm_loadu_si128((const __m128i *)lanes);
    const __m128i high = _mm_loadu_si128((const __m128i *)(lanes + 4));
    return (unsigned)_mm_movemask_ps(_mm_castsi128_ps(low)) |
           (unsigned)_mm_movemask_ps(_mm_castsi128_ps(high)) << 4;
#else
    unsigned bits = 0;
    for (int k = 0; k < WIDTH; k++)
        bits |= (unsigned)(lanes[k] != 0) << k;
    return bits;
#endif
}

/* The boxes of a node that the ray meets, as bits, and the distances. */
static inline unsigned meets(
    const struct walk *walk, const node boxes, float length, float nears[WIDTH])
{
    const float *restrict rows[6];
    for (int axis = 0; axis < 3; axis++) {
        rows[axis] = boxes[walk->near[axis]];
        rows[3 + axis] = boxes[walk->far[axis]];
    }
    int32_t met[WIDTH];
    for (int k = 0; k < WIDTH; k++) {
        const float x = (rows[0][k] - walk->enters[0]) * walk->inverse[0];
        const float y = (rows[1][k] - walk->enters[1]) * walk->inverse[1];
        const float z = (rows[2][k] - walk->enters[2]) * walk->inverse[2];
        const float far_x = (rows[3][k] - walk->leaves[0]) * walk->inverse[0];
        const float far_y = (rows[4][k] - walk->leaves[1]) * walk->inverse[1];
        const float far_z = (rows[5][k] - walk->leaves[2]) * walk->inverse[2];
        nears[k] = max_f32(max_f32(x, y), max_f32(z, 0.0f));
        const float far = min_f32(min_f32(far_x, far_y), min_f32(far_z, length));
        met[k] = nears[k] <= far ? -1 : 0;
    }
    return mask_of(met);
}

/* The triangles of a leaf that the line of a ray may meet, as bits: it misses the others for certain. */
static inline unsigned may_cross(const struct walk *walk, const leaf corners)
{
    const double *restrict p[9];
    for (int row = 0; row < 9; row++)
        p[row] = corners[row - row % 3 + walk->order[row % 3]];
    const double x = walk->line.x, y = walk->line.y, z = walk->line.z;
    const double slope_x = walk->line.slope_x, slope_y = walk->line.slope_y, doubt = walk->doubt;
    int32_t met[WIDTH];
    for (int k = 0; k < WIDTH; k++) {
        const double az = p[2][k] - z, bz = p[5][k] - z, cz = p[8][k] - z;
        const double ax = p[0][k] - x - slope_x * az, ay = p[1][k] - y - slope_y * az;
        const double bx = p[3][k] - x - slope_x * bz, by = p[4][k] - y - slope_y * bz;
        const double cx = p[6][k] - x - slope_x * cz, cy = p[7][k] - y - slope_y * cz;
        const double u = cx * by - cy * bx, v = ax * cy - ay * cx, w = bx * ay - by * ax;
        const double least = min_f64(min_f64(u, v), w), greatest = max_f64(max_f64(u, v), w);
        met[k] = ((least < -doubt) & (greatest > doubt)) ? 0 : -1;
    }
    return mask_of(met);
}

/* A length plus the error of the box tests. */
static inline float lengthened(double length)
{
    return (float)(length * (1.0 + 4.0 * SLACK));
}

/* Put the boxes of a node that the ray meets on the stack, the nearest on top; return its depth. */
static inline int push_nearest(
    const struct walk *walk, const struct ray_tree *tree, struct place place, float length,
    struct place stack[STACK], int depth)
{
    float nears[WIDTH];
    unsigned bits = meets(walk, tree->levels[place.level][place.at], length, nears);
    for (const int bottom = depth; bits; bits &= bits - 1) {
        const int k = __builtin_ctz(bits);
        int at = depth++;
        for (; at > bottom && stack[at - 1].near < nears[k]; at--)
            stack[at] = stack[at - 1];
        stack[at] = (struct place){place.level - 1, place.at * WIDTH + k, nears[k]};
    }
    return depth;
}

/* A distance, clamped to where the ray is in the box of a triangle. For a triangle seen edge-on,
   rounding decides the distance; the clamp keeps the hit in its box, so boxes can be skipped. */
static inline double held_to_box(const struct walk *walk, const leaf corners, int k, double distance)
{
    double enters = -INFINITY, leaves = INFINITY;
    for (int axis = 0; axis < 3; axis++) {
        if (fabs(walk->inverses[axis]) >= MOST_INVERSE)
            continue; /* it hardly moves along this axis, on which a side of the box may be its start */
        const double a = corners[axis][k], b = corners[3 + axis][k], c = corners[6 + axis][k];
        const double first = (min_f64(min_f64(a, b), c) - walk->origin[axis]) * walk->inverses[axis];
        const double second = (max_f64(max_f64(a, b), c) - walk->origin[axis]) * walk->inverses[axis];
        enters = max_f64(enters, min_f64(first, second));
        leaves = min_f64(leaves, max_f64(first, second));
    }
    return min_f64(max_f64(distance, enters), leaves);
}

/* Distance at which the line of a ray meets a triangle, or NaN. */
static inline double distance_of(const struct walk *walk, const leaf corners, int k)
{
    const struct crossing hit = intersect(&walk->line, walk->order, corners, k);
    return hit.total != 0.0 ? held_to_box(walk, corners, k, hit.distance) : NAN;
}
