/* A mesh divided into connected parts, shared by the files that the sections below name. */

#pragma once

#include <stdint.h>

/* dial_flood.c */

/* Labels of faces that await a label, and of those that take none; and the distance of faces that
   nothing reaches. */
#define OPEN_FACE ((int32_t)-1)
#define CLOSED_FACE ((int32_t)-2)
#define FAR_AWAY INT32_MAX

/* Steps between neighbors are from 1 to this. */
enum { LONGEST_STEP = 63 };

/* A face, the label offered to it, and the next row of its list. */
struct offer {
    int32_t face, label, next;
};

struct flood {
    const int32_t (*neighbors)[3];
    const int32_t (*steps)[3];
    const int32_t *within; /* no step crosses from one value to another; NULL: all have the same */
    int32_t *labels;
    int32_t *distances;  /* FAR_AWAY at first */
    int32_t *sizes;      /* faces of each label */
    struct offer *queue; /* three rows per face, and one per source */
    int64_t most;        /* faces of a label */
};

/* Label every open face by its nearest source. */
void flood_from(
    const struct flood *flood, int64_t n_sources, const int32_t *sources,
    const int32_t *source_labels);

/* face_parts.c */

struct arena;

/* Faces, which of them are neighbors (-1: none), and how far each is. */
struct face_graph {
    int64_t n_faces;
    const int32_t (*neighbors)[3];
    const double (*lengths)[3];
};

/* Divide faces into parts of about `part_faces`: `labels` comes with OPEN_FACE for the faces to
   divide and CLOSED_FACE for all others, and gets the part of each open face, from 0 without gaps.
   Return how many there are. No part crosses from one value of `within` to another; NULL: all have
   the same. */
int32_t divide_faces(
    struct arena *arena, const struct face_graph *graph, const int32_t *within,
    int64_t part_faces, int32_t *labels);
