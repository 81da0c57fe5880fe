/* The texels outside the charts: the nearest one that a chart owns, for every texel around them; and
   push-pull, which fills them smoothly through coarser levels of the image.

   Distances are Euclidean, between texel centers. Among owners at the same distance, the one with the
   fewest columns between wins, then the left one, then the upper one.

   Based on: Felzenszwalb and Huttenlocher, "Distance Transforms of Sampled Functions", 2012, and
   Meijster, Roerdink and Hesselink, "A General Algorithm for Computing Distance Transforms in Linear
   Time", 2000, for columns first and rows second. Departs from them in two ways. Rows are searched in
   a window of the width of the padding, which vectorizes and so is faster for the paddings in use.
   And columns keep a second owner, the nearest of any other chart, which is enough to find every
   texel that lies within the padding of two charts. Gortler et al., "The Lumigraph", 1996, section
   4.3, for push-pull, with weights of 0 or 1 in every level.

   Called from texbake/texture/padding.py and texbake/baking/texel_values.py. */

#include <math.h>
#include <stdlib.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"

/* Texels of a row that the second pass searches together; it skips those that are all owned. */
#define SEGMENT 128

/* "No owner within reach", as an offset in texels; so the greatest padding is one less. As in
   texbake/texture/padding.py. */
#define NO_OWNER 16384

/* Its square and more: no sum of two squared distances within reach comes near it. */
#define FAR (1 << 30)

/* A sweep over columns: the rows of the last owner met and of the last one of another chart than
   that, and the chart of the last. */
struct sweep {
    int32_t *last, *before, *chart;
};

static struct sweep new_sweep(struct arena *arena, int64_t width)
{
    const struct sweep sweep = {
        TAKE(arena, int32_t, width), TAKE(arena, int32_t, width), TAKE(arena, int32_t, width)};
    return sweep;
}

static void begin_sweep(const struct sweep *sweep, int64_t width, int32_t beyond)
{
    for (int64_t x = 0; x < width; x++) {
        sweep->last[x] = sweep->before[x] = beyond;
        sweep->chart[x] = -1;
    }
}

static void meet_row(
    int64_t width, const int32_t charts[restrict width], int32_t row, int32_t last[restrict width],
    int32_t before[restrict width], int32_t chart[restrict width])
{
    for (int64_t x = 0; x < width; x++) {
        const int32_t met = charts[x];
        const int32_t owned = -(met >= 0), other = owned & -(met != chart[x]);
        before[x] = (last[x] & other) | (before[x] & ~other);
        last[x] = (row & owned) | (last[x] & ~owned);
        chart[x] = (met & owned) | (chart[x] & ~owned);
    }
}

/* Write what the sweep down found: owners above. */
static void write_above(
    int64_t width, int32_t row, int32_t reach, const int32_t last[restrict width],
    const int32_t before[restrict width], const int32_t chart[restrict width],
    int16_t nearest[restrict width], int16_t other[restrict width], int32_t owners[restrict width])
{
    for (int64_t x = 0; x < width; x++) {
        const int32_t offset = last[x] - row, offset_2 = before[x] - row;
        nearest[x] = (int16_t)(offset >= -reach ? offset : NO_OWNER);
        other[x] = (int16_t)(offset_2 >= -reach ? offset_2 : NO_OWNER);
        owners[x] = offset >= -reach ? chart[x] : -1;
    }
}

