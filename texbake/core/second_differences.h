/* Second differences between texels, for other files of the core: see second_differences.c. */

#pragma once

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "quadtree.h"

/* The first samples of texels: how much of each is covered, their charts and their values. The
   values of cells follow those of the texels. */
struct texel_samples {
    int64_t height, width, n_channels;
    const uint8_t *counts;
    const int32_t *charts;
    const float *values; /* n_channels each */
};

/* Measures differences of values in bounds, as `Metric`. */
struct metric {
    int64_t n_maps;
    const int32_t *firsts;
    const double *scales;
};

/* What lies along an axis: wholly covered texels of the same chart. */
enum {
    NOTHING = -1,
    NEXT = 0,     /* a beside it */
    ONE_SIDE = 1, /* a beside it, b beyond a */
    BOTH = 2,     /* a before it, b after it */
};

struct neighbors {
    int kind;
    int64_t a, b;
};

static inline const float *values_of(const struct texel_samples *samples, int64_t place)
{
    return samples->values + place * samples->n_channels;
}

/* Whether the texels on all four sides are wholly covered, by the same chart. */
static inline bool is_surrounded(const struct texel_samples *samples, int64_t texel)
{
    const int64_t width = samples->width;
    const uint8_t *counts = samples->counts + texel;
    const int32_t *charts = samples->charts + texel, chart = *charts;
    /* The texel beside one at the left or right border is one of another row: tested last. */
    if (texel < width || texel >= (samples->height - 1) * width
        || counts[-1] + counts[1] != 2 * FULL || counts[-width] + counts[width] != 2 * FULL
        || charts[-1] != chart || charts[1] != chart || charts[-width] != chart
        || charts[width] != chart)
        return false;
    const uint32_t column = (uint32_t)texel % (uint32_t)width;
    return 0 < column && column < width - 1;
}

/* The second difference of one channel along an axis, or else the first. The sums of neighbors are
   of single precision. */
static inline double second_difference(
    const struct texel_samples *samples, int64_t texel, const struct neighbors *along,
    int64_t channel)
{
    const float v = values_of(samples, texel)[channel];
    const float a = values_of(samples, along->a)[channel];
    const float b = values_of(samples, along->b)[channel];
    if (along->kind == BOTH)
        return (double)(a + b) - 2.0 * (double)v;
    if (along->kind == ONE_SIDE)
        return (double)(v + b) - 2.0 * (double)a;
    return (double)(a - v);
}

/* How far a value of the k-th map is from an even change, in bounds of the map. */
static inline double deviation(
    const struct texel_samples *samples, const struct metric *metric, int64_t place,
    int64_t origin, const double *slopes, double dx, double dy, int64_t k)
{
    const float *values = values_of(samples, place), *start = values_of(samples, origin);
    const double *slopes_y = slopes + samples->n_channels;
    double square = 0.0;
    for (int64_t channel = metric->firsts[k]; channel < metric->firsts[k + 1]; channel++) {
        const double even = start[channel] + dx * slopes[channel] + dy * slopes_y[channel];
        const double away = values[channel] - even;
        square += away * away;
    }
    return metric->scales[k] * sqrt(square);
}

struct neighbors neighbors_along(const struct texel_samples *samples, int64_t texel, int axis);
int64_t inner_texel(const struct texel_samples *samples, int64_t texel);
void write_slopes(const struct texel_samples *samples, int64_t texel, double *slopes);
