/* Values of a cube map in directions, without seams between its faces.

   Based on: cube_lookup.h.

   Called from texbake/texture/cube_lookup.py. */

#include "cube_lookup.h"

#include <math.h>

#include "core.h"
#include "numbers.h"

/* As in texbake/texture/cube_lookup.py. */
enum { FILTER_NEAREST, FILTER_BILINEAR, FILTER_TRILINEAR };

static inline void copy_nearest(
    int64_t n_channels, const float texels[][n_channels], int64_t offset, int64_t size,
    const struct cube_place *place, float out[n_channels])
{
    const int64_t y = min_i64((int64_t)(place->t * (double)size), size - 1) + 1;
    const int64_t x = min_i64((int64_t)(place->s * (double)size), size - 1) + 1;
    const int64_t index = offset + (place->face * (size + 2) + y) * (size + 2) + x;
    for (int64_t channel = 0; channel < n_channels; channel++)
        out[channel] = texels[index][channel];
}

/* Values at levels, or at the finest; 0 in directions that belong to no face. */
EXPORT void sample_cube(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n,
    const float texels[n_texels][n_channels], const int64_t offsets[n_levels],
    const int64_t sizes[n_levels], const float directions[n][3], OPTIONAL const float levels[n],
    int64_t filter, float out[n][n_channels], int64_t start, int64_t stop)
{
    const double last = (double)(n_levels - 1);
    for (int64_t i = start; i < stop; i++) {
        const struct cube_place place =
            find_cube_place(directions[i][0], directions[i][1], directions[i][2]);
        if (place.face < 0) {
            for (int64_t channel = 0; channel < n_channels; channel++)
                out[i][channel] = 0.0f;
            continue;
        }
        double level = levels && levels[i] > 0.0f ? min_f64(levels[i], last) : 0.0;
        if (filter != FILTER_TRILINEAR)
            level = floor(level + 0.5);
        const int64_t fine = (int64_t)level;
        if (filter == FILTER_NEAREST) {
            copy_nearest(n_channels, texels, offsets[fine], sizes[fine], &place, out[i]);
            continue;
        }
        struct cube_cell cell = find_cube_cell(offsets[fine], sizes[fine], &place);
        for (int64_t channel = 0; channel < n_channels; channel++)
            out[i][channel] = interpolate_cube_cell(n_channels, texels, &cell, channel);
        const float blend = (float)(level - (double)fine);
        if (!(blend > 0.0f))
            continue;
        cell = find_cube_cell(offsets[fine + 1], sizes[fine + 1], &place);
        for (int64_t channel = 0; channel < n_channels; channel++) {
            const float value = interpolate_cube_cell(n_channels, texels, &cell, channel);
            out[i][channel] += blend * (value - out[i][channel]);
        }
    }
}
