/* Second differences of values between texels that lie side by side, and errors judged by them.

   Only texels that are wholly covered have their sample at their center, and so show how values
   change; those of other charts, and those without a value, show nothing.

   Based on: Whitted, "An Improved Illumination Model for Shaded Display", Communications of the ACM
   23(6), 1980: more samples where those at hand differ.

   Called from texbake/baking/adaptive_texels/texel_error.py and cell_differences.c. */

#include "second_differences.h"

#include "arena.h"
#include "core.h"
#include "numbers.h"

static const double TOWARDS = 1.0 / 18.0; /* share of the second differences added to a sample */
static const double DEVIATION = 2.0; /* second differences that a deviation counts as */
static const double PARTLY = 2.5; /* measured: how much further off a partly covered texel is */

/* Find wholly covered texels of the same chart along an axis (0: x, 1: y). */
struct neighbors neighbors_along(const struct texel_samples *samples, int64_t texel, int axis)
{
    const int64_t width = samples->width, n_texels = samples->height * width;
    const uint8_t *counts = samples->counts;
    const int32_t *charts = samples->charts, chart = charts[texel];
    const int64_t stride = axis == 0 ? 1 : width, before = texel - stride, after = texel + stride;
    bool has_before = before >= 0 && charts[before] == chart && counts[before] == FULL;
    bool has_after = after < n_texels && charts[after] == chart && counts[after] == FULL;
    if (axis == 0 && (has_before || has_after)) {
        const int64_t column = texel % width;
        has_before = has_before && column > 0;
        has_after = has_after && column + 1 < width;
    }
    if (has_before && has_after)
        return (struct neighbors){BOTH, before, after};
    if (!has_before && !has_after)
        return (struct neighbors){NOTHING, texel, texel};
    const int64_t near = has_before ? before : after, far = 2 * near - texel;
    if (0 <= far && far < n_texels && charts[far] == chart && counts[far] == FULL
        && (axis == 1 || far / width == texel / width))
        return (struct neighbors){ONE_SIDE, near, far};
    return (struct neighbors){NEXT, near, near};
}

/* A wholly covered texel of the same chart at a side or a corner of a texel, or -1. A wholly covered
   texel is its own inner texel. */
int64_t inner_texel(const struct texel_samples *samples, int64_t texel)
{
    const int64_t height = samples->height, width = samples->width;
    const int32_t *charts = samples->charts, chart = charts[texel];
    if (samples->counts[texel] == FULL)
        return texel;
    const int64_t row = texel / width, column = texel % width;
    for (int is_corner = 0; is_corner < 2; is_corner++) {
        for (int dy = -1; dy <= 1; dy++) {
            for (int dx = -1; dx <= 1; dx++) {
                if ((dy != 0) + (dx != 0) != 1 + is_corner)
                    continue;
                if (row + dy < 0 || row + dy >= height || column + dx < 0 || column + dx >= width)
                    continue;
                const int64_t other = texel + dy * width + dx;
                if (samples->counts[other] == FULL && charts[other] == chart)
                    return other;
            }
        }
    }
    return -1;
}

/* Write how much each channel changes from texel to texel, to the right and down: (2, channels). */
void write_slopes(const struct texel_samples *samples, int64_t texel, double *slopes)
{
    const int64_t n_channels = samples->n_channels;
    const float *values = values_of(samples, texel);
    for (int axis = 0; axis < 2; axis++) {
        const struct neighbors along = neighbors_along(samples, texel, axis);
        const float *a = values_of(samples, along.a), *b = values_of(samples, along.b);
        for (int64_t channel = 0; channel < n_channels; channel++) {
            double slope = 0.0;
            if (along.kind == BOTH)
                slope = 0.5 * (double)(b[channel] - a[channel]);
            else if (along.kind != NOTHING)
                slope = along.a > texel ? (double)(a[channel] - values[channel])
                                        : -(double)(a[channel] - values[channel]);
            slopes[axis * n_channels + channel] = slope;
        }
    }
}

/* Do what `judge_border` does, faster, for a texel with neighbors on all sides. */
static double judge_inside(
    const struct texel_samples *samples, const struct metric *metric, int64_t texel, float *mean)
{
    const int64_t across = samples->n_channels, down = samples->width * across;
    const float *values = values_of(samples, texel);
    double steps = 0.0;
    for (int64_t k = 0; k < metric->n_maps; k++) {
        /* A map without a bound may hold anything, such as colors or ids, and is left alone. */
        const float towards = (float)(metric->scales[k] > 0.0 ? TOWARDS : 0.0);
        float square_x = 0.0f, square_y = 0.0f;
        for (int64_t channel = metric->firsts[k]; channel < metric->firsts[k + 1]; channel++) {
            const float *at = values + channel, v = *at;
            const float x = at[-across] - v + (at[across] - v);
            const float y = at[-down] - v + (at[down] - v);
            square_x += x * x;
            square_y += y * y;
            mean[channel] = v + towards * (x + y);
        }
        steps = max_f64(
            steps, metric->scales[k] * (double)(sqrtf(square_x) + sqrtf(square_y)));
    }
    return steps;
}

