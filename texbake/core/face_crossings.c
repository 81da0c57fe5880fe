/* Triangles that pass through one another.

   Two triangles in different planes intersect where each has corners on both sides of the other's
   plane, and the segments that they cut out of the line common to both planes overlap.

   Based on: Tomas Möller, "A fast triangle-triangle intersection test", Journal of Graphics Tools
   2(2), 1997.

   Called from texbake/checks/surface.py. */

#include <math.h>

#include "core.h"
#include "numbers.h"
#include "triangle_tree.h"

struct triangle {
    struct vector corners[3], normal;
};

struct span {
    double low, high;
};

static inline struct triangle triangle_at(
    const struct triangle_tree *tree, int64_t face, struct vector normal)
{
    return (struct triangle){
        {corner_of(tree, face, 0), corner_of(tree, face, 1), corner_of(tree, face, 2)}, normal};
}

/* Heights of a triangle's corners over the plane of another; false where they do not lie deeper than
   `depth` on both sides of it. */
static inline bool passes_plane(
    const struct triangle *plane, const struct triangle *triangle, double depth, double heights[3])
{
    for (int i = 0; i < 3; i++)
        heights[i] = dot(plane->normal, minus(triangle->corners[i], plane->corners[0]));
    return !(min_f64(min_f64(heights[0], heights[1]), heights[2]) >= -depth
             || max_f64(max_f64(heights[0], heights[1]), heights[2]) <= depth);
}

/* Ends, along a direction, of what a plane cuts out of a triangle that it passes through. */
static inline struct span cut_by_plane(
    struct vector along, const struct triangle *triangle, const double heights[3])
{
    const double places[3] = {
        dot(along, triangle->corners[0]), dot(along, triangle->corners[1]),
        dot(along, triangle->corners[2])};
    struct span cut = {INFINITY, -INFINITY};
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3;
        if ((heights[i] < 0.0) == (heights[j] < 0.0))
            continue;
        const double part = heights[i] / (heights[i] - heights[j]);
        const double place = places[i] + (places[j] - places[i]) * part;
        cut.low = min_f64(cut.low, place);
        cut.high = max_f64(cut.high, place);
    }
    return cut;
}

static bool cross_each_other(
    const struct triangle *one, const struct triangle *other, double depth)
{
    double heights_of_other[3], heights_of_one[3];
    if (!passes_plane(one, other, depth, heights_of_other)
        || !passes_plane(other, one, depth, heights_of_one))
        return false;
    const struct vector along = cross(one->normal, other->normal);
    const struct span ours = cut_by_plane(along, one, heights_of_one);
    const struct span theirs = cut_by_plane(along, other, heights_of_other);
    const double common = min_f64(ours.high, theirs.high) - max_f64(ours.low, theirs.low);
    return common > depth * sqrt(dot(along, along));
}

/* Box around a triangle: least x, y, z, then greatest. */
static void bound_triangle(const struct triangle *triangle, double box[6])
{
    const struct vector a = triangle->corners[0], b = triangle->corners[1], c = triangle->corners[2];
    box[0] = min_f64(min_f64(a.x, b.x), c.x);
    box[1] = min_f64(min_f64(a.y, b.y), c.y);
    box[2] = min_f64(min_f64(a.z, b.z), c.z);
    box[3] = max_f64(max_f64(a.x, b.x), c.x);
    box[4] = max_f64(max_f64(a.y, b.y), c.y);
    box[5] = max_f64(max_f64(a.z, b.z), c.z);
}

static inline bool boxes_apart(const float box[6], const double other[6])
{
    return box[0] > other[3] || box[3] < other[0] || box[1] > other[4] || box[4] < other[1]
        || box[2] > other[5] || box[5] < other[2];
}

enum { NO_FACE = -1, UNSURE = -2 };

/* A face that crosses one, NO_FACE, or UNSURE after a search among `most` faces. */
static int32_t find_crossing(
    const struct triangle_tree *tree, const double (*normals)[3], int32_t face,
    const struct triangle *triangle, double depth, int64_t most)
{
    double box[6];
    bound_triangle(triangle, box);
    int32_t stack[TREE_STACK_SIZE];
    int size = 1;
    int64_t n_pairs = 0;
    stack[0] = 0;
    while (size > 0) {
        const int32_t node = stack[--size];
        if (boxes_apart(tree->boxes[node], box))
            continue;
        const int32_t first = tree->nodes[node][0], count = tree->nodes[node][1];
        if (count == 0) {
            stack[size++] = first;
            stack[size++] = first + 1;
            continue;
        }
        if (n_pairs >= most)
            return UNSURE;
        n_pairs += count;
        for (int32_t slot = first; slot < first + count; slot++) {
            const int32_t other = tree->order[slot];
            const struct vector normal = vector_at(normals[other]);
            if (other == face || dot(normal, normal) == 0.0)
                continue;
            const struct triangle candidate = triangle_at(tree, other, normal);
            if (cross_each_other(triangle, &candidate, depth))
                return other;
        }
    }
    return NO_FACE;
}

/* For the faces at places start to stop - 1 in the order of the tree, one that crosses each. Those
   with a normal of zero take no part. */
EXPORT void find_crossings(
    int64_t n_vertices, int64_t n_faces, int64_t n_kept, int64_t n_nodes,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int32_t order[n_kept], const float boxes[n_nodes][6],
    const int32_t nodes[n_nodes][2], const double normals[n_faces][3], double depth, int64_t most,
    int64_t start, int64_t stop, int32_t others[n_faces], bool unsure[n_faces])
{
    const struct triangle_tree tree = {positions, faces, order, boxes, nodes};
    for (int64_t slot = start; slot < stop; slot++) {
        const int32_t face = order[slot];
        const struct vector normal = vector_at(normals[face]);
        if (dot(normal, normal) == 0.0)
            continue;
        const struct triangle triangle = triangle_at(&tree, face, normal);
        const int32_t found = find_crossing(&tree, normals, face, &triangle, depth, most);
        if (found >= 0)
            others[face] = found;
        unsure[face] |= found == UNSURE;
    }
}
