/* Charts placed one after another, each in the lowest and then leftmost free place.

   Free cells are stored as runs, so that a search along a row jumps from obstacle to obstacle
   instead of going from cell to cell. The whole bitmap is searched, not only its skyline, so that
   holes are filled.

   Based on: Bruno Lévy, Sylvain Petitjean, Nicolas Ray, Jérome Maillot, "Least squares conformal
   maps for automatic texture atlas generation", 2002 (charts packed by their shape, large ones
   first).

   Called from texbake/mapping/atlas/packing/bins.py and from order_search.c. */

#include "packing.h"

#include "core.h"
#include "numbers.h"

/* Size classes of boxes along each side. */
enum { N_CLASSES = 64 };

enum { UNKNOWN = -1 }; /* longest run of a row */

void free_all(const struct free_cells *cells)
{
    for (int64_t row = 0; row < cells->n_rows; row++) {
        cells->longest[row] = (int32_t)cells->n_columns;
        for (int64_t column = 0; column < cells->n_columns; column++)
            cells->runs[row * cells->n_columns + column] = (int32_t)(cells->n_columns - column);
    }
}

struct free_cells take_cells(struct arena *arena, int64_t n_rows, int64_t n_columns)
{
    const struct free_cells cells = {
        n_rows, n_columns, TAKE(arena, int32_t, n_rows * n_columns), TAKE(arena, int32_t, n_rows)};
    free_all(&cells);
    return cells;
}

/* Size class of a length: eighths of octaves, or whole octaves if `hurry` is 2. */
static int64_t size_class(int64_t length, int64_t hurry)
{
    const int64_t parts = hurry < 2 ? 8 : 1;
    int64_t octave = 0, rest = length;
    while (rest >= 2 * parts) {
        rest /= 2;
        octave++;
    }
    return min_i64(parts * octave + rest, N_CLASSES - 1);
}

/* The longest span of a chart: the one that most rows have no room for. */
static int64_t longest_span(const struct turned_chart *chart)
{
    int64_t longest = 0;
    for (int64_t i = 1; i < chart->n_spans; i++)
        if (chart->spans[i].end - chart->spans[i].begin
            > chart->spans[longest].end - chart->spans[longest].begin)
            longest = i;
    return longest;
}

/* The longest free run of a row, which is measured only if charts were placed there since. */
static int64_t longest_run(const struct free_cells *cells, int64_t row)
{
    if (cells->longest[row] == UNKNOWN) {
        const int32_t *runs = cells->runs + row * cells->n_columns;
        int32_t longest = 0;
        for (int64_t column = 0; column < cells->n_columns;) {
            const int32_t run = runs[column];
            longest = run > longest ? run : longest;
            column += run > 0 ? run : -run;
        }
        cells->longest[row] = longest;
    }
    return cells->longest[row];
}

struct spot lowest_place(
    const struct free_cells *cells, const struct turned_chart *chart, struct spot first,
    int64_t below, int64_t *steps)
{
    const int64_t n_columns = cells->n_columns, n_spans = chart->n_spans;
    const int64_t stop = min_i64(cells->n_rows, below - 1) - chart->height + 1;
    int64_t probe = longest_span(chart); /* the span that failed last is the likeliest to fail again */
    const int64_t widest_row = chart->spans[probe].row;
    const int64_t widest = chart->spans[probe].end - chart->spans[probe].begin;
    for (int64_t y = first.y; y < stop; y++) {
        int64_t x = y == first.y ? first.x : 0, passed = 0;
        /* To look at the rest of a row takes less than to measure all of it. */
        if (x == 0 && longest_run(cells, y + widest_row) < widest)
            continue;
        const int32_t *runs = cells->runs + y * n_columns;
        while (passed < n_spans && x + chart->width <= n_columns) {
            ++*steps;
            const struct span span = chart->spans[probe];
            const int32_t *row = runs + span.row * n_columns;
            int64_t run = row[x + span.begin];
            if (run >= span.end - span.begin) {
                passed++;
                probe = probe + 1 < n_spans ? probe + 1 : 0;
                continue;
            }
            /* Jump over the obstacle to the next free cell of that row. */
            passed = 0;
            if (run > 0) {
                x += run;
                if (x + span.begin >= n_columns) {
                    x = n_columns;
                    break;
                }
                run = row[x + span.begin];
            }
            x -= run;
            if (x + span.begin >= n_columns)
                break;
        }
        if (passed == n_spans && x + chart->width <= n_columns)
            return (struct spot){x, y};
    }
    return (struct spot){-1, -1};
}

/* Block the cells of a row from `begin` to `end`; return the number of steps. */
static int64_t block_row(int32_t *row, int64_t begin, int64_t end, int64_t n_columns)
{
    if (row[begin] <= begin - end)
        return 0; /* all of it is blocked already */
    /* Continue to the end of any blocked run that follows. */
    const int64_t after = end < n_columns && row[end] < 0 ? end - row[end] : end;
    for (int64_t column = begin; column < end; column++)
        row[column] = (int32_t)(column - after);
    for (int64_t column = begin - 1; column >= 0 && row[column] > 0; column--)
        row[column] = (int32_t)(begin - column);
    return end - begin;
}