/* Write the mean of a wholly covered texel; return its second differences, in bounds. */
static double judge_border(
    const struct texel_samples *samples, const struct metric *metric, int64_t texel,
    const struct neighbors *x, const struct neighbors *y, float *mean)
{
    const float *values = values_of(samples, texel);
    /* A map without a bound may hold anything, such as colors or ids, and is left alone. */
    const double towards_x = x->kind > NEXT ? TOWARDS : 0.0;
    const double towards_y = y->kind > NEXT ? TOWARDS : 0.0;
    double steps = 0.0;
    for (int64_t k = 0; k < metric->n_maps; k++) {
        double square_x = 0.0, square_y = 0.0;
        for (int64_t channel = metric->firsts[k]; channel < metric->firsts[k + 1]; channel++) {
            double v = values[channel];
            if (metric->scales[k] > 0.0) {
                const double bend_x = second_difference(samples, texel, x, channel);
                const double bend_y = second_difference(samples, texel, y, channel);
                square_x += bend_x * bend_x;
                square_y += bend_y * bend_y;
                v += towards_x * bend_x + towards_y * bend_y;
            }
            mean[channel] = (float)v;
        }
        steps = max_f64(steps, metric->scales[k] * (sqrt(square_x) + sqrt(square_y)));
    }
    return steps;
}

/* Whether a texel on any of the four sides has a value. */
static bool has_neighbor(const struct texel_samples *samples, int64_t texel)
{
    const int64_t width = samples->width, row = texel / width, column = texel % width;
    const int32_t *charts = samples->charts + texel;
    return (column > 0 && charts[-1] != NO_CHART)
        || (column + 1 < width && charts[1] != NO_CHART)
        || (row > 0 && charts[-width] != NO_CHART)
        || (row + 1 < samples->height && charts[width] != NO_CHART);
}

/* Judge one texel; see `judge_samples`. */
static double judge_texel(
    const struct texel_samples *samples, const struct metric *metric, int64_t texel, float *mean)
{
    const uint8_t count = samples->counts[texel];
    if (count == 0)
        return 0.0;
    if (samples->charts[texel] == NO_CHART)
        return count < FULL || has_neighbor(samples, texel) ? INFINITY : 0.0;
    if (count < FULL) {
        const float *values = values_of(samples, texel);
        for (int64_t channel = 0; channel < samples->n_channels; channel++)
            mean[channel] = values[channel];
        return -1.0;
    }
    if (is_surrounded(samples, texel))
        return judge_inside(samples, metric, texel, mean);
    const struct neighbors x = neighbors_along(samples, texel, 0);
    const struct neighbors y = neighbors_along(samples, texel, 1);
    const double steps = judge_border(samples, metric, texel, &x, &y, mean);
    return x.kind == NOTHING || y.kind == NOTHING ? INFINITY : steps;
}

/* Judge texels from `first` on, and write their means; partly covered ones get -1. */
EXPORT void judge_samples(
    int64_t n_texels, int64_t n_room, int64_t n_channels, int64_t n_maps, int64_t n,
    int64_t height, int64_t width, int64_t first, const uint8_t counts[n_texels],
    const int32_t charts[n_room], const float values[n_room][n_channels],
    const int32_t firsts[n_maps + 1], const double scales[n_maps], float steps[n],
    float means[n][n_channels])
{
    const struct texel_samples samples = {height, width, n_channels, counts, charts, values[0]};
    const struct metric metric = {n_maps, firsts, scales};
    for (int64_t i = 0; i < n; i++)
        steps[i] = (float)judge_texel(&samples, &metric, first + i, means[i]);
}

/* Judge partly covered texels by the wholly covered ones beside them. */
EXPORT int64_t judge_partly_covered(
    int64_t n_texels, int64_t n_room, int64_t n_channels, int64_t n_maps, int64_t n,
    int64_t height, int64_t width, const uint8_t counts[n_texels], const int64_t masks[n_texels],
    const int32_t charts[n_room], const float values[n_room][n_channels],
    const int32_t firsts[n_maps + 1], const double scales[n_maps], const float steps[n_texels],
    const int64_t parts[n], float judged[n])
{
    OPEN_ARENA(arena);
    const struct texel_samples samples = {height, width, n_channels, counts, charts, values[0]};
    const struct metric metric = {n_maps, firsts, scales};
    const struct coverage coverage = {counts, masks};
    double *slopes = TAKE(arena, double, 2 * n_channels);
    for (int64_t i = 0; i < n; i++) {
        const int64_t texel = parts[i];
        judged[i] = 0.0f;
        if (masks[texel] == 0)
            continue; /* no sample could lie anywhere but at its center */
        const int64_t inner = inner_texel(&samples, texel);
        if (inner < 0) {
            judged[i] = INFINITY;
            continue;
        }
        const struct sample_spot spot = sample_spot_of(&coverage, texel, 0, 0);
        const double dx = (double)(texel % width - inner % width) + (double)spot.x / PER_TEXEL - 0.5;
        const double dy = (double)(texel / width - inner / width) + (double)spot.y / PER_TEXEL - 0.5;
        write_slopes(&samples, inner, slopes);
        double away = 0.0;
        for (int64_t k = 0; k < n_maps; k++)
            away = max_f64(away, deviation(&samples, &metric, texel, inner, slopes, dx, dy, k));
        judged[i] = (float)(PARTLY * max_f64(steps[inner], DEVIATION * away));
    }
    close_arena(arena);
    return 0;
}
