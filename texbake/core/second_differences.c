/* Second differences of values between texels that lie side by side, and errors judged by them; those
   of divided texels by the differences between their cells and those beside them.

   Only texels that are wholly covered have their sample at their center, and so show how values
   change; those of other charts, and those without a value, show nothing.

   Based on: Whitted, "An Improved Illumination Model for Shaded Display", Communications of the ACM
   23(6), 1980: more samples where those at hand differ.

   Called from texbake/baking/adaptive_texels/texel_error.py. */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"
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

/* Neighbors along an axis: wholly covered texels of the same chart. */
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

static const double TOWARDS = 1.0 / 18.0; /* share of the second differences added to a sample */
static const float OWN = 2.0f / 3.0f; /* share of a texel's own second differences */
static const double DEVIATION = 2.0; /* second differences that a deviation counts as */
static const double PARTLY = 2.5; /* measured: how much further off a partly covered texel is */
/* The outline of a chart often follows a feature that no neighbor shows, so a partly covered texel is
   divided at a smaller difference: this many times its second differences count, up to ENOUGH. */
static const double CAREFUL = 20.0, ENOUGH = 5.1;

/* Find wholly covered texels of the same chart along an axis (0: x, 1: y). */
static struct neighbors neighbors_along(const struct texel_samples *samples, int64_t texel, int axis)
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
static int64_t inner_texel(const struct texel_samples *samples, int64_t texel)
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
static void write_slopes(const struct texel_samples *samples, int64_t texel, double *slopes)
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

/* Blend the second differences of wholly covered texels with the mean of those beside them, which
   tell of bends that the five samples of a texel do not meet. */
EXPORT void blend_steps(
    int64_t n_texels, int64_t n_room, int64_t n, int64_t height, int64_t width, int64_t first,
    const uint8_t counts[n_texels], const int32_t charts[n_room], const float steps[n_texels],
    float blended[n])
{
    for (int64_t i = 0; i < n; i++) {
        const int64_t texel = first + i, column = texel % width;
        blended[i] = steps[texel];
        if (counts[texel] != FULL || charts[texel] == NO_CHART || steps[texel] == INFINITY)
            continue;
        const bool has[4] = {
            column > 0, column + 1 < width, texel >= width, texel + width < height * width};
        const int64_t others[4] = {texel - 1, texel + 1, texel - width, texel + width};
        float sum = 0.0f, n_others = 0.0f;
        for (int side = 0; side < 4; side++) {
            const int64_t other = has[side] ? others[side] : texel;
            const bool counts_too = counts[other] == FULL && charts[other] == charts[texel] &&
                                    steps[other] < INFINITY;
            sum += counts_too ? steps[other] : 0.0f;
            n_others += counts_too ? 1.0f : 0.0f;
        }
        if (n_others > 0.0f)
            blended[i] = OWN * steps[texel] + (1.0f - OWN) * sum / n_others;
    }
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
        away = max_f64(steps[inner], DEVIATION * away);
        judged[i] = (float)max_f64(PARTLY * away, min_f64(CAREFUL * away, ENOUGH));
    }
    close_arena(arena);
    return 0;
}

/* How far the mean of four samples may be off: shares of second differences, of how far the four
   together deviate from an even change, and of how far that exceeds LEAP second differences, which
   it never does where values merely bend. */
static const double EVEN = 0.008, UNEVEN = 0.04, UNSTEADY = 0.12;
static const double LEAP = 0.6;
/* Shares of the first sample and of second differences in the mean of a texel with four more. */
static const double FIRST = 0.1, OF_CELLS = 0.016;
/* Share of a second difference that a sample of a cell may be off by, so that the root of the sum of
   squares over a texel is 1.5 to 3 times its error; of a first difference, at a border. */
static const double BEND = 0.3, BORDER = 0.45;
/* Factor for the finest cells: a leap along their rows leaves errors of one sign, and no further
   samples follow. */
static const double FINEST = 2.0;

/* Cells whose squared error is more than an even share of this part of the squared bound are divided. */
static const double EVEN_SHARE = 0.25;

enum { NOWHERE = -1 };

/* Where the samples of four quarters and of their texel lie, and how much the quarters cover. */
struct quarters {
    double spots[5][2];
    double weights[4];
};

/* How far the mean of four samples is expected to be off, in bounds. */
static double expected_error(double steps, double away)
{
    return EVEN * steps + UNEVEN * away + UNSTEADY * max_f64(away - LEAP * steps, 0.0);
}

/* Whether the quarters and all neighbors of a wholly covered texel belong to its chart. */
static bool is_inside(const struct texel_samples *samples, int64_t texel, int64_t first)
{
    const int32_t *charts = samples->charts, chart = charts[texel];
    return samples->counts[texel] == FULL && charts[first] == chart && charts[first + 1] == chart
        && charts[first + 2] == chart && charts[first + 3] == chart
        && is_surrounded(samples, texel);
}

