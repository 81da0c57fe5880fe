/* Overlapping charts moved apart by guided local search.

   One chart after another moves to where it overlaps the others least, among sampled places and
   orientations that are followed downhill. The cost of an overlap is learnt for each pair of charts:
   it grows while the pair overlaps and fades when it does not, which drives the search out of dead
   ends.

   Based on:
   - Jens Egeblad, Benny K. Nielsen, Allan Odgaard, "Fast neighborhood search for two- and
     three-dimensional nesting problems", European Journal of Operational Research 183, 2007 (least
     overlap by guided local search).
   - Jeroen Gardeyn, Greet Vanden Berghe, Tony Wauters, "An open-source heuristic to reboot 2D
     nesting research", 2025 (samples followed downhill; weights that grow with the overlap).

   It departs from them in counting overlaps in cells of bitmaps. The cost of each cell is summed
   along rows, so that one subtraction gives the cost of a run of cells, and a layout without overlap
   is exact.

   Called from texbake/mapping/atlas/packing/refine.py. */

#include <string.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"
#include "packing.h"

static const int64_t MOST_WEIGHT = 1 << 14;
static const int64_t ALL_OVER = 6; /* one in this many moves samples the whole grid */
static const int64_t NONE_YET = (int64_t)1 << 60;

struct window {
    int64_t left, bottom, right, top;
};

/* Values of the cells of a grid summed along rows: what lies left of each cell. */
struct row_sums {
    int64_t n_columns; /* one more than the grid has */
    int32_t *sums;
};

struct search {
    int64_t n_samples, radius, step, patience, work;
};

/* Whether a window may come within the margin of a chart. */
static bool is_near(
    const struct shapes *shapes, const struct place *places, int64_t chart, struct window window)
{
    const struct place place = places[chart];
    const int32_t *box = shapes->boxes[index_of(shapes, chart, place.orientation)];
    return place.x - shapes->margin < window.right && place.y - shapes->margin < window.top
        && place.x + box[0] + shapes->margin > window.left
        && place.y + box[1] + shapes->margin > window.bottom;
}

static void clear(const struct row_sums *rows, struct window window)
{
    const size_t n_bytes = (size_t)(window.right - window.left + 1) * sizeof *rows->sums;
    for (int64_t row = window.bottom; row < window.top; row++)
        memset(rows->sums + row * rows->n_columns + window.left, 0, n_bytes);
}

/* Turn the steps of a value along each row into sums of the value over the cells before. */
static void integrate(const struct row_sums *rows, struct window window)
{
    for (int64_t row = window.bottom; row < window.top; row++) {
        int32_t *sums = rows->sums + row * rows->n_columns;
        int64_t value = 0, total = 0;
        for (int64_t column = window.left; column <= window.right; column++) {
            value += sums[column];
            sums[column] = (int32_t)total;
            total += value;
        }
    }
}

/* Add a value to the cells of a row, as a step up and a step down. */
static void add_run(int32_t *sums, int64_t begin, int64_t end, int64_t value)
{
    sums[begin] = (int32_t)(sums[begin] + value);
    sums[end] = (int32_t)(sums[end] - value);
}

static struct window box_of(const struct shapes *shapes, int64_t chart, struct place place)
{
    const int32_t *box = shapes->boxes[index_of(shapes, chart, place.orientation)];
    return (struct window){
        place.x, place.y, (int64_t)place.x + box[0], (int64_t)place.y + box[1]};
}

/* Count the cells of a window, summed along rows, that lie in reach of a chart. */
static int64_t count_overlap(
    const struct shapes *shapes, struct place place, int64_t chart, struct window window,
    const struct row_sums *rows)
{
    const int64_t *range = shapes->reach_starts[index_of(shapes, chart, place.orientation)];
    int64_t count = 0;
    for (int64_t i = range[0]; i < range[1]; i++) {
        const struct span span = shapes->reach[i];
        const int64_t row = place.y + span.row;
        const int64_t begin = max_i64(place.x + span.begin, window.left);
        const int64_t end = min_i64(place.x + span.end, window.right);
        if (window.bottom <= row && row < window.top && begin < end) {
            const int32_t *sums = rows->sums + row * rows->n_columns;
            count += (int64_t)sums[end] - sums[begin];
        }
    }
    return count;
}