/* Merge what the sweep up found, owners below, into what the sweep down wrote. */
static void merge_below(
    int64_t width, int32_t row, int32_t reach, const struct sweep *sweep, int16_t nearest[width],
    int16_t other[width], int32_t owners[width])
{
    for (int64_t x = 0; x < width; x++) {
        const int32_t down = sweep->last[x] - row, down_2 = sweep->before[x] - row;
        if (down > reach)
            continue;
        const int32_t up = -nearest[x]; /* below 0 where there is none */
        const int32_t up_2 = abs(other[x]);
        const bool same = owners[x] == sweep->chart[x];
        if (up >= 0 && up <= down) {
            const int32_t rival = same ? down_2 : down;
            if (rival < up_2 && rival <= reach)
                other[x] = (int16_t)rival;
        } else {
            const int32_t rival = same || up < 0 ? up_2 : up;
            nearest[x] = (int16_t)down;
            owners[x] = sweep->chart[x];
            if (down_2 < rival)
                other[x] = (int16_t)(down_2 <= reach ? down_2 : NO_OWNER);
            else if (!same && up >= 0)
                other[x] = (int16_t)-up;
        }
    }
}

/* Vertical offsets, down, to the nearest owner and to the nearest of another chart, in columns `start`
   to `stop`; NO_OWNER where there is none within `reach`. `owners` gets the chart of the nearest. */
EXPORT int64_t search_columns(
    int64_t height, int64_t width, const int32_t charts[height][width], int64_t reach,
    int16_t nearest[height][width], int16_t other[height][width], int32_t owners[height][width],
    int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    const int64_t n = stop - start;
    const int32_t far = 2 * NO_OWNER;
    const struct sweep sweep = new_sweep(arena, n);
    begin_sweep(&sweep, n, -far);
    for (int64_t row = 0; row < height; row++) {
        meet_row(n, charts[row] + start, (int32_t)row, sweep.last, sweep.before, sweep.chart);
        write_above(
            n, (int32_t)row, (int32_t)reach, sweep.last, sweep.before, sweep.chart,
            nearest[row] + start, other[row] + start, owners[row] + start);
    }
    begin_sweep(&sweep, n, (int32_t)height + far);
    for (int64_t row = height - 1; row >= 0; row--) {
        meet_row(n, charts[row] + start, (int32_t)row, sweep.last, sweep.before, sweep.chart);
        merge_below(
            n, (int32_t)row, (int32_t)reach, &sweep, nearest[row] + start, other[row] + start,
            owners[row] + start);
    }
    close_arena(arena);
    return 0;
}

/* A row with `reach` empty texels at both ends and the rest of a segment behind it, so that windows
   need no bounds. */
struct padded_row {
    int32_t *owners, *squares, *other_squares;
};

static struct padded_row new_padded_row(struct arena *arena, int64_t width)
{
    const struct padded_row row = {
        TAKE(arena, int32_t, width), TAKE(arena, int32_t, width), TAKE(arena, int32_t, width)};
    for (int64_t x = 0; x < width; x++) {
        row.owners[x] = -1;
        row.squares[x] = row.other_squares[x] = FAR;
    }
    return row;
}

static void fill_padded_row(
    const struct padded_row *row, int64_t reach, int64_t width, const int16_t nearest[width],
    const int16_t other[width], const int32_t owners[width])
{
    for (int64_t x = 0; x < width; x++) {
        const int32_t offset = nearest[x], offset_2 = other[x];
        row->owners[reach + x] = owners[x];
        row->squares[reach + x] = offset != NO_OWNER ? offset * offset : FAR;
        row->other_squares[reach + x] = offset_2 != NO_OWNER ? offset_2 * offset_2 : FAR;
    }
}

static bool is_all_owned(const int32_t charts[], int64_t left, int64_t right)
{
    while (left < right && charts[left] >= 0)
        left++;
    return left == right;
}

/* Whether any square is larger than this. */
static bool is_any_above(const int32_t squares[SEGMENT], int32_t square)
{
    int32_t largest = 0;
    for (int64_t x = 0; x < SEGMENT; x++)
        largest = squares[x] > largest ? squares[x] : largest;
    return largest > square;
}

/* Columns to the nearest owner for each texel of a segment; NO_OWNER where it is too far away.
   `squares` begins `reach` texels, the width of the padding, before the first of them. */
