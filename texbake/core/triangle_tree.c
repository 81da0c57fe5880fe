/* A bounding volume hierarchy that finds the triangle closest to a point.

   Based on: Tero Karras, "Maximizing parallelism in the construction of BVHs, octrees, and k-d
   trees", High-Performance Graphics 2012: triangles in Morton order are split where their highest
   differing bit changes. Triangles with the same code are split in the middle, which bounds the
   depth.

   Called from texbake/mesh/triangle_tree.py. */

#include "triangle_tree.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

#include "closest_on_triangle.h"
#include "core.h"
#include "numbers.h"

/* Areas of faces start to stop - 1. */
EXPORT void measure_areas(
    int64_t n_vertices, int64_t n_faces, const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], int64_t start, int64_t stop, double areas[n_faces])
{
    for (int64_t face = start; face < stop; face++) {
        const struct vector a = vector_at(positions[faces[face][0]]);
        const struct vector across = cross(
            minus(vector_at(positions[faces[face][1]]), a),
            minus(vector_at(positions[faces[face][2]]), a));
        areas[face] = 0.5 * sqrt(dot(across, across));
    }
}

/* The low 21 bits, each followed by two zeros. */
static inline uint64_t spread(uint64_t bits)
{
    bits = (bits | bits << 32) & 0x001F00000000FFFF;
    bits = (bits | bits << 16) & 0x001F0000FF0000FF;
    bits = (bits | bits << 8) & 0x100F00F00F00F00F;
    bits = (bits | bits << 4) & 0x10C30C30C30C30C3;
    return (bits | bits << 2) & 0x1249249249249249;
}

/* Keys of faces start to stop - 1: the Morton code of their center, then their id. */
EXPORT void morton_keys(
    int64_t n_vertices, int64_t n_faces,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3], const double low[3],
    double cells_a_unit, int64_t axis_bits, int64_t id_bits, int64_t start, int64_t stop,
    uint64_t keys[n_faces])
{
    for (int64_t face = start; face < stop; face++) {
        uint64_t code = 0;
        for (int axis = 0; axis < 3; axis++) {
            double least = positions[faces[face][0]][axis], most = least;
            for (int corner = 1; corner < 3; corner++) {
                const double value = positions[faces[face][corner]][axis];
                least = min_f64(least, value);
                most = max_f64(most, value);
            }
            const uint64_t cell = (uint64_t)((0.5 * least + 0.5 * most - low[axis]) * cells_a_unit);
            code |= spread(cell & ((1u << axis_bits) - 1)) << axis;
        }
        keys[face] = code << id_bits | (uint64_t)face;
    }
}

/* First place of the second half of a range that is split where the highest differing bit of its
   codes changes, or in the middle where all codes are equal. */
static int32_t split_place(const uint64_t *codes, int32_t first, int32_t count)
{
    const int32_t last = first + count - 1;
    uint64_t differing = codes[first] ^ codes[last], bit = 1;
    if (differing == 0)
        return first + count / 2;
    while (differing > 1) {
        differing >>= 1;
        bit <<= 1;
    }
    int64_t below = first, split = last; /* the first code with the bit lies in (below, split] */
    while (split - below > 1) {
        const int64_t middle = (below + split) / 2;
        if (codes[middle] & bit)
            split = middle;
        else
            below = middle;
    }
    return (int32_t)split;
}

/* The box of a leaf, rounded outward to float32. */
static void bound_faces(
    const double (*positions)[3], const int32_t (*faces)[3], const int32_t *ids, int32_t count,
    float box[6])
{
    for (int axis = 0; axis < 3; axis++) {
        double least = INFINITY, most = -INFINITY;
        for (int32_t slot = 0; slot < count; slot++) {
            for (int corner = 0; corner < 3; corner++) {
                const double value = positions[faces[ids[slot]][corner]][axis];
                least = min_f64(least, value);
                most = max_f64(most, value);
            }
        }
        box[axis] = nextafterf((float)least, -INFINITY);
        box[axis + 3] = nextafterf((float)most, INFINITY);
    }
}

/* Split ranges of the order from the top, then join boxes from the bottom; return how many nodes. */
EXPORT int64_t build_triangle_tree(
    int64_t n_vertices, int64_t n_faces, int64_t n_kept, int64_t n_most,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int32_t ids[n_kept], const uint64_t codes[n_kept], int64_t leaf_size,
    float boxes[n_most][6], int32_t nodes[n_most][2])
{
    nodes[0][0] = 0;
    nodes[0][1] = (int32_t)n_kept;
    int64_t n_nodes = 1;
    for (int64_t node = 0; node < n_nodes; node++) {
        const int32_t first = nodes[node][0], count = nodes[node][1];
        if (count <= leaf_size)
            continue;
        const int32_t split = split_place(codes, first, count);
        nodes[n_nodes][0] = first;
        nodes[n_nodes][1] = split - first;
        nodes[n_nodes + 1][0] = split;
        nodes[n_nodes + 1][1] = first + count - split;
        nodes[node][0] = (int32_t)n_nodes;
        nodes[node][1] = 0;
        n_nodes += 2;
    }
    for (int64_t node = n_nodes - 1; node >= 0; node--) { /* children come after their parent */
        const int32_t first = nodes[node][0], count = nodes[node][1];
        if (count > 0) {
            bound_faces(positions, faces, ids + first, count, boxes[node]);
            continue;
        }
        for (int axis = 0; axis < 3; axis++) {
            boxes[node][axis] = min_f32(boxes[first][axis], boxes[first + 1][axis]);
            boxes[node][axis + 3] = max_f32(boxes[first][axis + 3], boxes[first + 1][axis + 3]);
        }
    }
    return n_nodes;
}