/* Recount the overlaps of every chart that has moved; return the work. */
static int64_t renew_overlaps(
    const struct shapes *shapes, const struct place *places, const uint8_t *moved,
    const struct row_sums *rows, int32_t *overlaps)
{
    const int64_t n_charts = shapes->n_charts;
    int64_t work = n_charts * n_charts;
    for (int64_t chart = 0; chart < n_charts; chart++) {
        if (!moved[chart])
            continue;
        const struct place place = places[chart];
        const struct window window = box_of(shapes, chart, place);
        /* The number of this chart's cells, summed along each row. */
        clear(rows, window);
        const int64_t *range = shapes->starts[index_of(shapes, chart, place.orientation)];
        for (int64_t i = range[0]; i < range[1]; i++) {
            const struct span span = shapes->spans[i];
            int32_t *sums = rows->sums + (place.y + span.row) * rows->n_columns + place.x;
            add_run(sums, span.begin, span.end, 1);
        }
        integrate(rows, window);
        work += (window.right - window.left) * (window.top - window.bottom);
        for (int64_t other = 0; other < n_charts; other++) {
            if (other == chart || (moved[other] && other < chart))
                continue;
            int64_t count = 0;
            if (is_near(shapes, places, other, window))
                count = count_overlap(shapes, places[other], other, window, rows);
            overlaps[chart * n_charts + other] = (int32_t)count;
            overlaps[other * n_charts + chart] = (int32_t)count;
        }
    }
    return work;
}

/* Raise the weights of overlapping pairs and lower the others; return the total overlap. */
static int64_t learn(
    int64_t n_charts, const int32_t *overlaps, const int32_t *base, int32_t *weights,
    uint8_t *overlapping)
{
    int64_t total = 0, most = 1;
    for (int64_t a = 0; a < n_charts; a++) {
        overlapping[a] = 0;
        for (int64_t b = 0; b < a; b++) {
            const int64_t at = a * n_charts + b;
            total += overlaps[at];
            most = max_i64(most, (int64_t)overlaps[at] * base[at]);
        }
    }
    for (int64_t a = 0; a < n_charts; a++) {
        for (int64_t b = 0; b < a; b++) {
            const int64_t at = a * n_charts + b;
            const int64_t cost = (int64_t)overlaps[at] * base[at];
            int64_t weight = weights[at];
            if (cost > 0) {
                overlapping[a] = overlapping[b] = 1;
                weight = floor_div(weight * (5 * most + 4 * cost), 4 * most) + 1;
                weight = min_i64(weight, MOST_WEIGHT);
            } else {
                weight = max_i64(floor_div(weight * 15, 16), base[at]);
            }
            weights[at] = weights[b * n_charts + a] = (int32_t)weight;
        }
    }
    return total;
}

/* Sum along rows what each cell of a window costs a chart; return the work. */
static int64_t sum_costs(
    int64_t chart, const struct shapes *shapes, const struct place *places,
    const int32_t *weights, struct window window, const struct row_sums *rows)
{
    clear(rows, window);
    for (int64_t other = 0; other < shapes->n_charts; other++) {
        if (other == chart || !is_near(shapes, places, other, window))
            continue;
        const struct place place = places[other];
        const int64_t *range = shapes->reach_starts[index_of(shapes, other, place.orientation)];
        for (int64_t i = range[0]; i < range[1]; i++) {
            const struct span span = shapes->reach[i];
            const int64_t row = place.y + span.row;
            const int64_t begin = max_i64(place.x + span.begin, window.left);
            const int64_t end = min_i64(place.x + span.end, window.right);
            if (window.bottom <= row && row < window.top && begin < end)
                add_run(rows->sums + row * rows->n_columns, begin, end, weights[other]);
        }
    }
    integrate(rows, window);
    return 2 * (window.right - window.left) * (window.top - window.bottom);
}

/* Weighted overlap of a chart at a place; not exact once it has reached `limit`. */
static int64_t cost_at(
    int64_t n_spans, const struct span *spans, const struct row_sums *rows, int64_t x, int64_t y,
    int64_t limit)
{
    /* Rows far apart come first, so that a large overlap shows early. */
    const int64_t stride = n_spans > 14 ? 7 : 1;
    int64_t total = 0;
    for (int64_t phase = 0; phase < stride; phase++) {
        for (int64_t i = phase; i < n_spans; i += stride) {
            const int32_t *sums = rows->sums + (y + spans[i].row) * rows->n_columns + x;
            total += (int64_t)sums[spans[i].end] - sums[spans[i].begin];
        }
        if (total >= limit)
            return total;
    }
    return total;
}

/* A place to move to, and what it costs. */
struct candidate {
    int64_t cost, x, y, orientation;
};