/* As `judge_cells_at_border`, but faster, for a texel that `is_inside`. Differences are of single
   precision. Returns how far the four together deviate from an even change, in bounds. */
static double judge_cells_inside(
    const struct texel_samples *samples, const struct metric *metric, int64_t texel,
    int64_t first, float *mean)
{
    const int64_t across = samples->n_channels, down = samples->width * across;
    const float *values = values_of(samples, texel), *quarters = values_of(samples, first);
    double worst = 0.0;
    for (int64_t k = 0; k < metric->n_maps; k++) {
        const bool is_bounded = metric->scales[k] > 0.0;
        double square_a = 0.0, square_b = 0.0, square_c = 0.0, square_d = 0.0;
        for (int64_t channel = metric->firsts[k]; channel < metric->firsts[k + 1]; channel++) {
            const float *at = values + channel, *quarter = quarters + channel, v = *at;
            const float left = at[-across] - v, right = at[across] - v;
            const float above = at[-down] - v, below = at[down] - v;
            const float a = quarter[0] - v, b = quarter[across] - v;
            const float c = quarter[2 * across] - v, d = quarter[3 * across] - v;
            const double mean_away = 0.25 * (double)(a + b + c + d);
            if (is_bounded) {
                const double bend = left + right + above + below;
                mean[channel] = (float)(v + (1.0 - FIRST) * mean_away + OF_CELLS * bend);
            } else {
                mean[channel] = (float)(v + mean_away);
            }
            /* A quarter of the slopes. */
            const double x = 0.125 * (double)(right - left), y = 0.125 * (double)(below - above);
            const double away_a = a + x + y, away_b = b - x + y;
            const double away_c = c + x - y, away_d = d - x - y;
            square_a += away_a * away_a;
            square_b += away_b * away_b;
            square_c += away_c * away_c;
            square_d += away_d * away_d;
        }
        const double away = sqrt(square_a) + sqrt(square_b) + sqrt(square_c) + sqrt(square_d);
        worst = max_f64(worst, metric->scales[k] * away);
    }
    return worst;
}

static void place_quarters(
    const struct coverage *coverage, int64_t texel, struct quarters *quarters)
{
    const bool is_whole = coverage->counts[texel] == FULL;
    for (int child = 0; child < 4; child++) {
        const int row = child / 2, column = child % 2, spot = row * FINE + column;
        double *place = quarters->spots[child];
        if (is_whole) {
            quarters->weights[child] = FULL / 4;
            place[0] = 0.25 + 0.5 * column;
            place[1] = 0.25 + 0.5 * row;
            continue;
        }
        quarters->weights[child] =
            (double)submask_of(coverage->masks[texel], square_of(1, spot)).n;
        const struct sample_spot sample = sample_spot_of(coverage, texel, 1, spot);
        place[0] = (double)sample.x / PER_TEXEL;
        place[1] = (double)sample.y / PER_TEXEL;
    }
    const struct sample_spot sample = sample_spot_of(coverage, texel, 0, 0);
    quarters->spots[4][0] = (double)sample.x / PER_TEXEL;
    quarters->spots[4][1] = (double)sample.y / PER_TEXEL;
}

/* Write the mean of a texel's quarters, each by how much of it is covered. */
static void write_mean(
    const struct texel_samples *samples, int64_t first, const double weights[4], float *means)
{
    const double total = weights[0] + weights[1] + weights[2] + weights[3];
    for (int64_t channel = 0; channel < samples->n_channels; channel++) {
        double mean = 0.0;
        for (int child = 0; child < 4; child++)
            if (weights[child] > 0.0)
                mean += weights[child] * values_of(samples, first + child)[channel];
        means[channel] = (float)(mean / total);
    }
}

/* Add shares of the first sample and of second differences to a wholly covered texel's mean. */
static void adjust_mean(
    const struct texel_samples *samples, const struct metric *metric, int64_t texel, float *means)
{
    const struct neighbors x = neighbors_along(samples, texel, 0);
    const struct neighbors y = neighbors_along(samples, texel, 1);
    const float *values = values_of(samples, texel);
    for (int64_t k = 0; k < metric->n_maps; k++) {
        if (metric->scales[k] == 0.0)
            continue;
        for (int64_t channel = metric->firsts[k]; channel < metric->firsts[k + 1]; channel++) {
            double bend = 0.0;
            if (x.kind > NEXT)
                bend += second_difference(samples, texel, &x, channel);
            if (y.kind > NEXT)
                bend += second_difference(samples, texel, &y, channel);
            const float mean = means[channel];
            means[channel] =
                (float)(mean + FIRST * (double)(values[channel] - mean) + OF_CELLS * bend);
        }
    }
}

