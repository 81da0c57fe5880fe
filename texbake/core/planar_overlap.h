/* Triangles in the plane that overlap others, for other files of the core. */

#ifndef TEXBAKE_PLANAR_OVERLAP_H
#define TEXBAKE_PLANAR_OVERLAP_H

#include <stdint.h>

struct arena;

/* Number of faces that overlap faces of lower numbers by more than `depth`, once these are out of
   the way themselves. */
int64_t count_overlaps(
    struct arena *arena, const double (*uvs)[2], int64_t n_faces, const int32_t (*faces)[3],
    double depth);

#endif
