/* A mesh divided into connected parts, face_parts.c. */

#pragma once

#include <stdint.h>

struct arena;

/* Labels of faces that await a label, and of those that get none. */
#define OPEN_FACE ((int32_t)-1)
#define CLOSED_FACE ((int32_t)-2)

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
