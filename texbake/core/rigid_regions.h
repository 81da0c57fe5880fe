/* The regions of a flat patch that its solver moves as rigid bodies. */

#ifndef TEXBAKE_RIGID_REGIONS_H
#define TEXBAKE_RIGID_REGIONS_H

#include <stdint.h>

struct arena;

/* Write the region of each vertex, from 0 without gaps; all 0 if the patch is too small for it to
   pay. */
void divide_regions(
    struct arena *arena, int64_t n, const double (*uvs)[2], int32_t *regions);

#endif
