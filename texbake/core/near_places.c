/* Charts of a layout moved nearer to those that share seams with them, and turned to be the mirror
   images of others.

   A few charts are taken out and put back, the largest first, each into the free place nearest to
   where its seams would be shortest, in any orientation. The change is kept if all of them find a
   place and the cost is lower: the distance between both sides of each seam, by its weight, and a
   penalty for each pair of mirror images that do not mirror each other in the layout. Cells are bits,
   so that the surroundings of a chart are quickly cleared and blocked again.

   Based on: Paul Shaw, "Using constraint programming and local search methods to solve vehicle routing
   problems", 1998 (large neighborhood search: take out and put back).

   Called from texbake/mapping/atlas/packing/nearness.py. */

#include <math.h>
#include <string.h>

#include "core.h"
#include "numbers.h"
#include "packing.h"

enum { MOST_OUT = 4 };  /* charts that are taken out at a time */
enum { SAMPLES = 16 };  /* exchanges of two charts of which the one that gains most is tried */
enum { HALF_TURN = 16 }; /* of directions */
enum { STEPS_OF_A_TRIAL = 500 }; /* fixed cost */

/* What a layout costs. `sides` holds the middle of both sides of each seam in all orientations, in
   cells of the chart's box, and `by_chart` the seams of each chart, from `starts` on. The directions
   of a chart and of its partner add up to half turns if they are mirror images. */
struct costs {
    int64_t n_orientations;
    const int32_t (*owners)[2];
    const int32_t (*sides)[2];
    const double *weights;
    const int64_t *starts;
    const int32_t *by_chart;
    const int32_t *partners;
    const int32_t *directions;
    double penalty;
};

/* Cells of a grid, one bit each, rows of whole words; 1 where a chart is too near. */
struct bits {
    int64_t n_rows, n_columns, n_words;
    uint64_t *words;
};

/* A layout while it changes; charts that are `out` are not in it. */
struct layout {
    const struct shapes *charts;
    const struct costs *costs;
    struct bits cells;
    struct place *places;
    uint8_t *out;
    int64_t steps;
};

static int64_t box_area(const struct shapes *charts, int64_t chart)
{
    const int32_t *box = charts->boxes[index_of(charts, chart, 0)];
    return (int64_t)box[0] * box[1];
}

/* Where the i-th seam of a chart at a place would take it: from its side to the other, and whether
   the other is in the layout. */
static bool way_across(
    const struct layout *layout, int64_t i, int64_t chart, struct place place, double way[2])
{
    const struct costs *costs = layout->costs;
    const int64_t seam = costs->by_chart[i], own = costs->owners[seam][0] == chart ? 0 : 1;
    const int64_t other = costs->owners[seam][1 - own];
    if (layout->out[other])
        return false;
    const struct place there = layout->places[other];
    const int64_t n = costs->n_orientations;
    const int32_t *from = costs->sides[(2 * seam + own) * n + place.orientation];
    const int32_t *to = costs->sides[(2 * seam + 1 - own) * n + there.orientation];
    way[0] = (double)(there.x + to[0] - place.x - from[0]);
    way[1] = (double)(there.y + to[1] - place.y - from[1]);
    return true;
}

/* Whether a chart at a place is the mirror image of its partner, or has none in the layout. */
static bool is_mirrored(const struct layout *layout, int64_t chart, struct place place)
{
    const struct costs *costs = layout->costs;
    const int64_t partner = costs->partners[chart], n = costs->n_orientations;
    if (partner < 0 || layout->out[partner])
        return true;
    const int32_t other = costs->directions[partner * n + layout->places[partner].orientation];
    return (costs->directions[chart * n + place.orientation] + other) % HALF_TURN == 0;
}

/* What a chart costs at a place, without charts that are out. */
static double cost_of(const struct layout *layout, int64_t chart, struct place place)
{
    const struct costs *costs = layout->costs;
    double cost = 0.0, way[2];
    for (int64_t i = costs->starts[chart]; i < costs->starts[chart + 1]; i++)
        if (way_across(layout, i, chart, place, way))
            cost += costs->weights[costs->by_chart[i]] * sqrt(way[0] * way[0] + way[1] * way[1]);
    return is_mirrored(layout, chart, place) ? cost : cost + costs->penalty;
}

