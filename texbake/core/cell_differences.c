/* Errors of divided texels, judged by the differences between their cells and those beside them.

   Based on: Whitted, "An Improved Illumination Model for Shaded Display", Communications of the ACM
   23(6), 1980: more samples where those at hand differ.

   Called from texbake/baking/adaptive_texels/texel_error.py. */

#include "arena.h"
#include "core.h"
#include "numbers.h"
#include "quadtree.h"
#include "second_differences.h"

/* How far the mean of four samples may be off: shares of second differences, of how far the four
   together deviate from an even change, and of how far that exceeds LEAP second differences, which
   it never does where values merely bend. */
static const double EVEN = 0.01, UNEVEN = 0.05, UNSTEADY = 0.15;
static const double LEAP = 0.6;
/* Shares of the first sample and of second differences in the mean of a texel with four more. */
static const double FIRST = 0.1, TOWARDS = 0.016;
/* Share of a second difference that a sample of a cell may be off by: 1/8 for a bend, and a little
   more for leaps, whose 1/2 has either sign in the cells along them. */
static const double BEND = 0.15;
static const double BORDER = 0.25; /* share of a first difference, at a border */

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

/* Do what is done at borders, faster, for a texel that `is_inside`. Differences are of single
   precision. Returns how far the four together deviate from an even change, in bounds. */
static double judge_inside(
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
                mean[channel] = (float)(v + (1.0 - FIRST) * mean_away + TOWARDS * bend);
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
                (float)(mean + FIRST * (double)(values[channel] - mean) + TOWARDS * bend);
        }
    }
}

/* Judge a texel whose quarters or neighbors do not all belong to its chart; infinite where too
   little is known. `slopes` is for two rows of channels. */
static double judge_border(
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
            const double away = judge_inside(&samples, &metric, texel, first, means[texel]);
            errors[i] = (float)expected_error(steps[texel], away);
        } else {
            errors[i] = (float)judge_border(
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

/* Judge a cell without a value along an axis; return the greater of that and its error. Whatever of
   the cell is covered is taken to be like its neighbors. */
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
    }
}

/* Mark the cells that are divided; add the errors of the others to their texels. The cells of a
   texel stand together. */
EXPORT void choose_divided(
    int64_t n, int64_t n_texels, bool may_divide, const int32_t texels[n],
    const uint8_t weights[n], const float errors[n], const uint8_t counts[n_texels],
    float texel_errors[n_texels], bool divided[n])
{
    for (int64_t start = 0, stop; start < n; start = stop) {
        const int32_t texel = texels[start];
        double total = 0.0;
        int64_t n_leaves = 0;
        for (stop = start; stop < n && texels[stop] == texel; stop++) {
            total += (float)weights[stop] * errors[stop];
            n_leaves += weights[stop] > 0;
        }
        const double covered = counts[texel];
        const bool is_too_far = may_divide && texel_errors[texel] + total / covered > 1.0;
        for (int64_t i = start; i < stop; i++) {
            const double error = (double)((float)weights[i] * errors[i]) / covered;
            if (is_too_far && weights[i] > 1 && error * (double)n_leaves > 0.5)
                divided[i] = true;
            else
                texel_errors[texel] = (float)(texel_errors[texel] + error);
        }
    }
}