int64_t block_chart(
    const struct free_cells *cells, const struct turned_chart *chart, int64_t x, int64_t y,
    int64_t n_widths, const int32_t *half_widths)
{
    const int64_t reach = n_widths / 2;
    int64_t steps = 0;
    for (int64_t i = 0; i < chart->n_spans; i++) {
        const struct span span = chart->spans[i];
        for (int64_t step = -reach; step <= reach; step++) {
            const int64_t row = y + span.row + step;
            if (row < 0 || row >= cells->n_rows)
                continue;
            const int64_t aside = half_widths[step + reach];
            const int64_t begin = max_i64(x + span.begin - aside, 0);
            const int64_t end = min_i64(x + span.end + aside, cells->n_columns);
            steps += 1 + block_row(
                cells->runs + row * cells->n_columns, begin, end, cells->n_columns);
        }
    }
    const int64_t last = min_i64(y + chart->height + reach, cells->n_rows);
    for (int64_t row = max_i64(y - reach, 0); row < last; row++)
        cells->longest[row] = UNKNOWN;
    return steps;
}

/* The charts to place, the cells that they have left, and where to begin a search for a box of
   about a given size: where the last one was found, if `hurry` is set. */
struct placing {
    const struct chart_masks *masks;
    int64_t hurry;
    struct free_cells cells;
    struct spot (*firsts)[N_CLASSES];
    struct span *spans, *best_spans;
    uint8_t *across; /* the transposed mask */
};

/* Find the pose, quarter turn and place with the lowest top: its spans are `best_spans` then.
   Returns the chart as it lies there, without spans if there is no place. */
static struct turned_chart find_place(struct placing *placing, int64_t chart, int32_t place[4])
{
    const int64_t n_columns = placing->cells.n_columns, hurry = placing->hurry;
    const int64_t turns = hurry < 2 ? 4 : 2;
    int64_t least_top = placing->cells.n_rows + 1;
    struct turned_chart best = {0, 0, 0, NULL};
    struct mask across = {0, 0, NULL};
    int64_t across_pose = -1, steps = 0;
    for (int64_t item = 0; item < turns * placing->masks->n_poses; item++) {
        const struct mask mask = mask_of(placing->masks, chart, item / turns);
        const int64_t turn = item % turns;
        const int64_t width = turn % 2 == 0 ? mask.width : mask.height;
        const int64_t height = turn % 2 == 0 ? mask.height : mask.width;
        if (width > n_columns || height >= least_top)
            continue;
        if (turn % 2 == 1 && across_pose != item / turns) {
            across = transposed(mask, placing->across);
            across_pose = item / turns;
        }
        const int64_t n_spans = write_spans(mask, across, turn, placing->spans);
        struct spot *first = &placing->firsts[size_class(width, hurry)][size_class(height, hurry)];
        const struct turned_chart turned = {width, height, n_spans, placing->spans};
        const struct spot found =
            lowest_place(&placing->cells, &turned, *first, least_top, &steps);
        if (hurry > 0 && found.y >= 0)
            *first = found;
        else if (hurry > 0 && least_top - height > first->y)
            *first = (struct spot){0, least_top - height};
        if (found.y >= 0) {
            least_top = found.y + height;
            place[0] = (int32_t)found.x;
            place[1] = (int32_t)found.y;
            place[2] = (int32_t)(item / turns);
            place[3] = (int32_t)turn;
            best = turned;
            struct span *const kept = placing->spans;
            placing->spans = placing->best_spans;
            placing->best_spans = kept;
        }
    }
    return best;
}

/* Place the charts of `order`, each where its top ends lowest; return how many found no place. */
EXPORT int64_t place_charts(
    int64_t n_cells, int64_t n_charts, int64_t n_poses, int64_t n_order, int64_t n_widths,
    const uint8_t masks[n_cells], const int64_t starts[n_charts][n_poses],
    const int64_t boxes[n_charts][n_poses][2], const int32_t order[n_order], int64_t n_rows,
    int64_t n_columns, const int32_t half_widths[n_widths], bool all_or_nothing, int64_t hurry,
    int32_t places[n_charts][4], int32_t tops[n_charts])
{
    OPEN_ARENA(arena);
    const struct chart_masks all = {n_poses, masks, starts[0], boxes[0]};
    const int64_t most = largest_mask(&all, n_charts);
    struct placing placing = {
        &all, hurry, take_cells(arena, n_rows, n_columns),
        take_zeros(arena, N_CLASSES, sizeof *placing.firsts), TAKE(arena, struct span, most),
        TAKE(arena, struct span, most), TAKE(arena, uint8_t, most),
    };
    int64_t n_missing = 0;
    for (int64_t i = 0; i < n_order; i++) {
        const int64_t chart = order[i];
        const struct turned_chart placed = find_place(&placing, chart, places[chart]);
        if (placed.n_spans == 0) {
            n_missing++;
            if (all_or_nothing)
                break;
            continue;
        }
        tops[chart] = (int32_t)(places[chart][1] + placed.height);
        block_chart(
            &placing.cells, &placed, places[chart][0], places[chart][1], n_widths, half_widths);
    }
    close_arena(arena);
    return n_missing;
}