/* Follow lower costs downhill; return the number of steps. */
static int64_t descend(
    int64_t n_spans, const struct span *spans, const int32_t box[2], const struct row_sums *rows,
    struct window window, int64_t step, struct candidate *candidate)
{
    int64_t n_steps = 0;
    while (candidate->cost > 0) {
        bool is_found = false;
        for (int64_t neighbor = 0; neighbor < 9 && !is_found; neighbor++) {
            const int64_t x = candidate->x + (neighbor % 3 - 1) * step;
            const int64_t y = candidate->y + (neighbor / 3 - 1) * step;
            if (neighbor == 4 || x < window.left || y < window.bottom
                || x + box[0] > window.right || y + box[1] > window.top)
                continue;
            n_steps++;
            const int64_t cost = cost_at(n_spans, spans, rows, x, y, candidate->cost);
            if (cost < candidate->cost) {
                candidate->cost = cost;
                candidate->x = x;
                candidate->y = y;
                is_found = true;
            }
        }
        if (!is_found) {
            if (step == 1)
                break;
            step /= 2;
        }
    }
    return n_steps;
}

/* The k-th sampled place in a window; a third of them lie near the present place, the one before
   the first. */
static struct candidate sample_place(
    int64_t k, struct place now, int64_t orientation, const int32_t box[2], struct window window,
    int64_t step, uint64_t *state)
{
    const int64_t across = next_random(state), up = next_random(state);
    struct candidate sample = {0, now.x, now.y, orientation};
    const int64_t last_x = window.right - box[0], last_y = window.top - box[1];
    if (k >= 0 && k % 3 == 0) {
        sample.x = clamp_i64(now.x + across % (2 * step + 1) - step, window.left, last_x);
        sample.y = clamp_i64(now.y + up % (2 * step + 1) - step, window.bottom, last_y);
    } else if (k >= 0) {
        sample.x = window.left + across % (last_x - window.left + 1);
        sample.y = window.bottom + up % (last_y - window.bottom + 1);
    }
    return sample;
}

/* Sample places in a window: write the present place and the best three samples; return the work. */
static int64_t sample_places(
    int64_t chart, const struct shapes *shapes, struct place now, const struct row_sums *rows,
    struct window window, const struct search *search, uint64_t *state, struct candidate best[4])
{
    int64_t work = 0;
    for (int64_t k = -1; k < search->n_samples; k++) {
        const int64_t drawn = next_random(state);
        const int64_t orientation = k >= 0 ? drawn % shapes->n_orientations : now.orientation;
        const int64_t at_shape = index_of(shapes, chart, orientation);
        const int32_t *box = shapes->boxes[at_shape];
        if (box[0] > window.right - window.left || box[1] > window.top - window.bottom)
            continue;
        struct candidate sample =
            sample_place(k, now, orientation, box, window, search->step, state);
        const int64_t *range = shapes->starts[at_shape];
        const int64_t n_spans = range[1] - range[0];
        sample.cost =
            cost_at(n_spans, shapes->spans + range[0], rows, sample.x, sample.y, best[3].cost);
        work += n_spans;
        int at = k < 0 ? 0 : 3;
        if (sample.cost >= best[at].cost)
            continue;
        for (; at > 1 && sample.cost < best[at - 1].cost; at--)
            best[at] = best[at - 1];
        best[at] = sample;
        if (sample.cost == 0)
            break;
    }
    return work;
}

/* Move a chart to the cheapest place in a window that samples lead to; return the work. */
static int64_t move(
    int64_t chart, const struct shapes *shapes, struct place *places, const struct row_sums *rows,
    struct window window, const struct search *search, uint64_t *state)
{
    struct candidate candidates[4];
    for (int k = 0; k < 4; k++)
        candidates[k] = (struct candidate){NONE_YET, 0, 0, 0};
    int64_t work =
        sample_places(chart, shapes, places[chart], rows, window, search, state, candidates);
    int best = 0;
    for (int k = 0; k < 4; k++) {
        struct candidate *candidate = &candidates[k];
        if (candidate->cost >= NONE_YET || candidates[best].cost <= 0)
            continue;
        const int64_t at = index_of(shapes, chart, candidate->orientation);
        const int64_t *range = shapes->starts[at];
        const int64_t n_spans = range[1] - range[0];
        work += n_spans * descend(
            n_spans, shapes->spans + range[0], shapes->boxes[at], rows, window, search->step,
            candidate);
        if (candidate->cost < candidates[best].cost)
            best = k;
    }
    const struct candidate *chosen = &candidates[best];
    places[chart] = (struct place){
        (int32_t)chosen->x, (int32_t)chosen->y, (int32_t)chosen->orientation};
    return work;
}

