/* Rays against a tree of triangles, one by one, and hemispheres of them from points of a surface, cast
   one direction at a time for 16 hemispheres.

   A ray is tested against the eight boxes of a node at a time, in float32; the boxes are enlarged
   by more than the rounding error. Then it is tested against the eight triangles of a leaf, in
   float64, as in ray_triangle.h. Both tests give the same results on any processor. The hit depends
   only on the ray and the triangles, not on the tree or the order in which it is walked. Hemispheres
   of neighboring texels follow each other, and so do their rays in one direction: a triangle that
   blocks one ray often blocks the next.

   Based on: Wald, Benthin, Boulos, "Getting Rid of Packets: Efficient SIMD Single-Ray Traversal
   using Multi-branching BVHs", 2008; Duff et al., "Building an Orthonormal Basis, Revisited", 2017,
   for the frames.

   Called from texbake/raycast/scene.py and texbake/baking/secondary_rays.py. */

#if defined(__SSE2__)
#include <immintrin.h>
#endif
#include <stdbool.h>
#include <stdint.h>

#include "core.h"
#include "morton_tree.h"
#include "numbers.h"
#include "ray_triangle.h"

/* The tree that rays walk: a node is identified by its level and its index there, a leaf by its
   index. */
struct ray_tree {
    const leaf *leaves;
    const node *levels[MAX_LEVELS]; /* the nodes of each level, the lowest first */
    int n_levels;
    double size; /* the greatest coordinate of a corner */
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

static struct ray_tree ray_tree_of(
    const leaf *leaves, const node *nodes, int64_t n_levels, const int64_t *starts,
    const double box[6])
{
    struct ray_tree tree = {.leaves = leaves, .n_levels = (int)min_i64(n_levels, MAX_LEVELS)};
    for (int level = 0; level < tree.n_levels; level++)
        tree.levels[level] = nodes + starts[level];
    for (int k = 0; k < 6; k++)
        tree.size = max_f64(tree.size, fabs(box[k]));
    return tree;
}

static void start_walk(
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

/* A distance, clamped to where the ray is in the box of a triangle. For a triangle seen edge-on,
   rounding decides the distance; the clamp keeps the hit in its box, so boxes can be skipped. */
static double held_to_box(const struct walk *walk, const leaf corners, int k, double distance)
{
    double enters = -INFINITY, leaves = INFINITY;
    for (int axis = 0; axis < 3; axis++) {
        const double a = corners[axis][k], b = corners[3 + axis][k], c = corners[6 + axis][k];
        const double first = (min_f64(min_f64(a, b), c) - walk->origin[axis]) * walk->inverses[axis];
        const double second = (max_f64(max_f64(a, b), c) - walk->origin[axis]) * walk->inverses[axis];
        enters = max_f64(enters, min_f64(first, second));
        leaves = min_f64(leaves, max_f64(first, second));
    }
    return min_f64(max_f64(distance, enters), leaves);
}

/* Distance at which the line of a ray meets a triangle, or NaN. */
static double distance_of(const struct walk *walk, const leaf corners, int k)
{
    const struct crossing hit = intersect(&walk->line, walk->order, corners, k);
    return hit.total != 0.0 ? held_to_box(walk, corners, k, hit.distance) : NAN;
}

/* Least distance, from 0 to `most`, at which the ray meets a triangle of a leaf; infinite if none. */
static inline double leaf_distance(const struct walk *walk, const leaf corners, double most)
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
    double nearest = INFINITY;
    for (unsigned bits = mask_of(met); bits; bits &= bits - 1) {
        const double distance = distance_of(walk, corners, __builtin_ctz(bits));
        if (distance >= 0.0 && distance <= most && distance < nearest)
            nearest = distance;
    }
    return nearest;
}

/* A length plus the error of the box tests. */
static inline float lengthened(double length)
{
    return (float)(length * (1.0 + 4.0 * SLACK));
}

/* Whether the ray hits a triangle within its length. `blocker` is a leaf to test first, or -1; a
   leaf that blocks the ray is written to it. */
static bool is_blocked(const struct ray_tree *tree, const struct single_ray *ray, int64_t *blocker)
{
    struct walk walk;
    start_walk(&walk, tree, ray);
    if (*blocker >= 0 && leaf_distance(&walk, tree->leaves[*blocker], ray->length) < INFINITY)
        return true;
    const float length = lengthened(ray->length);
    struct place stack[STACK];
    stack[0] = (struct place){tree->n_levels - 1, 0, 0.0f};
    for (int depth = tree->n_levels > 0; depth > 0;) {
        const struct place place = stack[--depth];
        float nears[WIDTH];
        unsigned bits = meets(&walk, tree->levels[place.level][place.at], length, nears);
        for (; bits; bits &= bits - 1) {
            const int32_t at = place.at * WIDTH + __builtin_ctz(bits);
            if (place.level > 0) {
                stack[depth++] = (struct place){place.level - 1, at, 0.0f};
            } else if (leaf_distance(&walk, tree->leaves[at], ray->length) < INFINITY) {
                *blocker = at;
                return true;
            }
        }
    }
    *blocker = -1;
    return false;
}

/* Distance of the first hit within the length of the ray; without a hit, the length. */
static double free_length(const struct ray_tree *tree, const struct single_ray *ray)
{
    struct walk walk;
    start_walk(&walk, tree, ray);
    double free = ray->length;
    struct place stack[STACK];
    stack[0] = (struct place){tree->n_levels - 1, 0, 0.0f};
    for (int depth = tree->n_levels > 0; depth > 0;) {
        const struct place place = stack[--depth];
        if (place.near > lengthened(free))
            continue;
        if (place.level < 0) {
            free = min_f64(free, leaf_distance(&walk, tree->leaves[place.at], free));
            continue;
        }
        float nears[WIDTH];
        unsigned bits = meets(&walk, tree->levels[place.level][place.at], lengthened(free), nears);
        for (const int bottom = depth; bits; bits &= bits - 1) {
            const int k = __builtin_ctz(bits);
            int at = depth++;
            for (; at > bottom && stack[at - 1].near < nears[k]; at--) /* the nearest is next */
                stack[at] = stack[at - 1];
            stack[at] = (struct place){place.level - 1, place.at * WIDTH + k, nears[k]};
        }
    }
    return free;
}

#define TOGETHER 16 /* hemispheres whose rays are cast in turn */

/* Columns of the results: texbake/raycast/rays.py. */
enum { OPEN, OPEN_DIRECTION, DEPTH = OPEN_DIRECTION + 3, N_COLUMNS };

/* Two tangents and the axis of a hemisphere, and the normal of the plane its rays stay above. */
struct hemisphere {
    double frame[3][3], plane[3];
};

static struct hemisphere frame_hemisphere(const float axis[3], const float plane[3])
{
    const double x = axis[0], y = axis[1], z = axis[2], sign = z >= 0.0 ? 1.0 : -1.0;
    const double a = -1.0 / (sign + z), b = x * y * a;
    return (struct hemisphere){
        {{1.0 + sign * x * x * a, sign * b, -sign * x}, {b, sign + y * y * a, -y}, {x, y, z}},
        {plane[0], plane[1], plane[2]}};
}

/* Turn a direction into the frame of a hemisphere, mirrored at the plane if it points below. */
static void turn_direction(const struct hemisphere *at, const float local[3], double direction[3])
{
    double height = 0.0;
    for (int k = 0; k < 3; k++) {
        direction[k] = local[0] * at->frame[0][k] + local[1] * at->frame[1][k] +
                       local[2] * at->frame[2][k];
        height += direction[k] * at->plane[k];
    }
    const double below = 2.0 * min_f64(height, 0.0);
    for (int k = 0; k < 3; k++)
        direction[k] -= below * at->plane[k];
}

/* A ray that starts an offset above a plane (side 1) or below it (-1) and goes to that side. */
static struct single_ray ray_from(
    const double point[3], const double plane[3], double offset, const double direction[3],
    double side, double length)
{
    struct single_ray ray = {.length = length};
    for (int k = 0; k < 3; k++) {
        ray.origin[k] = point[k] + side * offset * plane[k];
        ray.direction[k] = side * direction[k];
    }
    return ray;
}

/* Cast hemispheres, and write what their rays meet; `sets` are sets of n_rays directions. Rays of
   length 0 are not cast. */
EXPORT void cast_hemispheres(
    int64_t n, int64_t n_directions, int64_t n_leaves, int64_t n_nodes, int64_t n_levels,
    const double points[n][3], const float axes[n][3], const float planes[n][3],
    const uint32_t set_ids[n], const float sets[n_directions][3], int64_t n_rays, double offset,
    double outer, double inner, const double leaves[n_leaves][9][8],
    const float nodes[n_nodes][6][8], const int64_t starts[n_levels], const double box[6],
    float results[n][5])
{
    const struct ray_tree tree = ray_tree_of(leaves, nodes, n_levels, starts, box);
    for (int64_t first = 0; first < n; first += TOGETHER) {
        const int64_t n_hemispheres = min_i64(n - first, TOGETHER);
        struct hemisphere hemispheres[TOGETHER];
        double sums[TOGETHER][N_COLUMNS] = {{0}};
        for (int64_t i = 0; i < n_hemispheres; i++)
            hemispheres[i] = frame_hemisphere(axes[first + i], planes[first + i]);
        for (int64_t j = 0; j < n_rays; j++) {
            int64_t blocker = -1;
            for (int64_t i = 0; i < n_hemispheres; i++) {
                const double *point = points[first + i], *plane = hemispheres[i].plane;
                double direction[3], *sum = sums[i];
                turn_direction(&hemispheres[i], sets[set_ids[first + i] * n_rays + j], direction);
                if (outer > 0.0) {
                    const struct single_ray ray =
                        ray_from(point, plane, offset, direction, 1.0, outer);
                    if (!is_blocked(&tree, &ray, &blocker)) {
                        sum[OPEN] += 1.0;
                        for (int k = 0; k < 3; k++)
                            sum[OPEN_DIRECTION + k] += direction[k];
                    }
                }
                if (inner > 0.0) {
                    const struct single_ray ray =
                        ray_from(point, plane, offset, direction, -1.0, inner);
                    sum[DEPTH] += free_length(&tree, &ray);
                }
            }
        }
        for (int64_t i = 0; i < n_hemispheres; i++) {
            float *result = results[first + i];
            const double *sum = sums[i];
            if (outer > 0.0) {
                result[OPEN] = (float)(sum[OPEN] / (double)n_rays);
                for (int k = 0; k < 3; k++)
                    result[OPEN_DIRECTION + k] = sum[OPEN] > 0.0
                                                     ? (float)(sum[OPEN_DIRECTION + k] / (double)n_rays)
                                                     : axes[first + i][k];
            }
            if (inner > 0.0)
                result[DEPTH] = (float)(sum[DEPTH] / (double)n_rays);
        }
    }
}

/* One over the length of a vector, 0 for a zero vector. */
static double inverse_length(const double vector[3])
{
    const double square = vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2];
    return square > 0.0 ? 1.0 / sqrt(square) : 0.0;
}