static void search_window(
    const int32_t *restrict squares, int64_t reach, int32_t shift[restrict SEGMENT])
{
    const int32_t *middle = squares + reach;
    const int32_t beyond = (int32_t)(reach * reach + 1);
    int32_t best[SEGMENT];
    for (int64_t x = 0; x < SEGMENT; x++) {
        best[x] = middle[x] < beyond ? middle[x] : beyond;
        shift[x] = middle[x] < beyond ? 0 : NO_OWNER;
    }
    /* Outward to both sides: what is found first stays among equals, and the left one. */
    for (int32_t step = 1; step <= reach; step++) {
        const int32_t square = step * step, *left = middle - step, *right = middle + step;
        if (step % 8 == 1 && !is_any_above(best, square))
            return;
        for (int64_t x = 0; x < SEGMENT; x++) {
            const int32_t nearer = right[x] < left[x] ? right[x] : left[x];
            const int32_t column = right[x] < left[x] ? step : -step;
            const int32_t distance = nearer + square;
            shift[x] = distance < best[x] ? column : shift[x];
            best[x] = distance < best[x] ? distance : best[x];
        }
    }
}

/* Whether a window of a row lies near one chart at most. */
static bool has_one_chart(const struct padded_row *row, int64_t left, int64_t right)
{
    int32_t low = FAR, high = -1, others = FAR;
    for (int64_t x = left; x < right; x++) {
        const int32_t owner = row->owners[x], other = row->other_squares[x];
        low = owner >= 0 && owner < low ? owner : low;
        high = owner > high ? owner : high;
        others = other < others ? other : others;
    }
    return low >= high && others == FAR;
}

/* Of n texels from `left` on, how many have no owner but lie within the padding of two charts. */
static int64_t count_meeting(
    const struct padded_row *row, int64_t reach, int64_t left, int64_t n,
    const int32_t shift[SEGMENT])
{
    if (has_one_chart(row, left, left + n + 2 * reach))
        return 0;
    const int64_t middle = left + reach;
    int32_t chart[SEGMENT], meets[SEGMENT];
    for (int64_t x = 0; x < SEGMENT; x++) {
        chart[x] = shift[x] != NO_OWNER ? row->owners[middle + x + shift[x]] : -1;
        meets[x] = 0;
    }
    for (int64_t dx = -reach; dx <= reach; dx++) {
        const int32_t most = (int32_t)(reach * reach - dx * dx);
        const int32_t *owners = row->owners + middle + dx;
        const int32_t *squares = row->squares + middle + dx;
        const int32_t *other_squares = row->other_squares + middle + dx;
        for (int64_t x = 0; x < SEGMENT; x++) {
            const int32_t square = squares[x], other = other_squares[x];
            meets[x] |= (owners[x] == chart[x] ? other : square) <= most;
        }
    }
    int64_t count = 0;
    for (int64_t x = 0; x < n; x++)
        count += meets[x] && row->squares[middle + x] > 0;
    return count;
}

/* Nearest owners in rows `start` to `stop`, and how many texels of each lie near two charts. At first
   `indices` holds the charts of the columns' nearest owners. */
EXPORT int64_t search_rows(
    int64_t height, int64_t width, const int32_t charts[height][width], int64_t reach,
    const int16_t nearest[height][width], const int16_t other[height][width],
    int32_t indices[height][width], int64_t meeting[height], int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    const struct padded_row padded = new_padded_row(arena, width + 2 * reach + SEGMENT);
    int32_t shift[SEGMENT];
    for (int64_t row = start; row < stop; row++) {
        fill_padded_row(&padded, reach, width, nearest[row], other[row], indices[row]);
        meeting[row] = 0;
        for (int64_t left = 0; left < width; left += SEGMENT) {
            const int64_t n = min_i64(SEGMENT, width - left);
            if (is_all_owned(charts[row], left, left + n)) {
                for (int64_t x = left; x < left + n; x++)
                    indices[row][x] = (int32_t)(row * width + x);
                continue;
            }
            search_window(padded.squares + left, reach, shift);
            for (int64_t x = 0; x < n; x++) {
                const int64_t column = left + x + shift[x];
                indices[row][left + x] =
                    shift[x] != NO_OWNER
                        ? (int32_t)((row + nearest[row][column]) * width + column)
                        : -1;
            }
            meeting[row] += count_meeting(&padded, reach, left, n, shift);
        }
    }
    close_arena(arena);
    return 0;
}

