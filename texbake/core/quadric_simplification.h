/* The collapses of quadric_simplification.c, one at a time. */

#ifndef TEXBAKE_QUADRIC_SIMPLIFICATION_H
#define TEXBAKE_QUADRIC_SIMPLIFICATION_H

#include "carried_attributes.h"
#include "collapsible_mesh.h"
#include "quadric.h"

struct waiting {
    double cost;
    int32_t vertex;
};

struct simplification {
    struct collapsible_mesh mesh;
    struct carried_attributes attributes;
    bool moves; /* vertices go to the place of least error, else one end of the edge stays */
    uint8_t *n_wedges; /* of each vertex that may move: 1, 2 at a seam, and 3 for more */
    struct quadric *quadrics;
    struct quadric *so_far; /* of each vertex when the errors began anew; NULL if they never do */
    double *errors; /* of each vertex where it is */
    int32_t *targets; /* of each vertex's cheapest collapse, -1 for none */
    struct waiting *heap; /* of the vertices, by the cost of those */
    int64_t n_heap;
    bool *is_waiting; /* in the heap */
    bool *is_stale;   /* something around it has changed since its collapse was chosen */
    int32_t *around;  /* scratch */
};

void begin_simplification(struct arena *arena, struct simplification *s, bool lock_boundary);
bool collapse_cheapest(
    struct simplification *s, int32_t *u, double *cost, struct collapse *collapse);

#endif
