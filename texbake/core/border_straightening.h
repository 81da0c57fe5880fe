/* Borders between labels of faces are moved, border_straightening.c. */

#pragma once

#include <stdint.h>

struct arena;

/* Faces, how they are connected, and what a border along each edge costs for each unit of length:
   infinite where none may run. */
struct weighted_surface {
    int64_t n_faces;
    const double (*points)[3];
    const int32_t (*corners)[3];
    const int32_t *opposite; /* of each half-edge; -1: none, also at a cut within a label */
    const double (*weights)[3];
};

/* Move the borders between labels to cheaper edges. `width`: rings of faces in
   the band about a border, for each of its edges. Where borders meet, they stay. */
void straighten_labels(
    struct arena *arena, const struct weighted_surface *surface, double width, int32_t *labels);
