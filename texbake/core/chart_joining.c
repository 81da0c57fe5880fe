/* Charts that join neighbors where that adds almost no stretch.

   Small charts come first. Two charts are flattened as one, beginning with the layouts of both, the
   one turned and moved to fit the other along their common border. The joined chart must be about as
   compact as the two, since spread-out shapes pack badly.

   Based on: Sander, Snyder, Gortler, Hoppe, "Texture Mapping Progressive Meshes", 2001 (charts made
   by merging). Schönemann, "A Generalized Solution of the Orthogonal Procrustes Problem", 1966.

   Called from chart_cutting.c. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "chart_cutting.h"
#include "core.h"
#include "flattening.h"
#include "numbers.h"

/* A chart joins a neighbor with which it shares so much of its border, one of the few that it shares
   most with. Joining ends once as many faces have been flattened for it as the part has, times
   `MOST_WORK`; each attempt costs as much as `LEAST_FACES` at least. */
static const double LEAST_SHARED = 0.2;
enum { MOST_TRIES = 3, MOST_WORK = 4, LEAST_FACES = 8 };

/* A chart that is tiny compared with its neighbor needs only a few steps from the layouts of both,
   at a fraction of the cost. */
enum { TOUCH_UP = 3, CHEAPER = 8 };

/* A chart of more faces, and of a greater share of those of the part, stays as it is. */
enum { SMALL_CHART = 100, SMALL_SHARE = 8 };

/* A joined chart may stretch by this share of what a chart may. */
static const double STRETCH_SHARE = 0.2;

/* It is no longer than the longer of the two, or than this share of what a chart may be. */
static const double LENGTH_SHARE = 0.65;

/* It may leave as much of its convex hull empty as the two did, or this share of its area. */
static const double MOST_WASTE = 0.25;

/* It has at most this share of the largest area, unless one of the two is tiny: then it may also
   stretch as much as any chart. */
static const double AREA_SHARE = 0.4;

/* Largest stretch of a joined chart that is tiny. */
static const double MOST_INVISIBLE = 1.25;

/* Largest stretch of a face of a joined chart, unless one of the two has more. */
static const double MOST_OF_FACE = 5.0;

/* Charts while they join: the chart of each face, and the borders that one shares with others. */
struct joining {
    int32_t *chart_of; /* -1: none */
    int32_t *within;   /* place of each face in its chart */
    double *shared;    /* lengths of common borders, by chart; 0 but while they are measured */
    int64_t work;
};

/* A neighbor, and the length of the common border. */
struct neighbor {
    double shared;
    int32_t chart;
};

/* Find the neighbors that a chart shares most of its border with, the best first. */
static int find_neighbors_of(
    const struct cutting *cutting, struct joining *joining, int32_t chart,
    struct neighbor best[MOST_TRIES])
{
    const struct part *part = cutting->charts[chart];
    double border = 0.0;
    int n_best = 0;
    /* Measured first, then taken: each neighbor is met again, and leaves 0 behind. */
    for (int pass = 0; pass < 2; pass++) {
        for (int64_t i = 0; i < 3 * part->n_faces; i++) {
            const int32_t face = part->face_ids[i / 3], opposite = cutting->opposite[3 * face + i % 3];
            const int32_t other = opposite < 0 ? -1 : joining->chart_of[opposite / 3];
            if (other == chart)
                continue;
            if (pass == 0) {
                const double length = side_length(cutting, face, i % 3);
                border += length;
                if (other >= 0)
                    joining->shared[other] += length;
            } else if (other >= 0 && joining->shared[other] > 0.0) {
                struct neighbor found = {joining->shared[other], other};
                joining->shared[other] = 0.0;
                if (found.shared < LEAST_SHARED * border)
                    continue;
                for (int at = 0; at < MOST_TRIES; at++) {
                    const bool is_better = at == n_best || found.shared > best[at].shared;
                    if (is_better) {
                        const struct neighbor kept = best[at];
                        best[at] = found;
                        if (at == n_best) {
                            n_best++;
                            break;
                        }
                        found = kept;
                    }
                }
            }
        }
    }
    return n_best;
}

