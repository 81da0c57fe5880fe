/* The tree that rays are cast into: its leaves and its boxes. Built by morton_tree.c.

   Leaves have eight triangles each, in the order of a Morton curve: their faces, whose corners are
   loaded from the mesh when a ray comes by. Node i of the lowest level holds
   the boxes of the leaves 8 i to 8 i + 7; node i of the level above, those of the nodes 8 i to
   8 i + 7; and so on up to one root. The levels stand one after another, the lowest first. No links
   are stored. */

#pragma once

#include <stdint.h>

#include "numbers.h"

#define WIDTH 8 /* triangles of a leaf, and boxes of a node */
#define MAX_LEVELS 11

/* Corners of eight triangles: row 3 c + axis holds that coordinate of corner c of all of them. */
typedef double leaf[9][WIDTH];

/* Where the triangles beyond the last one of a leaf lie. */
#define NOWHERE 1e30

/* A mesh in model units, with the numbers of its faces counted from `first`, and its local frame. */
struct tree_mesh {
    const double (*positions)[3];
    const int32_t (*faces)[3];
    int64_t first;
    const double *center;
    double scale;
};

/* Load the corners of some triangles of a leaf, in local coordinates. */
static inline void load_corners(
    const struct tree_mesh *mesh, const int32_t ids[WIDTH], int first, int end, leaf corners)
{
    for (int k = first; k < end; k++) {
        if (ids[k] < 0) {
            for (int row = 0; row < 9; row++)
                corners[row][k] = NOWHERE;
            continue;
        }
        const int32_t *face = mesh->faces[ids[k] - mesh->first];
        for (int corner = 0; corner < 3; corner++)
            for (int axis = 0; axis < 3; axis++)
                corners[3 * corner + axis][k] =
                    (mesh->positions[face[corner]][axis] - mesh->center[axis]) * mesh->scale;
    }
}

/* Boxes: least x, y, z, then greatest. Where there is no child, the least are infinite and the greatest
   minus infinite: no ray meets such a box, not even one with a NaN. */
typedef float node[6][WIDTH];

/* The lowest ten bits of a cell's number with two zeros between them; NaN is in the first cell. */
static inline uint32_t spread_bits(double cell)
{
    uint32_t x = cell > 0.0 ? (uint32_t)min_f64(cell, 1023.0) : 0;
    x = (x | (x << 16)) & 0x30000ff;
    x = (x | (x << 8)) & 0x300f00f;
    x = (x | (x << 4)) & 0x30c30c3;
    return (x | (x << 2)) & 0x9249249;
}