/* Where the seams of a chart would have no length in the mean; `weight` gets their sum. */
static struct place wanted_place(
    const struct layout *layout, int64_t chart, int32_t orientation, double *weight)
{
    const struct costs *costs = layout->costs;
    struct place place = layout->places[chart];
    place.orientation = orientation;
    double sums[2] = {0.0, 0.0}, way[2];
    *weight = 0.0;
    for (int64_t i = costs->starts[chart]; i < costs->starts[chart + 1]; i++) {
        if (!way_across(layout, i, chart, place, way))
            continue;
        const double own = costs->weights[costs->by_chart[i]];
        sums[0] += own * way[0];
        sums[1] += own * way[1];
        *weight += own;
    }
    if (*weight > 0.0) {
        place.x += (int32_t)floor(sums[0] / *weight + 0.5);
        place.y += (int32_t)floor(sums[1] / *weight + 0.5);
    }
    return place;
}

/* The bits of a word between two columns. */
static uint64_t bits_within(int64_t word, int64_t begin, int64_t end)
{
    uint64_t bits = ~(uint64_t)0;
    if (word == begin >> 6)
        bits &= ~(uint64_t)0 << (begin & 63);
    if (word == (end - 1) >> 6)
        bits &= ~(uint64_t)0 >> (63 - ((end - 1) & 63));
    return bits;
}

/* The first marked cell of a row from `begin` to `end`, or the last; -1 if there is none. */
static int64_t find_marked(const uint64_t *row, int64_t begin, int64_t end, bool is_last)
{
    const int64_t first = begin >> 6, last = (end - 1) >> 6;
    for (int64_t i = 0; i <= last - first; i++) {
        const int64_t word = is_last ? last - i : first + i;
        const uint64_t bits = row[word] & bits_within(word, begin, end);
        if (bits)
            return 64 * word + (is_last ? 63 - __builtin_clzll(bits) : __builtin_ctzll(bits));
    }
    return -1;
}

/* Find the free column nearest to `x`, to the right of it or to the left, up to `last`; -1 if none. */
static int64_t free_column(
    const struct bits *cells, const struct turned_chart *chart, int64_t x, int64_t y, int64_t last,
    bool is_right, int64_t *probe, int64_t *steps)
{
    int64_t passed = 0;
    while (passed < chart->n_spans && (is_right ? x <= last : x >= last)) {
        ++*steps;
        const struct span span = chart->spans[*probe];
        const uint64_t *row = cells->words + (y + span.row) * cells->n_words;
        const int64_t at = find_marked(row, x + span.begin, x + span.end, is_right);
        if (at >= 0) {
            x = is_right ? at + 1 - span.begin : at - span.end;
            passed = 0;
            continue;
        }
        passed++;
        /* The span that failed last is the likeliest to fail again. */
        *probe = *probe + 1 < chart->n_spans ? *probe + 1 : 0;
    }
    return (is_right ? x <= last : x >= last) ? x : -1;
}

/* Find the free place of a row nearest to a column, less than `radius` from it; -1 if none is. */
static int64_t nearest_in_row(
    const struct bits *cells, const struct turned_chart *chart, int64_t y, int64_t column,
    int64_t radius, int64_t *steps)
{
    int64_t probe = 0;
    const int64_t last = min_i64(cells->n_columns - chart->width, column + radius - 1);
    const int64_t right = free_column(cells, chart, column, y, last, true, &probe, steps);
    if (right >= 0)
        radius = right - column;
    const int64_t least = max_i64(column - radius + 1, 0);
    const int64_t left = free_column(cells, chart, column - 1, y, least, false, &probe, steps);
    return left >= 0 ? left : right;
}

/* Find the free place nearest to a wanted one, nearer than `radius`; false if there is none. */
static bool find_nearest(
    struct layout *layout, const struct turned_chart *shape, double radius, struct place *place)
{
    const int64_t last = layout->cells.n_rows - shape->height;
    const int64_t column = clamp_i64(place->x, 0, layout->cells.n_columns - shape->width);
    const int64_t row = clamp_i64(place->y, 0, last);
    int64_t nearest = (int64_t)(radius * radius);
    bool is_found = false;
    for (int64_t step = 0; step <= last && step * step < nearest; step++) {
        for (int side = 0; side < (step ? 2 : 1); side++) {
            const int64_t y = row + (side ? -step : step);
            if (y < 0 || y > last)
                continue;
            const int64_t aside = (int64_t)sqrt((double)max_i64(nearest - step * step, 0)) + 1;
            const int64_t x =
                nearest_in_row(&layout->cells, shape, y, column, aside, &layout->steps);
            const int64_t distance = (x - column) * (x - column) + step * step;
            if (x < 0 || distance >= nearest)
                continue;
            nearest = distance;
            is_found = true;
            place->x = (int32_t)x;
            place->y = (int32_t)y;
        }
    }
    return is_found;
}

/* Find the cheapest place for a chart, of those nearest to the wanted ones in all orientations; return
   its cost, or `most` if none costs less. */