/* Judge a texel whose quarters or neighbors do not all belong to its chart; infinite where too
   little is known. `slopes` is for two rows of channels. */
static double judge_cells_at_border(
    const struct texel_samples *samples, const struct coverage *coverage,
    const struct metric *metric, double steps, int64_t texel, int64_t first, float *means,
    double *slopes)
{
    struct quarters quarters;
    place_quarters(coverage, texel, &quarters);
    const double *weights = quarters.weights;
    int64_t n = 0;
    bool is_same = true;
    for (int child = 0; child < 4; child++) {
        if (weights[child] > 0.0) {
            n++;
            is_same = is_same && samples->charts[first + child] == samples->charts[texel];
        }
    }
    const int64_t inner = inner_texel(samples, texel);
    if (n == 0 || !is_same || inner < 0)
        return INFINITY;
    write_slopes(samples, inner, slopes);
    write_mean(samples, first, weights, means);
    if (samples->counts[texel] == FULL)
        adjust_mean(samples, metric, texel, means);
    /* How far the four deviate from an even change from the first sample. */
    double worst = 0.0;
    for (int64_t k = 0; k < metric->n_maps; k++) {
        double away = 0.0;
        for (int child = 0; child < 4; child++) {
            if (!(weights[child] > 0.0))
                continue;
            const double dx = quarters.spots[child][0] - quarters.spots[4][0];
            const double dy = quarters.spots[child][1] - quarters.spots[4][1];
            away += deviation(samples, metric, first + child, texel, slopes, dx, dy, k);
        }
        worst = max_f64(worst, 4.0 * away / (double)n);
    }
    return expected_error(steps, worst);
}

/* Judge texels by their four samples and those beside them, and write their means. */
EXPORT int64_t judge_four_samples(
    int64_t n_texels, int64_t n_room, int64_t n_channels, int64_t n_maps, int64_t n,
    int64_t height, int64_t width, const uint8_t counts[n_texels], const int64_t masks[n_texels],
    const int32_t charts[n_room], const float values[n_room][n_channels],
    const int32_t children[n_room], const int32_t firsts[n_maps + 1], const double scales[n_maps],
    const float steps[n_texels], const int32_t parents[n], float means[n_texels][n_channels],
    float errors[n])
{
    OPEN_ARENA(arena);
    const struct texel_samples samples = {height, width, n_channels, counts, charts, values[0]};
    const struct metric metric = {n_maps, firsts, scales};
    const struct coverage coverage = {counts, masks};
    double *slopes = TAKE(arena, double, 2 * n_channels);
    for (int64_t i = 0; i < n; i++) {
        const int32_t texel = parents[i], first = children[texel];
        if (is_inside(&samples, texel, first)) {
            const double away = judge_cells_inside(&samples, &metric, texel, first, means[texel]);
            errors[i] = (float)expected_error(steps[texel], away);
        } else {
            errors[i] = (float)judge_cells_at_border(
                &samples, &coverage, &metric, steps[texel], texel, first, means[texel], slopes);
        }
    }
    close_arena(arena);
    return 0;
}

/* The cells of a bake, as `Cells`. */
struct cells {
    int64_t height, width, n_channels;
    const int32_t *children, *charts;
    const float *values; /* n_channels per value */
    struct metric metric;
};

/* The place of a cell by its row and column of a level, NOWHERE if there is none. */
static int64_t find_cell(const struct cells *cells, int64_t level, int64_t row, int64_t column)
{
    if (row < 0 || column < 0 || row >= cells->height << level || column >= cells->width << level)
        return NOWHERE;
    int64_t place = (row >> level) * cells->width + (column >> level);
    for (int64_t k = level - 1; k >= 0; k--) {
        place = cells->children[place];
        if (place == NO_CHILD)
            return NOWHERE;
        place += ((row >> k) & 1) * 2 + ((column >> k) & 1);
    }
    return place;
}

/* The second difference of the values of three cells in bounds; the first of two without c. */
static double bend_of(const struct cells *cells, int64_t a, int64_t b, int64_t c)
{
    const struct metric *metric = &cells->metric;
    const int64_t n_channels = cells->n_channels;
    double worst = 0.0;
    for (int64_t k = 0; k < metric->n_maps; k++) {
        double square = 0.0;
        for (int64_t channel = metric->firsts[k]; channel < metric->firsts[k + 1]; channel++) {
            const float *values = cells->values + channel, middle = values[b * n_channels];
            float difference = values[a * n_channels] - middle;
            if (c != NOWHERE)
                difference += values[c * n_channels] - middle;
            square += difference * difference;
        }
        worst = max_f64(worst, metric->scales[k] * sqrt(square));
    }
    return worst;
}

