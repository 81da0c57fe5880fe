/* Gradient noise at a point, and sums of its octaves. The formulas are in
   texbake/texture/procedures/noise.py. */

#pragma once

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "procedure_points.h"

/* The tables of a seed. */
struct noise_lattice {
    const uint8_t *permutation;    /* 512, repeated after 256 */
    const double (*gradients)[3];  /* 256 */
    bool quintic;
};

/* A fractal sum. */
struct octaves {
    int64_t count;
    double lacunarity, gain;
    double mean; /* what an octave of |noise| fades to; below 0: of the noise itself, which fades to 0 */
};

/* Index of the cell modulo 256 of a finite coordinate; writes how far into the cell it lies, in
   [0, 1). The remainder is taken before it becomes an integer. */
static inline int64_t lattice_cell(double coordinate, double *within)
{
    const double whole = floor(coordinate);
    *within = coordinate - whole;
    return (int64_t)(whole - 256.0 * floor(whole / 256.0)) & 255;
}

double noise_at(const struct noise_lattice *lattice, double x, double y, double z);

/* Sum of octaves at a finite point in a pixel so wide, 0 for a point. Writes the share of their
   squared amplitudes that faded: over all octaves the sum of amplitude^2 (1 - kept^2). */
double sum_octaves(
    const struct noise_lattice *lattice, const struct octaves *octaves, const struct point *point,
    double width, double *lost);