static double find_place(
    struct layout *layout, int64_t chart, double most, struct place *found)
{
    const double farthest = (double)(layout->cells.n_rows + layout->cells.n_columns);
    for (int32_t i = 0; i < layout->charts->n_orientations; i++) {
        const struct turned_chart shape = turned(layout->charts, chart, i);
        if (shape.height > layout->cells.n_rows || shape.width > layout->cells.n_columns)
            continue;
        double weight;
        struct place place = wanted_place(layout, chart, i, &weight);
        /* At any place, seams cost at least the way from the wanted one. */
        const double radius = weight * farthest > most ? most / weight + 1.0 : farthest;
        if (!find_nearest(layout, &shape, radius, &place))
            continue;
        const double cost = cost_of(layout, chart, place);
        if (cost < most) {
            most = cost;
            *found = place;
        }
    }
    return most;
}

/* Block the cells in reach of a chart, in some rows. */
static void block(struct layout *layout, int64_t chart, int64_t first, int64_t last)
{
    const struct shapes *charts = layout->charts;
    const struct place place = layout->places[chart];
    const int64_t *range = charts->reach_starts[index_of(charts, chart, place.orientation)];
    layout->steps += range[1] - range[0];
    for (int64_t i = range[0]; i < range[1]; i++) {
        const struct span span = charts->reach[i];
        const int64_t row = place.y + span.row;
        const int64_t begin = max_i64(place.x + span.begin, 0);
        const int64_t end = min_i64(place.x + span.end, layout->cells.n_columns);
        if (row < first || row >= last || begin >= end)
            continue;
        uint64_t *words = layout->cells.words + row * layout->cells.n_words;
        for (int64_t word = begin >> 6; word <= (end - 1) >> 6; word++)
            words[word] |= bits_within(word, begin, end);
    }
}

/* Mark the cells near the rows of a chart at a place again, without charts that are out. */
static void renew_rows(struct layout *layout, int64_t chart, struct place at)
{
    const struct shapes *charts = layout->charts;
    const struct bits *cells = &layout->cells;
    const int64_t height = charts->boxes[index_of(charts, chart, at.orientation)][1];
    const int64_t first = max_i64(at.y - charts->margin, 0);
    const int64_t last = min_i64(at.y + height + charts->margin, cells->n_rows);
    const size_t n_bytes = (size_t)((last - first) * cells->n_words) * sizeof *cells->words;
    memset(cells->words + first * cells->n_words, 0, n_bytes);
    layout->steps += (last - first) * cells->n_words / 4 + charts->n_charts;
    for (int64_t other = 0; other < charts->n_charts; other++) {
        const struct place place = layout->places[other];
        const int32_t *box = charts->boxes[index_of(charts, other, place.orientation)];
        if (!layout->out[other] && place.y - charts->margin < last
            && place.y + box[1] + charts->margin > first)
            block(layout, other, first, last);
    }
}

/* How much lower the cost would be if two charts exchanged places, center on center. */
static double gain_of_exchange(struct layout *layout, int64_t one, int64_t two)
{
    struct place *places = layout->places;
    const struct place before[2] = {places[one], places[two]};
    const struct shapes *charts = layout->charts;
    const int32_t *a = charts->boxes[index_of(charts, one, before[0].orientation)];
    const int32_t *b = charts->boxes[index_of(charts, two, before[1].orientation)];
    const double cost = cost_of(layout, one, before[0]) + cost_of(layout, two, before[1]);
    places[one].x = before[1].x + (b[0] - a[0]) / 2;
    places[one].y = before[1].y + (b[1] - a[1]) / 2;
    places[two].x = before[0].x + (a[0] - b[0]) / 2;
    places[two].y = before[0].y + (a[1] - b[1]) / 2;
    const double after = cost_of(layout, one, places[one]) + cost_of(layout, two, places[two]);
    places[one] = before[0];
    places[two] = before[1];
    return cost - after;
}

/* Choose charts to take out: a pair that is not mirrored or two of similar size that should exchange
   places, or one of both, or these and any others. Writes them, the largest first; returns how many. */
