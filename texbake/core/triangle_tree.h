/* A tree of boxes around triangles, as `TriangleTree` in texbake/mesh/triangle_tree.py holds it. */

#pragma once

#include <stdint.h>

#include "vectors.h"

/* Levels: one for each of the 63 bits that triangles are split by at most, one for each halving of
   the 2^31 triangles at most of one code. A stack holds one node per level, and two at the last. */
enum { TREE_STACK_SIZE = 63 + 31 + 2 };

struct triangle_tree {
    const double (*positions)[3];
    const int32_t (*faces)[3];
    const int32_t *order;    /* face ids, so that those below a node are contiguous */
    const float (*boxes)[6]; /* least x, y, z, then greatest of each node, rounded outward */
    const int32_t (*nodes)[2]; /* a leaf: its first place in `order`, and how many; else the first
                                  of its two children, which are neighbors, and 0 */
};

static inline struct vector corner_of(const struct triangle_tree *tree, int64_t face, int corner)
{
    return vector_at(tree->positions[tree->faces[face][corner]]);
}
