/* Patches flattened with a free boundary, for other files of the core. */

#ifndef TEXBAKE_FLATTEN_H
#define TEXBAKE_FLATTEN_H

#include "symmetric_dirichlet.h"

/* A layout about the origin with the area that the patch has in space. */
struct flat {
    double l2;         /* stretch (Sander et al. 2001): √ of the mean of (Γ² + γ²) / 2, 1 at best */
    double energy;     /* mean of the symmetric Dirichlet energy, 4 at best */
    bool is_injective; /* no two triangles overlap */
};

/* Flatten a patch from the layout in `uvs` if `has_start` and it has no flips, else from the circle;
   false if there is no start. `uvs` gets the layout. */
bool flatten(
    struct arena *arena, const struct patch *patch, const double (*points)[3], bool has_start,
    struct limits limits, double (*uvs)[2], struct flat *flat);

/* Whether no two triangles of a layout without flips overlap. */
bool is_injective(struct arena *arena, const double (*uvs)[2], const struct patch *patch);

#endif