static int64_t choose(struct layout *layout, uint64_t *state, int64_t chosen[MOST_OUT])
{
    const struct shapes *charts = layout->charts;
    const int64_t n_charts = charts->n_charts;
    const int64_t most = min_i64(1 + next_random(state) % MOST_OUT, n_charts);
    int64_t pair[2] = {next_random(state) % n_charts, next_random(state) % n_charts};
    const int32_t partner = layout->costs->partners[pair[0]];
    if (partner >= 0 && !is_mirrored(layout, pair[0], layout->places[pair[0]]))
        pair[1] = partner;
    double best = 0.0;
    for (int k = 0; k < SAMPLES && pair[1] != partner; k++) {
        const int64_t one = next_random(state) % n_charts, two = next_random(state) % n_charts;
        const int64_t areas[2] = {box_area(charts, one), box_area(charts, two)};
        if (one == two || areas[0] > 2 * areas[1] || areas[1] > 2 * areas[0])
            continue;
        const double gain = gain_of_exchange(layout, one, two);
        if (gain > best) {
            best = gain;
            pair[0] = one;
            pair[1] = two;
        }
    }
    int64_t n = 0;
    while (n < most) {
        const int64_t chart = n < 2 && pair[n] >= 0 ? pair[n] : next_random(state) % n_charts;
        int64_t at = 0;
        while (at < n && chosen[at] != chart)
            at++;
        if (at < n) {
            pair[1] = -1;
            continue;
        }
        for (; at > 0 && box_area(charts, chosen[at - 1]) < box_area(charts, chart); at--)
            chosen[at] = chosen[at - 1];
        chosen[at] = chart;
        n++;
    }
    return n;
}

/* Take charts out and put them back where they cost less, or where they were. */
static void move_some(struct layout *layout, int64_t n, const int64_t chosen[MOST_OUT])
{
    struct place *places = layout->places, before[MOST_OUT];
    double cost = 0.0, changed = 0.0;
    for (int64_t k = 0; k < n; k++) {
        before[k] = places[chosen[k]];
        cost += cost_of(layout, chosen[k], before[k]);
        layout->out[chosen[k]] = 1;
    }
    for (int64_t k = 0; k < n; k++)
        renew_rows(layout, chosen[k], before[k]);
    int64_t n_placed = 0;
    for (; n_placed < n && changed < cost; n_placed++) {
        const int64_t chart = chosen[n_placed];
        const double most = cost - changed;
        const double own = find_place(layout, chart, most, &places[chart]);
        if (!(own < most))
            break;
        changed += own;
        layout->out[chart] = 0;
        block(layout, chart, 0, layout->cells.n_rows);
    }
    if (n_placed == n && changed < cost)
        return;
    struct place tried[MOST_OUT];
    for (int64_t k = 0; k < n; k++) {
        tried[k] = places[chosen[k]];
        places[chosen[k]] = before[k];
        layout->out[chosen[k]] = 0;
    }
    for (int64_t k = 0; k < n; k++)
        renew_rows(layout, chosen[k], before[k]);
    for (int64_t k = 0; k < n_placed; k++)
        renew_rows(layout, chosen[k], tried[k]);
}

/* Move charts until `most_work` is done. */
EXPORT int64_t move_nearer(
    int64_t n_spans, int64_t n_reach, int64_t n_charts, int64_t n_orientations, int64_t n_seams,
    const int32_t boxes[n_charts][n_orientations][2], const int32_t spans[n_spans][3],
    const int64_t starts[n_charts][n_orientations][2], const int32_t reach[n_reach][3],
    const int64_t reach_starts[n_charts][n_orientations][2], int64_t margin,
    const int32_t owners[n_seams][2], const int32_t sides[n_seams][2][n_orientations][2],
    const double weights[n_seams], const int64_t seam_starts[n_charts + 1],
    const int32_t by_chart[2 * n_seams], const int32_t partners[n_charts],
    const int32_t directions[n_charts][n_orientations], double penalty, int64_t n_rows,
    int64_t n_columns, int64_t most_work, int32_t places[n_charts][3])
{
    OPEN_ARENA(arena);
    const struct shapes charts = {n_charts, n_orientations, boxes[0], (const struct span *)spans,
        starts[0], (const struct span *)reach, reach_starts[0], margin};
    const struct costs costs = {n_orientations, owners, sides[0][0], weights, seam_starts, by_chart,
        partners, directions[0], penalty};
    const int64_t n_words = (n_columns + 63) / 64;
    struct layout layout = {&charts, &costs,
        {n_rows, n_columns, n_words, TAKE_ZEROS(arena, uint64_t, n_rows * n_words)},
        (struct place *)places, TAKE_ZEROS(arena, uint8_t, n_charts), 0};
    for (int64_t chart = 0; chart < n_charts; chart++)
        block(&layout, chart, 0, n_rows);
    uint64_t state = 1;
    while (layout.steps < most_work) {
        layout.steps += STEPS_OF_A_TRIAL;
        int64_t chosen[MOST_OUT];
        const int64_t n = choose(&layout, &state, chosen);
        move_some(&layout, n, chosen);
    }
    close_arena(arena);
    return 0;
}
