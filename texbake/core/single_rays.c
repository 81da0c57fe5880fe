/* Rays against a tree of triangles, one by one, and hemispheres of them from points of a surface.

   A ray is tested against the eight boxes of a node at a time, in float32; the boxes are enlarged
   by more than the rounding error. Then it is tested against the eight triangles of a leaf, in
   float64, as in ray_triangle.h. Both tests give the same results on any processor. The hit depends
   only on the ray and the triangles, not on the tree or the order in which it is walked. The outer
   rays of a hemisphere need no distances and are cast together, by ray_fans.h.

   Based on: Wald, Benthin, Boulos, "Getting Rid of Packets: Efficient SIMD Single-Ray Traversal
   using Multi-branching BVHs", 2008; Duff et al., "Building an Orthonormal Basis, Revisited", 2017,
   for the frames.

   Called from texbake/raycast/scene.py and texbake/baking/secondary_rays.py. */

#include "core.h"
#include "ray_fans.h"

/* Least distance, from 0 to `most`, at which the ray meets a triangle of a leaf; infinite if none. */
static inline double leaf_distance(const struct walk *walk, const leaf corners, double most)
{
    double nearest = INFINITY;
    for (unsigned bits = may_cross(walk, corners); bits; bits &= bits - 1) {
        const double distance = distance_of(walk, corners, __builtin_ctz(bits));
        if (distance >= 0.0 && distance <= most && distance < nearest)
            nearest = distance;
    }
    return nearest;
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
        depth = push_nearest(&walk, tree, place, lengthened(free), stack, depth);
    }
    return free;
}

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

/* Write directions turned into the frame of a hemisphere, mirrored at the plane if they point below. */
static void turn_directions(
    const struct hemisphere *at, int n, const float local[][3], double directions[3][FAN])
{
    double below[FAN] = {0};
    for (int k = 0; k < 3; k++)
        for (int j = 0; j < n; j++) {
            directions[k][j] = local[j][0] * at->frame[0][k] + local[j][1] * at->frame[1][k] +
                               local[j][2] * at->frame[2][k];
            below[j] += directions[k][j] * at->plane[k];
        }
    for (int k = 0; k < 3; k++)
        for (int j = 0; j < n; j++)
            directions[k][j] -= 2.0 * min_f64(below[j], 0.0) * at->plane[k];
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
    struct ray_tree tree = ray_tree_of(nodes, n_levels, starts, box);
    tree.leaves = leaves;
    for (int64_t i = 0; i < n; i++) {
        const struct hemisphere hemisphere = frame_hemisphere(axes[i], planes[i]);
        double sum[N_COLUMNS] = {0};
        for (int64_t first = 0; first < n_rays; first += FAN) {
            struct fan fan;
            fan.n = (int)min_i64(n_rays - first, FAN);
            turn_directions(
                &hemisphere, fan.n, sets + set_ids[i] * n_rays + first, fan.directions);
            if (outer > 0.0) {
                place_fan(&fan, &tree, points[i], hemisphere.plane, offset, outer);
                cast_fan(&fan, &tree);
                sum[OPEN] += __builtin_popcountll(fan.open);
                for (uint64_t bits = fan.open; bits; bits &= bits - 1)
                    for (int k = 0; k < 3; k++)
                        sum[OPEN_DIRECTION + k] += fan.directions[k][__builtin_ctzll(bits)];
            }
            if (inner > 0.0) {
                place_fan(&fan, &tree, points[i], hemisphere.plane, -offset, inner);
                for (int j = 0; j < fan.n; j++) {
                    const struct single_ray ray = ray_of(&fan, j, -1.0);
                    sum[DEPTH] += free_length(&tree, &ray);
                }
            }
        }
        float *result = results[i];
        if (outer > 0.0) {
            result[OPEN] = (float)(sum[OPEN] / (double)n_rays);
            for (int k = 0; k < 3; k++)
                result[OPEN_DIRECTION + k] =
                    sum[OPEN] > 0.0 ? (float)(sum[OPEN_DIRECTION + k] / (double)n_rays) : axes[i][k];
        }
        if (inner > 0.0)
            result[DEPTH] = (float)(sum[DEPTH] / (double)n_rays);
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