static inline double box_distance_squared(const float box[6], struct vector p)
{
    const double dx = max_f64(max_f64(box[0] - p.x, 0.0), p.x - box[3]);
    const double dy = max_f64(max_f64(box[1] - p.y, 0.0), p.y - box[4]);
    const double dz = max_f64(max_f64(box[2] - p.z, 0.0), p.z - box[5]);
    return dx * dx + dy * dy + dz * dz;
}

/* Whether a triangle, given the edges from a to b and to c, faces the way a direction points. */
static inline bool faces_along(struct vector ab, struct vector ac, struct vector direction)
{
    return dot(cross(ab, ac), direction) > 0.0;
}

/* The face closest to a point, -1 where none is within the distance whose square comes in `best`.
   With a direction, which may be NULL, only faces that face that way count. The search ends at a face
   within the distance whose square is `enough`. */
static int32_t closest_face(
    const struct triangle_tree *tree, struct vector p, const struct vector *direction, double enough,
    struct nearness *best)
{
    int32_t stack[TREE_STACK_SIZE], best_face = -1;
    double bounds[TREE_STACK_SIZE];
    int size = 1;
    stack[0] = 0;
    bounds[0] = 0.0;
    while (size > 0) {
        size--;
        const int32_t node = stack[size];
        if (bounds[size] > best->squared || (best_face >= 0 && best->squared <= enough))
            continue;
        const int32_t first = tree->nodes[node][0], count = tree->nodes[node][1];
        for (int32_t slot = first; slot < first + count; slot++) {
            const int32_t face = tree->order[slot];
            const struct vector a = corner_of(tree, face, 0);
            const struct vector ab = minus(corner_of(tree, face, 1), a);
            const struct vector ac = minus(corner_of(tree, face, 2), a);
            if (direction != NULL && !faces_along(ab, ac, *direction))
                continue;
            const struct vector ap = minus(p, a);
            if (is_beyond(ab, ac, ap, best->squared))
                continue;
            const struct nearness near = closest_on_triangle(ab, ac, ap);
            if (near.squared < best->squared || (near.squared == best->squared && best_face < 0)) {
                *best = near;
                best_face = face;
            }
        }
        if (count == 0) {
            const double near = box_distance_squared(tree->boxes[first], p);
            const double far = box_distance_squared(tree->boxes[first + 1], p);
            const int32_t swapped = near > far;
            stack[size] = first + 1 - swapped;
            bounds[size] = max_f64(near, far);
            stack[size + 1] = first + swapped;
            bounds[size + 1] = min_f64(near, far);
            size += 2;
        }
    }
    return best_face;
}

static void write_weights(struct nearness at, double barycentrics[3])
{
    barycentrics[0] = max_f64(1.0 - at.v - at.w, 0.0);
    barycentrics[1] = at.v;
    barycentrics[2] = at.w;
}

/* Find the closest face to points start to stop - 1; where directions are given, the closest of those
   that face the way the point's direction points. Any point of a face at most `enough` away will do. */
EXPORT void closest_points(
    int64_t n_vertices, int64_t n_faces, int64_t n_kept, int64_t n_nodes, int64_t n,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int32_t order[n_kept], const float boxes[n_nodes][6], const int32_t nodes[n_nodes][2],
    const double points[n][3], OPTIONAL const double directions[n][3], double max_distance,
    double enough, int64_t start, int64_t stop, double distances[n], int32_t face_ids[n],
    double barycentrics[n][3])
{
    const struct triangle_tree tree = {positions, faces, order, boxes, nodes};
    const double limit = max_distance * max_distance;
    enough *= enough;
    struct vector nearby = corner_of(&tree, order[0], 0); /* on the surface, near the last answer */
    struct nearness last = {0.0, 0.0, 0.0};
    int32_t last_face = order[0];
    for (int64_t k = start; k < stop; k++) {
        const struct vector p = vector_at(points[k]), offset = minus(p, nearby);
        struct vector towards;
        if (directions != NULL)
            towards = vector_at(directions[k]);
        const struct vector *direction = directions != NULL ? &towards : NULL;
        struct nearness best = {0.0, 0.0, min_f64(limit, dot(offset, offset))};
        if (best.squared < min_f64(enough, limit) && direction == NULL) {
            face_ids[k] = last_face;
            distances[k] = sqrt(best.squared);
            write_weights(last, barycentrics[k]);
            continue;
        }
        int32_t face = closest_face(&tree, p, direction, enough, &best);
        if (face < 0 && !(best.squared >= limit)) {
            /* Rounding put the point nearby out of its own reach, or its face faces another way. */
            best.squared = limit;
            face = closest_face(&tree, p, direction, enough, &best);
        }
        face_ids[k] = face;
        if (face < 0) {
            distances[k] = INFINITY;
            barycentrics[k][0] = barycentrics[k][1] = barycentrics[k][2] = 0.0;
            continue;
        }
        distances[k] = sqrt(best.squared);
        write_weights(best, barycentrics[k]);
        last = best;
        last_face = face;
        const struct vector a = corner_of(&tree, face, 0);
        const struct vector on_face = weighted(
            minus(corner_of(&tree, face, 1), a), minus(corner_of(&tree, face, 2), a), best.v, best.w);
        nearby = (struct vector){a.x + on_face.x, a.y + on_face.y, a.z + on_face.z};
    }
}
