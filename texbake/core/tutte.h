/* Tutte's embedding, for other files of the core. */

#ifndef TEXBAKE_TUTTE_H
#define TEXBAKE_TUTTE_H

#include "patch_graph.h"

/* Lay out a disk in the unit circle, without flips as far as float64 can resolve its corners; holes
   are filled by fans. False if a hole cannot be filled, because an edge across it already exists.
   `tolerance` is that of the linear system. */
bool lay_in_circle(
    struct arena *arena, const struct patch *patch, const double (*points)[3], double tolerance,
    double (*uvs)[2]);

#endif
