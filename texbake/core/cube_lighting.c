/* Lighting from a cube map: means over the hemisphere about a normal, or over a lobe of directions.

   Based on: Karis, "Real Shading in Unreal Engine 4", 2013, for levels by roughness with the normal
   as the viewing direction; Krivanek and Colbert, "Real-time Shading with Filtered Importance
   Sampling", 2008, for reading each sample from a level as wide as its share of directions; Duff et
   al., "Building an Orthonormal Basis, Revisited", 2017.

   Called from texbake/texture/prefilter.py. */

#include "arena.h"
#include "core.h"
#include "cube_lookup.h"

/* Mean radiance over the hemisphere about each normal, weighted by cosine. `angles` are the solid
   angles of the directions. */
EXPORT int64_t average_hemispheres(
    int64_t n_directions, int64_t n_channels, int64_t n,
    const float directions[n_directions][3], const double angles[n_directions],
    const float radiance[n_directions][n_channels], const float normals[n][3],
    float out[n][n_channels], int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    double *sums = TAKE(arena, double, n_channels);
    for (int64_t i = start; i < stop; i++) {
        double total = 0.0;
        for (int64_t channel = 0; channel < n_channels; channel++)
            sums[channel] = 0.0;
        for (int64_t j = 0; j < n_directions; j++) {
            const float cosine = normals[i][0] * directions[j][0] +
                                 normals[i][1] * directions[j][1] +
                                 normals[i][2] * directions[j][2];
            if (!(cosine > 0.0f))
                continue;
            const double weight = cosine * angles[j];
            total += weight;
            for (int64_t channel = 0; channel < n_channels; channel++)
                sums[channel] += weight * radiance[j][channel];
        }
        for (int64_t channel = 0; channel < n_channels; channel++)
            out[i][channel] = (float)(sums[channel] / total);
    }
    close_arena(arena);
    return 0;
}

/* Place of a direction of the lobe, which is given with the normal along z. */
static inline struct cube_place find_in_lobe(const double direction[3], const float normal[3])
{
    const double nx = normal[0], ny = normal[1], nz = normal[2];
    const double along = direction[0], across = direction[1], up = direction[2];
    /* Two directions that are perpendicular to the normal and to each other. */
    const double sign = nz >= 0.0 ? 1.0 : -1.0;
    const double a = -1.0 / (sign + nz), b = nx * ny * a;
    return find_cube_place(
        along * (1.0 + sign * nx * nx * a) + across * b + up * nx,
        along * sign * b + across * (sign + ny * ny * a) + up * ny,
        -along * sign * nx - across * ny + up * nz);
}

/* Mean over the lobe about each normal. A row of `lobe` is a direction, the level to read, and the
   weight. */
EXPORT int64_t average_lobes(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n_samples, int64_t n,
    const float texels[n_texels][n_channels], const int64_t offsets[n_levels],
    const int64_t sizes[n_levels], const double lobe[n_samples][5], const float normals[n][3],
    float out[n][n_channels], int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    double *sums = TAKE(arena, double, n_channels);
    for (int64_t i = start; i < stop; i++) {
        double total = 0.0;
        for (int64_t channel = 0; channel < n_channels; channel++)
            sums[channel] = 0.0;
        for (int64_t j = 0; j < n_samples; j++) {
            const int64_t level = (int64_t)lobe[j][3];
            const double weight = lobe[j][4];
            const struct cube_place place = find_in_lobe(lobe[j], normals[i]);
            const struct cube_cell cell = find_cube_cell(offsets[level], sizes[level], &place);
            for (int64_t channel = 0; channel < n_channels; channel++)
                sums[channel] += weight * interpolate_cube_cell(n_channels, texels, &cell, channel);
            total += weight;
        }
        for (int64_t channel = 0; channel < n_channels; channel++)
            out[i][channel] = (float)(sums[channel] / total);
    }
    close_arena(arena);
    return 0;
}
