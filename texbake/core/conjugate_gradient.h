/* Conjugate gradients for sparse symmetric systems of 2 x 2 blocks, for other files of the core. */

#ifndef TEXBAKE_CONJUGATE_GRADIENT_H
#define TEXBAKE_CONJUGATE_GRADIENT_H

#include <stdint.h>

struct arena;

/* A symmetric matrix of 2 x 2 blocks in compressed rows, as in `Patch`: the first entry of a row
   lies on the diagonal, and an entry's block is stored row by row. */
struct block_matrix {
    int64_t n;
    const int64_t *row_starts;
    const int32_t *columns;
    const double (*blocks)[4];
};

int64_t solve_block_system(
    struct arena *arena, const struct block_matrix *matrix, const double (*target)[2],
    const double (*uvs)[2], const int32_t *regions, double (*solution)[2], double tolerance,
    int64_t n_iterations);

#endif