/* Turn and move the layout of `other` so that it fits that of `one` best along their common edges,
   as far as `joined` connects them, and make both the layout of `joined`: its vertices lie at the
   mean of theirs. */
static void fit_layouts(
    const struct cutting *cutting, const struct joining *joining, struct part *joined,
    const struct part *one, const struct part *other)
{
    struct arena *arena = cutting->arena;
    const arena_mark mark = mark_arena(arena);
    double (*own)[3][2] = take(arena, joined->n_faces, sizeof *own); /* of each corner */
    bool *is_other = TAKE_ZEROS(arena, bool, joined->n_faces);
    const struct part *parts[2] = {one, other};
    for (int k = 0; k < 2; k++) {
        for (int64_t face = 0; face < parts[k]->n_faces; face++) {
            const int32_t at = joining->within[parts[k]->face_ids[face]];
            is_other[at] = k == 1;
            for (int corner = 0; corner < 3; corner++)
                memcpy(own[at][corner], parts[k]->uvs[parts[k]->faces[face][corner]],
                    sizeof own[at][corner]);
        }
    }
    double from[2] = {0.0, 0.0}, to[2] = {0.0, 0.0}, turn[2] = {0.0, 0.0}, total = 0.0;
    for (int pass = 0; pass < 2; pass++) {
        for (int32_t i = 0; i < 3 * joined->n_faces; i++) {
            const int32_t across = joined->opposite[i];
            if (across < 0 || is_other[i / 3] || !is_other[across / 3])
                continue;
            const double weight = side_length(cutting, joined->face_ids[i / 3], i % 3);
            const int32_t ends[2] = {i, next_corner(i)}, starts[2] = {next_corner(across), across};
            for (int k = 0; k < 2; k++) {
                const double *a = own[starts[k] / 3][starts[k] % 3];
                const double *b = own[ends[k] / 3][ends[k] % 3];
                if (pass == 0) {
                    for (int axis = 0; axis < 2; axis++) {
                        from[axis] += weight * a[axis];
                        to[axis] += weight * b[axis];
                    }
                    total += weight;
                } else {
                    const double x = a[0] - from[0], y = a[1] - from[1];
                    const double u = b[0] - to[0], v = b[1] - to[1];
                    turn[0] += weight * (x * u + y * v);
                    turn[1] += weight * (x * v - y * u);
                }
            }
        }
        for (int axis = 0; axis < 2 && pass == 0 && total > 0.0; axis++) {
            from[axis] /= total;
            to[axis] /= total;
        }
    }
    const double size = sqrt(turn[0] * turn[0] + turn[1] * turn[1]);
    const double c = size > 0.0 ? turn[0] / size : 1.0, s = size > 0.0 ? turn[1] / size : 0.0;
    int32_t *counts = TAKE_ZEROS(arena, int32_t, joined->n_vertices);
    memset(joined->uvs, 0, (size_t)joined->n_vertices * sizeof *joined->uvs);
    for (int64_t face = 0; face < joined->n_faces; face++) {
        for (int corner = 0; corner < 3; corner++) {
            const int32_t vertex = joined->faces[face][corner];
            double u = own[face][corner][0], v = own[face][corner][1];
            if (is_other[face]) {
                const double x = u - from[0], y = v - from[1];
                u = to[0] + c * x - s * y;
                v = to[1] + s * x + c * y;
            }
            joined->uvs[vertex][0] += u;
            joined->uvs[vertex][1] += v;
            counts[vertex]++;
        }
    }
    for (int64_t vertex = 0; vertex < joined->n_vertices; vertex++)
        for (int axis = 0; axis < 2; axis++)
            joined->uvs[vertex][axis] /= max_i64(counts[vertex], 1);
    reset_arena(arena, mark);
}

