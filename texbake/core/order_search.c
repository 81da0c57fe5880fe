/* Charts placed in one order after another, each a small change of the one before.

   A change is kept if the charts end no higher than they did some changes ago. Charts before the first
   one that a change moves keep their places, and an order is given up as soon as it is sure to be
   worse.

   Based on: Edmund K. Burke, Yuri Bykov, "The late acceptance hill-climbing heuristic", European
   Journal of Operational Research 258, 2017 (which changes of the order are kept).

   Called from texbake/mapping/atlas/packing/search.py. */

#include <math.h>
#include <string.h>

#include "core.h"
#include "numbers.h"
#include "packing.h"

enum { HISTORY = 20 };         /* changes after which a score is compared again */
enum { STEPS_OF_A_SEARCH = 40 }; /* fixed cost of a search for one chart in one orientation */

/* The shares of the areas of charts decide between two equally high layouts: the one with less area
   near the top is better, because it is likelier to become lower. */
struct charts {
    struct shapes shapes;
    const double *shares;
};

/* An order, the places of the charts, the row above all of them, and the score: lower is better. */
struct layout {
    int32_t *order;
    struct place *places;
    int64_t top;
    double score;
};

/* Find the orientation and place of a chart with the lowest top; `guess` is tried first, since a low
   top leaves less to search. Returns the top, or -1 if there is no place. */
static int64_t find_place(
    const struct shapes *charts, int64_t chart, const struct free_cells *cells, int32_t guess,
    struct place *place, int64_t *work)
{
    int64_t least = cells->n_rows + 1;
    int32_t best = -1;
    for (int32_t i = -1; i < charts->n_orientations; i++) {
        const int32_t orientation = i < 0 ? guess : i;
        const struct turned_chart shape = turned(charts, chart, orientation);
        /* Of equally low places, that of the first orientation is taken, whatever the guess. */
        const int64_t below = least + (orientation < best);
        if (i == guess || shape.width > cells->n_columns || shape.height >= below)
            continue;
        *work += STEPS_OF_A_SEARCH;
        const struct spot spot = lowest_place(cells, &shape, (struct spot){0, 0}, below, work);
        if (spot.y < 0)
            continue;
        least = spot.y + shape.height;
        best = orientation;
        *place = (struct place){(int32_t)spot.x, (int32_t)spot.y, orientation};
    }
    return best < 0 ? -1 : least;
}

/* Place the charts from the `first` of an order on; those before have places. The score is infinite
   if it is above `limit`. */
static void place_from(
    const struct charts *charts, int64_t first, const struct free_cells *cells, double limit,
    struct layout *layout, int64_t *work)
{
    static const int32_t ALONE[1] = {0};
    free_all(cells);
    *work += cells->n_rows * cells->n_columns / 16;
    layout->top = 0;
    layout->score = INFINITY;
    double sum = 0.0;
    for (int64_t i = 0; i < charts->shapes.n_charts; i++) {
        const int32_t chart = layout->order[i];
        struct place *place = &layout->places[chart];
        if (i >= first
            && find_place(&charts->shapes, chart, cells, place->orientation, place, work) < 0)
            return;
        const struct turned_chart shape = turned(&charts->shapes, chart, place->orientation);
        *work += block_chart(cells, &shape, place->x, place->y, 1, ALONE) / 4;
        const int64_t top = place->y + shape.height;
        layout->top = max_i64(layout->top, top);
        sum += charts->shares[chart] * (double)top;
        if ((double)layout->top + sum > limit)
            return;
    }
    layout->score = (double)layout->top + sum;
}

/* Swap two charts of an order, or move one, mostly a short way; return the first place that differs. */
static int64_t change(int64_t n, int32_t *order, uint64_t *state)
{
    const int64_t range = max_i64(n / 3, 3);
    const int64_t i = next_random(state) % n;
    const int64_t step = next_random(state) % range - next_random(state) % range;
    const int64_t j = clamp_i64(i + step, 0, n - 1);
    const int32_t chart = order[i];
    if (next_random(state) % 2 == 0) {
        order[i] = order[j];
    } else if (i < j) {
        memmove(order + i, order + i + 1, (size_t)(j - i) * sizeof *order);
    } else {
        memmove(order + j + 1, order + j, (size_t)(i - j) * sizeof *order);
    }
    order[j] = chart;
    return min_i64(i, j);
}

static void copy_layout(int64_t n, const struct layout *from, struct layout *to)
{
    memcpy(to->order, from->order, (size_t)n * sizeof *to->order);
    memcpy(to->places, from->places, (size_t)n * sizeof *to->places);
    to->top = from->top;
    to->score = from->score;
}

/* Change the order until the charts end at `height` or lower, or `most_work` is done; return the row
   above the charts, or `n_rows` + 1 if they did not even fit into the grid. `order` and `places` (with
   the orientations to try first) become those of the last layout that was kept; `work` gets the steps
   of the search. */
EXPORT int64_t search_orders(
    int64_t n_spans, int64_t n_charts, int64_t n_orientations,
    const int32_t boxes[n_charts][n_orientations][2], const int32_t spans[n_spans][3],
    const int64_t starts[n_charts][n_orientations][2], const double shares[n_charts],
    int64_t n_rows, int64_t n_columns, int64_t height, int64_t most_work, int64_t seed,
    int32_t order[n_charts], int32_t places[n_charts][3], int64_t work[1])
{
    OPEN_ARENA(arena);
    const struct charts charts = {{n_charts, n_orientations, boxes[0], (const struct span *)spans,
        starts[0], NULL, NULL, 0}, shares};
    struct free_cells cells = take_cells(arena, n_rows, n_columns);
    struct layout now = {order, (struct place *)places, 0, 0.0};
    struct layout next = {
        TAKE(arena, int32_t, n_charts), TAKE(arena, struct place, n_charts), 0, 0.0};
    uint64_t state = (uint64_t)seed;
    work[0] = 0;
    place_from(&charts, 0, &cells, INFINITY, &now, work);
    double history[HISTORY];
    for (int i = 0; i < HISTORY; i++)
        history[i] = now.score;
    for (int64_t step = 0; now.top > height && isfinite(now.score) && work[0] < most_work; step++) {
        copy_layout(n_charts, &now, &next);
        const int64_t first = change(n_charts, next.order, &state);
        const double limit = max_f64(now.score, history[step % HISTORY]);
        cells.n_rows = min_i64((int64_t)limit, n_rows);
        place_from(&charts, first, &cells, limit, &next, work);
        if (next.score <= limit)
            copy_layout(n_charts, &next, &now);
        history[step % HISTORY] = now.score;
    }
    close_arena(arena);
    return isfinite(now.score) ? now.top : n_rows + 1;
}
