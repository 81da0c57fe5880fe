/* Whether the boundary of a flat patch meets itself, for other files of the core. */

#ifndef TEXBAKE_BOUNDARY_MEETING_H
#define TEXBAKE_BOUNDARY_MEETING_H

#include <stdint.h>

struct arena;

/* Borders count as touching, not overlapping, up to this share of the longer side of the layout:
   2^-21. */
#define TOUCH_DEPTH (1.0 / (1 << 21))

/* How edges meet, the least first. */
enum { APART, TOUCHING, CROSSING };

/* Directed edges between vertices of a layout, and the loop of each. */
struct boundary {
    int64_t n_edges;
    const int32_t (*edges)[2];
    const int32_t *loops;
};

int64_t boundary_meets(
    struct arena *arena, const double (*uvs)[2], const struct boundary *boundary);

#endif