static bool is_tiny(const struct cutting *cutting, const struct part *one, const struct part *other)
{
    return min_f64(one->area, other->area) <= cutting->limits.tiny_area;
}

/* Flatten two charts as one. */
static struct part *join_parts(
    const struct cutting *cutting, struct joining *joining, const struct part *one,
    const struct part *other)
{
    struct arena *arena = cutting->arena;
    struct part *joined = take_zeros(arena, 1, sizeof *joined);
    joined->n_faces = one->n_faces + other->n_faces;
    joined->face_ids = TAKE(arena, int32_t, joined->n_faces);
    joined->opposite = TAKE(arena, int32_t, 3 * joined->n_faces);
    int64_t i = 0, j = 0;
    for (int64_t at = 0; at < joined->n_faces; at++) {
        const bool is_first = j == other->n_faces
            || (i < one->n_faces && one->face_ids[i] < other->face_ids[j]);
        joined->face_ids[at] = is_first ? one->face_ids[i++] : other->face_ids[j++];
        joining->within[joined->face_ids[at]] = (int32_t)at;
    }
    for (int64_t at = 0; at < joined->n_faces; at++) {
        for (int side = 0; side < 3; side++) {
            const int32_t across = cutting->opposite[3 * joined->face_ids[at] + side];
            const int32_t face = across / 3;
            const int32_t place = across < 0 ? -1 : joining->within[face];
            const bool is_inside =
                place >= 0 && place < joined->n_faces && joined->face_ids[place] == face;
            joined->opposite[3 * at + side] = is_inside ? 3 * place + across % 3 : -1;
        }
    }
    const double (*places)[3] = (const double (*)[3])place_vertices(cutting, joined);
    joined->uvs = take_zeros(arena, joined->n_vertices, sizeof *joined->uvs);
    fit_layouts(cutting, joining, joined, one, other);
    lay_out_from(
        cutting, joined, places, true, is_tiny(cutting, one, other) ? TOUCH_UP : FULL_EFFORT);
    return joined;
}

static double waste_of(const struct part *part)
{
    return part->hull_area - part->area;
}

/* The stretch above 1 of a part, times its area. */
static double excess_of(const struct part *part)
{
    return part->area * (part->l2 * part->l2 - 1.0);
}

/* The largest stretch of a face of a part that is laid out. */
static double greatest_of_part(const struct cutting *cutting, const struct part *part)
{
    double most = 1.0;
    for (int64_t face = 0; face < part->n_faces; face++)
        most = max_f64(most, stretch_of_face(cutting->points, cutting->corners[part->face_ids[face]],
            (const double (*)[2])part->uvs, part->faces[face]));
    return most;
}

/* Whether a face of a joined chart stretches too much, and more than any face of the two. */
static bool is_crushed(
    const struct cutting *cutting, const struct part *joined, const struct part *one,
    const struct part *other)
{
    const double most = greatest_of_part(cutting, joined);
    return most > MOST_OF_FACE && most > greatest_of_part(cutting, one)
        && most > greatest_of_part(cutting, other);
}

/* Whether two charts may be tried as one. */
static bool may_join(const struct cutting *cutting, const struct part *one, const struct part *other)
{
    return one->area + other->area <= AREA_SHARE * cutting->limits.most_area
        || is_tiny(cutting, one, other);
}