/* The part of the grid that a chart's move samples: around it, or now and then all of it. */
static struct window window_around(
    const struct shapes *shapes, int64_t chart, struct place place, int64_t aside,
    int64_t n_rows, int64_t n_columns)
{
    const struct window box = box_of(shapes, chart, place);
    return (struct window){
        max_i64(box.left - aside, 0), max_i64(box.bottom - aside, 0),
        min_i64(box.right + aside, n_columns), min_i64(box.top + aside, n_rows)};
}

/* Shuffle the charts, and move those that overlap; clear `moved` of those that stayed where they
   were. Returns the work. */
static int64_t move_all(
    const struct shapes *shapes, struct place *places, const int32_t *weights, int64_t n_rows,
    const struct row_sums *rows, const struct search *search, uint64_t *state, int64_t *order,
    uint8_t *moved)
{
    const int64_t n_charts = shapes->n_charts, n_columns = rows->n_columns - 1;
    for (int64_t i = n_charts - 1; i > 0; i--) {
        const int64_t k = next_random(state) % (i + 1), chart = order[i];
        order[i] = order[k];
        order[k] = chart;
    }
    int64_t work = 0;
    for (int64_t i = 0; i < n_charts; i++) {
        const int64_t chart = order[i];
        if (!moved[chart])
            continue;
        const struct place before = places[chart];
        const bool is_near_by = next_random(state) % ALL_OVER != 0;
        const int64_t aside = is_near_by ? search->radius : max_i64(n_columns, n_rows);
        const struct window window =
            window_around(shapes, chart, before, aside, n_rows, n_columns);
        work += sum_costs(chart, shapes, places, weights + chart * n_charts, window, rows);
        work += move(chart, shapes, places, rows, window, search, state);
        const struct place after = places[chart];
        if (before.x == after.x && before.y == after.y && before.orientation == after.orientation)
            moved[chart] = 0;
    }
    return work;
}

/* Move charts until none overlap; return the least overlap. `best_places` gets the places that have
   it, `work` the steps of the search. `places` and `weights` change. */
EXPORT int64_t separate_charts(
    int64_t n_charts, int64_t n_orientations, int64_t n_spans, int64_t n_reach,
    const int32_t boxes[n_charts][n_orientations][2], const int32_t spans[n_spans][3],
    const int64_t starts[n_charts][n_orientations][2], const int32_t reach[n_reach][3],
    const int64_t reach_starts[n_charts][n_orientations][2], int64_t margin,
    int32_t places[n_charts][3], const int32_t base[n_charts][n_charts],
    int32_t weights[n_charts][n_charts], int64_t n_rows, int64_t n_columns, int64_t n_samples,
    int64_t radius, int64_t step, int64_t patience, int64_t most_work, int64_t seed,
    int32_t best_places[n_charts][3], int64_t work[1])
{
    OPEN_ARENA(arena);
    const struct shapes shapes = {
        n_charts, n_orientations, boxes[0], (const struct span *)spans, starts[0],
        (const struct span *)reach, reach_starts[0], margin};
    const struct search search = {n_samples, radius, step, patience, most_work};
    const struct row_sums rows = {
        n_columns + 1, TAKE_ZEROS(arena, int32_t, n_rows * (n_columns + 1))};
    struct place *now = (struct place *)places;
    int32_t *overlaps = TAKE_ZEROS(arena, int32_t, n_charts * n_charts);
    int64_t *order = TAKE(arena, int64_t, n_charts);
    uint8_t *moved = TAKE(arena, uint8_t, n_charts);
    for (int64_t chart = 0; chart < n_charts; chart++) {
        order[chart] = chart;
        moved[chart] = 1;
    }
    uint64_t state = (uint64_t)seed;
    int64_t least = NONE_YET, idle = 0, done = 0;
    while (true) {
        done += renew_overlaps(&shapes, now, moved, &rows, overlaps);
        const int64_t total = learn(n_charts, overlaps, base[0], weights[0], moved);
        if (total < least) {
            if (total < least - floor_div(least, 50))
                idle = 0;
            least = total;
            memcpy(best_places, places, (size_t)n_charts * sizeof *best_places);
        }
        if (total == 0 || idle >= search.patience || done > search.work)
            break;
        idle++;
        done += move_all(&shapes, now, weights[0], n_rows, &rows, &search, &state, order, moved);
    }
    work[0] = done;
    close_arena(arena);
    return least;
}