/* Copy texels to others, in place: item `i` of `sources` to that of `targets`. A texel that is not
   finite in all channels is replaced by `neutral`. */
EXPORT void copy_texels(
    int64_t n_texels, int64_t n_channels, int64_t n, float values[n_texels][n_channels],
    const int64_t targets[n], const int32_t sources[n], const float neutral[n_channels],
    int64_t start, int64_t stop)
{
    for (int64_t i = start; i < stop; i++) {
        const float *from = values[sources[i]];
        bool is_finite = true;
        for (int64_t channel = 0; channel < n_channels; channel++)
            is_finite = is_finite && isfinite(from[channel]);
        from = is_finite ? from : neutral;
        for (int64_t channel = 0; channel < n_channels; channel++)
            values[targets[i]][channel] = from[channel];
    }
}

/* Means of the valid, finite texels of each 2 x 2 block, for coarse rows `start` to `stop`. */
EXPORT int64_t push_texels(
    int64_t height, int64_t width, int64_t n_channels, int64_t coarse_height,
    int64_t coarse_width, const float values[height][width][n_channels],
    const bool mask[height][width], float coarse[coarse_height][coarse_width][n_channels],
    bool coarse_mask[coarse_height][coarse_width], int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    double *totals = TAKE(arena, double, n_channels);
    for (int64_t row = start; row < stop; row++)
        for (int64_t column = 0; column < coarse_width; column++) {
            int64_t count = 0;
            for (int64_t channel = 0; channel < n_channels; channel++)
                totals[channel] = 0.0;
            for (int64_t y = 2 * row; y < min_i64(2 * row + 2, height); y++)
                for (int64_t x = 2 * column; x < min_i64(2 * column + 2, width); x++) {
                    bool is_finite = mask[y][x];
                    for (int64_t channel = 0; channel < n_channels; channel++)
                        is_finite = is_finite && isfinite(values[y][x][channel]);
                    if (!is_finite)
                        continue;
                    count++;
                    for (int64_t channel = 0; channel < n_channels; channel++)
                        totals[channel] += values[y][x][channel];
                }
            for (int64_t channel = 0; channel < n_channels; channel++)
                coarse[row][column][channel] =
                    (float)(totals[channel] / (double)max_i64(count, 1));
            coarse_mask[row][column] = count > 0;
        }
    close_arena(arena);
    return 0;
}

/* Fill rows `start` to `stop`, where not valid, with the coarser level, interpolated bilinearly. */
EXPORT void pull_texels(
    int64_t height, int64_t width, int64_t n_channels, int64_t coarse_height,
    int64_t coarse_width, float values[height][width][n_channels], const bool mask[height][width],
    const float coarse[coarse_height][coarse_width][n_channels], int64_t start, int64_t stop)
{
    for (int64_t y = start; y < stop; y++) {
        const int64_t near_row = y / 2;
        const int64_t far_row = clamp_i64(near_row + (y % 2 ? 1 : -1), 0, coarse_height - 1);
        for (int64_t x = 0; x < width; x++) {
            if (mask[y][x])
                continue;
            const int64_t near = x / 2;
            const int64_t far = clamp_i64(near + (x % 2 ? 1 : -1), 0, coarse_width - 1);
            for (int64_t channel = 0; channel < n_channels; channel++) {
                /* Sixteenths of float add up exactly in double, so a constant stays constant. */
                double total = 9.0 * coarse[near_row][near][channel];
                total += 3.0 * coarse[near_row][far][channel];
                total += 3.0 * coarse[far_row][near][channel];
                total += 1.0 * coarse[far_row][far][channel];
                values[y][x][channel] = (float)(total / 16.0);
            }
        }
    }
}