/* A cell of a level: its place, row and column. */
struct cell {
    int64_t level, place, row, column;
};

/* The cell some steps along an axis (0: x, 1: y), NOWHERE if there is none. */
static int64_t find_along(
    const struct cells *cells, const struct cell *cell, int axis, int64_t steps)
{
    return find_cell(
        cells, cell->level, cell->row + axis * steps, cell->column + (1 - axis) * steps);
}

/* Judge a cell without a value along an axis; return the greater of that and its error. The
   covered part of the cell is assumed to be like its neighbors. */
static float judge_empty(
    const struct cells *cells, const struct cell *cell, int axis, const int64_t sides[2],
    float error)
{
    for (int side = 0; side < 2; side++) {
        const int64_t near = sides[side];
        if (near == NOWHERE || cells->charts[near] == NO_CHART)
            continue;
        const int64_t far = find_along(cells, cell, axis, side == 0 ? -2 : 2);
        if (far != NOWHERE && cells->charts[far] == cells->charts[near])
            error = (float)max_f64(error, BORDER * bend_of(cells, near, far, NOWHERE));
    }
    return error;
}

/* Judge a cell along an axis by those beside it; return its error with that added. */
static float judge_along(
    const struct cells *cells, const struct cell *cell, int axis, const int64_t sides[2],
    float error)
{
    const int32_t *charts = cells->charts, chart = charts[cell->place];
    const bool has_before = sides[0] != NOWHERE && charts[sides[0]] == chart;
    const bool has_after = sides[1] != NOWHERE && charts[sides[1]] == chart;
    if (has_before && has_after)
        return (float)(error + BEND * bend_of(cells, sides[0], cell->place, sides[1]));
    if (!has_before && !has_after)
        return error;
    const int64_t near = sides[has_before ? 0 : 1];
    const int64_t far = find_along(cells, cell, axis, has_before ? -2 : 2);
    if (far != NOWHERE && charts[far] == chart)
        return (float)(error + BEND * bend_of(cells, cell->place, near, far));
    return (float)(error + BORDER * bend_of(cells, cell->place, near, NOWHERE));
}

/* Judge the cells of a level, from the place `first` on, by those on their four sides. */
EXPORT void judge_cells(
    int64_t n, int64_t n_room, int64_t n_channels, int64_t n_maps, int64_t level, int64_t height,
    int64_t width, int64_t first, const int32_t texels[n], const uint8_t spots[n],
    const uint8_t weights[n], const int32_t children[n_room], const int32_t charts[n_room],
    const float values[n_room][n_channels], const int32_t firsts[n_maps + 1],
    const double scales[n_maps], float errors[n])
{
    const struct cells cells = {
        height, width, n_channels, children, charts, values[0], {n_maps, firsts, scales}};
    const float factor = FINE >> level == 1 ? (float)FINEST : 1.0f;
    for (int64_t i = 0; i < n; i++) {
        errors[i] = 0.0f;
        if (weights[i] == 0)
            continue;
        const struct cell cell = {
            level, first + i, (texels[i] / width << level) + spots[i] / FINE,
            (texels[i] % width << level) + spots[i] % FINE};
        for (int axis = 0; axis < 2; axis++) {
            const int64_t sides[2] = {
                find_along(&cells, &cell, axis, -1), find_along(&cells, &cell, axis, 1)};
            errors[i] = charts[cell.place] == NO_CHART
                          ? judge_empty(&cells, &cell, axis, sides, errors[i])
                          : judge_along(&cells, &cell, axis, sides, errors[i]);
        }
        errors[i] *= factor;
    }
}

static inline double squared(double value)
{
    return value * value;
}

/* Mark the cells that are divided; add the errors of the others to their texels, as independent
   errors add up. The cells of a texel stand together. */
EXPORT void choose_divided(
    int64_t n, int64_t n_texels, bool may_divide, const int32_t texels[n],
    const uint8_t weights[n], const float errors[n], const uint8_t counts[n_texels],
    float texel_errors[n_texels], bool divided[n])
{
    for (int64_t start = 0, stop; start < n; start = stop) {
        const int32_t texel = texels[start];
        const double covered = counts[texel];
        double total = squared(texel_errors[texel]), kept = total, n_leaves = 0.0;
        for (stop = start; stop < n && texels[stop] == texel; stop++) {
            total += squared((float)weights[stop] * errors[stop] / covered);
            n_leaves += weights[stop] > 0;
        }
        const bool is_too_far = may_divide && total > 1.0;
        for (int64_t i = start; i < stop; i++) {
            const double error = squared((float)weights[i] * errors[i] / covered);
            if (is_too_far && weights[i] > 1 && error * n_leaves > EVEN_SHARE)
                divided[i] = true;
            else
                kept += error;
        }
        texel_errors[texel] = (float)sqrt(kept);
    }
}