/* Whether a joined chart is good enough. */
static bool is_good(
    const struct cutting *cutting, const struct part *joined, const struct part *one,
    const struct part *other)
{
    const struct chart_limits *limits = &cutting->limits;
    if (!joined->is_laid || !joined->is_injective)
        return false;
    const double longer = max_f64(one->length, other->length);
    if (joined->length > max_f64(LENGTH_SHARE * limits->most_length, longer))
        return false;
    const double waste = max_f64(waste_of(one) + waste_of(other), MOST_WASTE * joined->area);
    if (waste_of(joined) > waste)
        return false;
    const bool is_invisible = joined->area <= limits->tiny_area;
    const double most_l2 = is_invisible ? max_f64(MOST_INVISIBLE, limits->most_l2) : limits->most_l2;
    if (joined->l2 > max_f64(most_l2, max_f64(one->l2, other->l2)))
        return false;
    const double most = is_tiny(cutting, one, other)
        ? most_l2 : 1.0 + STRETCH_SHARE * (limits->most_l2 - 1.0);
    return excess_of(joined)
            <= excess_of(one) + excess_of(other) + joined->area * (most * most - 1.0)
        && !is_crushed(cutting, joined, one, other);
}

/* Let a chart join a neighbor; return whether there is one. */
static bool join_neighbor(struct cutting *cutting, struct joining *joining, int32_t chart)
{
    struct neighbor best[MOST_TRIES] = {{0.0, 0}};
    const int n_best = find_neighbors_of(cutting, joining, chart, best);
    for (int at = 0; at < n_best; at++) {
        const struct part *one = cutting->charts[chart], *other = cutting->charts[best[at].chart];
        if (!may_join(cutting, one, other))
            continue;
        const arena_mark mark = mark_arena(cutting->arena);
        struct part *joined = join_parts(cutting, joining, one, other);
        joining->work += LEAST_FACES
            + (is_tiny(cutting, one, other) ? joined->n_faces / CHEAPER : joined->n_faces);
        if (is_good(cutting, joined, one, other)) {
            for (int64_t i = 0; i < joined->n_faces; i++)
                joining->chart_of[joined->face_ids[i]] = (int32_t)cutting->n_charts;
            cutting->charts[chart] = cutting->charts[best[at].chart] = NULL;
            cutting->charts[cutting->n_charts++] = joined;
            return true;
        }
        reset_arena(cutting->arena, mark);
    }
    return false;
}

/* Charts by their number of faces, then by their number. */
static int compare_charts(const void *one, const void *other)
{
    const int64_t *a = one, *b = other;
    if (a[0] != b[0])
        return a[0] < b[0] ? -1 : 1;
    return (a[1] > b[1]) - (a[1] < b[1]);
}

/* Let charts join neighbors, small ones first, in rounds. */
void join_charts(struct cutting *cutting)
{
    struct arena *arena = cutting->arena;
    const int64_t n_faces = cutting->n_faces;
    struct joining joining = {
        TAKE(arena, int32_t, n_faces), TAKE_ZEROS(arena, int32_t, n_faces),
        TAKE_ZEROS(arena, double, 2 * n_faces), 0};
    int64_t (*order)[2] = take(arena, 2 * n_faces, sizeof *order);
    for (int64_t face = 0; face < n_faces; face++)
        joining.chart_of[face] = -1;
    for (int32_t chart = 0; chart < cutting->n_charts; chart++)
        for (int64_t i = 0; i < cutting->charts[chart]->n_faces; i++)
            joining.chart_of[cutting->charts[chart]->face_ids[i]] = chart;
    bool is_joined = cutting->n_charts > 1;
    while (is_joined) {
        int64_t n = 0;
        for (int64_t chart = 0; chart < cutting->n_charts; chart++) {
            const struct part *part = cutting->charts[chart];
            if (part && part->n_faces <= max_i64(SMALL_CHART, n_faces / SMALL_SHARE)) {
                order[n][0] = part->n_faces;
                order[n++][1] = chart;
            }
        }
        qsort(order, (size_t)n, sizeof *order, compare_charts);
        is_joined = false;
        for (int64_t i = 0; i < n && joining.work < MOST_WORK * n_faces + LEAST_FACES; i++)
            if (cutting->charts[order[i][1]])
                is_joined |= join_neighbor(cutting, &joining, (int32_t)order[i][1]);
    }
}

