/* Rays against a tree of triangles, one by one: whether a ray is blocked, or how far it goes. */

#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "morton_tree.h"

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

struct ray_tree ray_tree_of(
    const leaf *leaves, const node *nodes, int64_t n_levels, const int64_t *starts,
    const double box[6]);

/* Whether the ray hits a triangle within its length. `blocker` is a leaf to test first, or -1; a
   leaf that blocks the ray is written to it. */
bool is_blocked(const struct ray_tree *tree, const struct single_ray *ray, int64_t *blocker);

/* Distance of the first hit within the length of the ray; without a hit, the length. */
double free_length(const struct ray_tree *tree, const struct single_ray *ray);