/* Write the point, the shading normal and the face normal of each hit, in the local frame. */
EXPORT void place_hemispheres(
    int64_t n, int64_t n_vertices, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const float barycentrics[n][2], const double positions[n_vertices][3],
    const int32_t corners[n_faces][3], const double center[3], double scale,
    const float normals[n_normals][3], const int32_t normal_corners[n_faces][3],
    double points[n][3], float axes[n][3], float planes[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const double b = barycentrics[i][0], c = barycentrics[i][1], a = 1.0 - b - c;
        const int32_t *corner = corners[faces[i]], *normal = normal_corners[faces[i]];
        const double *p = positions[corner[0]], *q = positions[corner[1]], *r = positions[corner[2]];
        double axis[3], plane[3];
        for (int x = 0; x < 3; x++) {
            const int y = (x + 1) % 3, z = (x + 2) % 3;
            points[i][x] = (a * p[x] + b * q[x] + c * r[x] - center[x]) * scale;
            axis[x] = a * normals[normal[0]][x] +
                      (double)(barycentrics[i][0] * normals[normal[1]][x]) +
                      (double)(barycentrics[i][1] * normals[normal[2]][x]);
            plane[x] = ((q[y] - p[y]) * scale) * ((r[z] - p[z]) * scale) -
                       ((q[z] - p[z]) * scale) * ((r[y] - p[y]) * scale);
        }
        const double to_axis = inverse_length(axis);
        double to_plane = inverse_length(plane);
        if (axis[0] * plane[0] + axis[1] * plane[1] + axis[2] * plane[2] < 0.0)
            to_plane = -to_plane;
        for (int x = 0; x < 3; x++) {
            axes[i][x] = (float)(axis[x] * to_axis);
            planes[i][x] = to_plane != 0.0 ? (float)(plane[x] * to_plane) : axes[i][x];
        }
    }
}
