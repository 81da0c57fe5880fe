/* Whether faces are hidden from a viewer, by rays from samples of each to the viewer.

   All in float64: this serves a few rays per face, not pictures. The boxes are those of
   `TriangleTree`.

   Based on: Möller, Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", Journal of Graphics
   Tools 2(1), 1997; Kay, Kajiya, "Ray Tracing Complex Scenes", SIGGRAPH 1986 (boxes as slabs).

   Called from texbake/mapping/classical/projector.py. */

#include <math.h>

#include "core.h"
#include "triangle_tree.h"
#include "vectors.h"

/* In units of the tree's frame, whose size is 1: 2^-36. A hit nearer than this, such as on a
   duplicate face, is contact and does not hide the point. Rounding errors stay far below it. */
static const double CONTACT = 1.0 / (1LL << 36);

/* Replaces 0 in a direction, so that its inverse is finite and 0 times the inverse is 0. */
static const double LEAST = 1e-300;

/* A ray of unit direction; `inverse` holds 1 / along. */
struct ray {
    struct vector start, along;
    double inverse[3];
    double length;
};

static inline bool meets_box(const float box[6], const struct ray *ray)
{
    const double start[3] = {ray->start.x, ray->start.y, ray->start.z};
    double near = 0.0, far = ray->length;
    for (int axis = 0; axis < 3; axis++) {
        const double a = (box[axis] - start[axis]) * ray->inverse[axis];
        const double b = (box[axis + 3] - start[axis]) * ray->inverse[axis];
        const double first = a > b ? b : a, last = a > b ? a : b;
        near = first > near ? first : near;
        far = last < far ? last : far;
    }
    return near <= far;
}

/* Whether a ray hits a triangle within its length, contact left out. */
static inline bool meets_triangle(
    struct vector a, struct vector ab, struct vector ac, const struct ray *ray)
{
    const struct vector p = cross(ray->along, ac);
    const double determinant = dot(ab, p);
    if (determinant == 0.0)
        return false;
    const struct vector offset = minus(ray->start, a);
    const double v = dot(offset, p) / determinant;
    if (!(0.0 <= v && v <= 1.0))
        return false;
    const struct vector q = cross(offset, ab);
    const double w = dot(ray->along, q) / determinant;
    if (w < 0.0 || v + w > 1.0)
        return false;
    const double distance = dot(ac, q) / determinant;
    return CONTACT < distance && distance < ray->length - CONTACT;
}

/* Whether a ray hits any face other than `own`. */
static bool is_blocked(const struct triangle_tree *tree, int32_t own, const struct ray *ray)
{
    int32_t stack[TREE_STACK_SIZE];
    int size = 1;
    stack[0] = 0;
    while (size > 0) {
        const int32_t *node = tree->nodes[stack[--size]];
        const int32_t first = node[0], count = node[1];
        for (int32_t child = first; count == 0 && child < first + 2; child++)
            if (meets_box(tree->boxes[child], ray))
                stack[size++] = child;
        for (int32_t slot = first; slot < first + count; slot++) {
            const int32_t face = tree->order[slot];
            if (face == own)
                continue;
            const struct vector a = corner_of(tree, face, 0);
            const struct vector ab = minus(corner_of(tree, face, 1), a);
            const struct vector ac = minus(corner_of(tree, face, 2), a);
            if (meets_triangle(a, ab, ac, ray))
                return true;
        }
    }
    return false;
}

/* Whether a sample of a face, given by its weights, is hidden from the viewer. */
static bool is_hidden(
    const struct triangle_tree *tree, int32_t face, const double weights[3], const double eye[4])
{
    const struct vector a = corner_of(tree, face, 0);
    const struct vector b = corner_of(tree, face, 1);
    const struct vector c = corner_of(tree, face, 2);
    const double u = weights[0], v = weights[1], w = weights[2];
    struct ray ray;
    ray.start = (struct vector){
        u * a.x + v * b.x + w * c.x, u * a.y + v * b.y + w * c.y, u * a.z + v * b.z + w * c.z};
    const struct vector towards = {
        eye[0] - eye[3] * ray.start.x, eye[1] - eye[3] * ray.start.y,
        eye[2] - eye[3] * ray.start.z};
    const double distance = sqrt(dot(towards, towards));
    if (distance == 0.0)
        return false;
    ray.along = (struct vector){towards.x / distance, towards.y / distance, towards.z / distance};
    ray.inverse[0] = 1.0 / (ray.along.x != 0.0 ? ray.along.x : LEAST);
    ray.inverse[1] = 1.0 / (ray.along.y != 0.0 ? ray.along.y : LEAST);
    ray.inverse[2] = 1.0 / (ray.along.z != 0.0 ? ray.along.z : LEAST);
    ray.length = eye[3] != 0.0 ? distance : INFINITY;
    return is_blocked(tree, face, &ray);
}

/* Write which of the faces `face_ids[start]` to `face_ids[stop - 1]` have more than half of their
   samples hidden from the viewer: `eye` is a point and 1, or a direction and 0. */
EXPORT void find_mostly_hidden(
    int64_t n_vertices, int64_t n_faces, int64_t n_kept, int64_t n_nodes, int64_t n_ids,
    int64_t n_samples,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int32_t order[n_kept], const float boxes[n_nodes][6], const int32_t nodes[n_nodes][2],
    const int32_t face_ids[n_ids], const double samples[n_samples][3], const double eye[4],
    int64_t start, int64_t stop, bool hidden[n_ids])
{
    const struct triangle_tree tree = {positions, faces, order, boxes, nodes};
    for (int64_t k = start; k < stop; k++) {
        int64_t n_blocked = 0, n_left = n_samples;
        /* Stop as soon as the remaining samples cannot change the answer. */
        while (2 * n_blocked <= n_samples && n_samples < 2 * (n_blocked + n_left)) {
            n_left--;
            n_blocked += is_hidden(&tree, face_ids[k], samples[n_left], eye);
        }
        hidden[k] = 2 * n_blocked > n_samples;
    }
}
