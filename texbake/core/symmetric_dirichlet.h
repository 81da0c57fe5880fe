/* The symmetric Dirichlet energy of a flat patch, for other files of the core. */

#ifndef TEXBAKE_SYMMETRIC_DIRICHLET_H
#define TEXBAKE_SYMMETRIC_DIRICHLET_H

#include "patch_graph.h"

/* Triangles of a patch, and their shapes in space: gradients of the three hat functions in the plane
   of each, and its area. J = Σ u_k ⊗ gradients[k] with the flat corners u_k. */
struct shapes {
    int64_t n_faces;
    const int32_t (*faces)[3];
    double (*gradients)[3][2];
    double *areas;
};

/* Means over a layout without flips of σ1² + σ2², of σ1⁻² + σ2⁻², and of σ1 σ2. */
struct stretches {
    double dirichlet, inverse, growth;
};

/* Shapes of triangles; thin and small ones are widened. */
struct shapes rest_shapes(
    struct arena *arena, int64_t n_faces, const int32_t (*faces)[3], const double (*points)[3]);

/* Total energy; infinite where a triangle is flipped or has no area. */
double energy_of(const double (*uvs)[2], const struct shapes *shapes);

struct stretches stretches_of(const double (*uvs)[2], const struct shapes *shapes);

/* When to stop: after so many steps, or after one that gains less than `accuracy`, as a share of the
   energy above its minimum. */
struct limits {
    int64_t n_iterations;
    double accuracy;
    bool keep_apart; /* edges of the boundary never cross, in any step */
};

/* Minimize the energy from a layout without flips, in place; return the number of steps. */
int64_t minimize_energy(
    struct arena *arena, const struct patch *patch, const struct shapes *shapes,
    const int32_t *regions, struct limits limits, double (*uvs)[2]);

#endif
