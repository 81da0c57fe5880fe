/* Two neighboring charts stitched into one, in each way that they can be, and flattened.

   Neighbors meet along paths of edges. Vertices inside a path become inner vertices of the joined
   chart, so that any difference of their angle from a full turn becomes stretch. Where that is large,
   as at the corner of a cube, it is better to stitch the path only up to that vertex. The cost is
   found by flattening both charts together.

   Based on: P. Schönemann, "A generalized solution of the orthogonal Procrustes problem", 1966 (how
   one chart is turned to fit the other).

   Called from texbake/mapping/atlas/joining/stitch.py and pieces.py. */

#include <math.h>
#include <string.h>

#include "arena.h"
#include "core.h"
#include "elementary.h"
#include "flattening.h"
#include "numbers.h"
#include "union_find.h"

static const double PI = 3.14159265358979323846;

/* Largest difference between the angle around a vertex and a full turn for stitching across it. */
static const double MOST_DEFECT = 25.0 * 3.14159265358979323846 / 180.0;

/* Cost of a merge that makes nothing worse; the one that stitches most of a border is then first. */
static const double LEAST_COST = 1e-3;

/* Most that a seam costs here for its length, as no border runs where weights are infinite. */
static const double MOST_WEIGHT = 4.0;

/* The least gain that ends the flattening, as in flatten.py. */
static const double ACCURACY = 1e-3;

/* All half-edges of a contact, the longest path, and the longest stretch of one. */
enum { MOST_WAYS = 3 };

/* A chart as in `ChartPiece`. */
struct chart {
    int64_t n_faces, n_points, n_border;
    const int32_t *face_ids;
    const int32_t (*faces)[3];
    const double (*points)[3], (*uvs)[2], *angles;
    const int32_t *border, (*ends)[2];
    double area, l2, hull_area, length;
};

/* The half-edges along which two charts meet, in the order of paths. */
struct contact {
    int64_t n;
    int32_t *at[2];  /* positions in the borders of both charts */
    int32_t *paths;  /* the path that each belongs to */
    double *lengths; /* in space, times the weights of seams */
    double *turns;   /* angle that the vertex at the start would have inside the joined chart; NaN at
                        the start of a path */
};

/* What joining may cost, and the extent that the joined chart may have. */
struct tolerance {
    double excess, waste, longest;
};

/* Two charts flattened as one. */
struct merge {
    struct chart chart;
    double share, cost;
};

/* Edges by the vertex that they start at, the last one first. */
struct outgoing {
    int32_t *heads; /* by vertex */
    int32_t *next;
};

static struct outgoing no_edges(struct arena *arena, int64_t n_points, int64_t n_edges)
{
    struct outgoing edges = {TAKE(arena, int32_t, n_points), TAKE(arena, int32_t, n_edges)};
    for (int64_t i = 0; i < n_points; i++)
        edges.heads[i] = -1;
    return edges;
}

static void add_edge(struct outgoing *edges, int32_t start, int64_t edge)
{
    edges->next[edge] = edges->heads[start];
    edges->heads[start] = (int32_t)edge;
}

/* Sum by halves, in the order of NumPy. */
static double sum_of(int64_t n, const double *values)
{
    if (n > 128) {
        const int64_t half = n / 2 - n / 2 % 8;
        return sum_of(half, values) + sum_of(n - half, values + half);
    }
    double sums[8] = {0.0}, sum = 0.0;
    const int64_t n_even = n - n % 8;
    for (int64_t i = 0; i < n_even; i++)
        sums[i % 8] += values[i];
    if (n_even > 0)
        sum = ((sums[0] + sums[1]) + (sums[2] + sums[3]))
            + ((sums[4] + sums[5]) + (sums[6] + sums[7]));
    for (int64_t i = n_even; i < n; i++)
        sum += values[i];
    return sum;
}

/* Position of a half-edge in a border, -1 if it does not lie there. */
static int64_t find_in_border(const struct chart *chart, int32_t half_edge)
{
    int64_t low = 0, high = chart->n_border;
    while (low < high) {
        const int64_t middle = (low + high) / 2;
        if (chart->border[middle] < half_edge)
            low = middle + 1;
        else
            high = middle;
    }
    return low < chart->n_border && chart->border[low] == half_edge ? low : -1;
}

/* Find where two charts meet. */
static struct contact find_contact(
    struct arena *arena, const struct chart *one, const struct chart *other,
    const int32_t *opposite, const double *weights)
{
    struct contact contact = {.n = 0};
    int32_t *at_one = TAKE(arena, int32_t, one->n_border);
    int32_t *at_other = TAKE(arena, int32_t, one->n_border);
    for (int64_t i = 0; i < one->n_border; i++) {
        const int64_t slot = find_in_border(other, opposite[one->border[i]]);
        if (slot < 0)
            continue;
        at_one[contact.n] = (int32_t)i;
        at_other[contact.n++] = (int32_t)slot;
    }
    const int64_t n = contact.n;
    struct outgoing edges = no_edges(arena, one->n_points, n);
    int32_t *following = TAKE(arena, int32_t, n);
    bool *has_previous = TAKE_ZEROS(arena, bool, n), *is_seen = TAKE_ZEROS(arena, bool, n);
    for (int64_t i = 0; i < n; i++)
        add_edge(&edges, one->ends[at_one[i]][0], i);
    for (int64_t i = 0; i < n; i++) {
        const int32_t end = other->ends[at_other[i]][0];
        int32_t next = edges.heads[one->ends[at_one[i]][1]];
        while (next >= 0 && other->ends[at_other[next]][1] != end)
            next = edges.next[next];
        following[i] = next;
        if (next >= 0)
            has_previous[next] = true;
    }
    for (int k = 0; k < 2; k++)
        contact.at[k] = TAKE(arena, int32_t, n);
    contact.paths = TAKE(arena, int32_t, n);
    contact.lengths = TAKE(arena, double, n);
    contact.turns = TAKE(arena, double, n);
    int64_t count = 0;
    int32_t n_paths = 0;
    /* A closed path starts at its first half-edge. */
    for (int64_t k = 0; k < 2 * n; k++) {
        if (is_seen[k % n] || (k < n && has_previous[k]))
            continue;
        for (int64_t i = k % n; i >= 0 && !is_seen[i]; i = following[i]) {
            const int32_t *ends = one->ends[at_one[i]];
            const double *a = one->points[ends[0]], *b = one->points[ends[1]];
            const double x = b[0] - a[0], y = b[1] - a[1], z = b[2] - a[2];
            is_seen[i] = true;
            contact.at[0][count] = at_one[i];
            contact.at[1][count] = at_other[i];
            contact.paths[count] = n_paths;
            contact.lengths[count] =
                sqrt(x * x + y * y + z * z) * min_f64(weights[one->border[at_one[i]]], MOST_WEIGHT);
            contact.turns[count++] = has_previous[i]
                ? one->angles[ends[0]] + other->angles[other->ends[at_other[i]][1]] : NAN;
        }
        n_paths++;
    }
    return contact;
}

/* Find the longest run of half-edges, which ends where a path ends, or also at each vertex with an
   angle far from a full turn; return how many it has. */
static int64_t longest_run(const struct contact *contact, bool ends_at_corners, int64_t *first)
{
    double longest = -1.0;
    int64_t n_longest = 0;
    for (int64_t i = 0; i < contact->n;) {
        const int64_t start = i;
        double length = 0.0;
        do
            length += contact->lengths[i++];
        while (i < contact->n && contact->paths[i] == contact->paths[i - 1]
            && !(ends_at_corners && !(fabs(contact->turns[i] - 2.0 * PI) <= MOST_DEFECT)));
        if (length > longest) {
            longest = length;
            n_longest = i - start;
            *first = start;
        }
    }
    return n_longest;
}

/* Rotate and move the coordinates of `other` so that the edges of a contact fit those of `one` best,
   weighted by length. */
static void fit(
    struct arena *arena, const struct chart *one, const struct chart *other,
    const struct contact *way, double (*moved)[2])
{
    const int64_t n = 2 * way->n;
    double *weights = TAKE(arena, double, n);
    double (*products)[2] = take(arena, n, sizeof *products);
    double *sums = TAKE(arena, double, n);
    for (int64_t i = 0; i < n; i++)
        weights[i] = way->lengths[i / 2];
    const double total = sum_of(n, weights);
    double means[2][2] = {{0.0, 0.0}, {0.0, 0.0}}; /* of other, then of one */
    for (int64_t i = 0; i < n; i++) {
        weights[i] = total > 0.0 ? weights[i] / total : 1.0 / (double)n;
        const double *from = other->uvs[other->ends[way->at[1][i / 2]][1 - i % 2]];
        const double *to = one->uvs[one->ends[way->at[0][i / 2]][i % 2]];
        for (int axis = 0; axis < 2; axis++) {
            means[0][axis] += weights[i] * from[axis];
            means[1][axis] += weights[i] * to[axis];
        }
    }
    for (int64_t i = 0; i < n; i++) {
        const double *from = other->uvs[other->ends[way->at[1][i / 2]][1 - i % 2]];
        const double *to = one->uvs[one->ends[way->at[0][i / 2]][i % 2]];
        const double x = from[0] - means[0][0], y = from[1] - means[0][1];
        const double s = to[0] - means[1][0], t = to[1] - means[1][1];
        products[i][0] = weights[i] * (x * s + y * t);
        products[i][1] = weights[i] * (x * t - y * s);
    }
    double turn[2];
    for (int k = 0; k < 2; k++) {
        for (int64_t i = 0; i < n; i++)
            sums[i] = products[i][k];
        turn[k] = sum_of(n, sums);
    }
    const double size = portable_hypot(turn[0], turn[1]);
    const double c = size > 0.0 ? turn[0] / size : 1.0, s = size > 0.0 ? turn[1] / size : 0.0;
    for (int64_t i = 0; i < other->n_points; i++) {
        const double x = other->uvs[i][0] - means[0][0], y = other->uvs[i][1] - means[0][1];
        moved[i][0] = (x * c + y * -s) + means[1][0];
        moved[i][1] = (x * s + y * c) + means[1][1];
    }
}

/* Directions in which a layout is measured. */
enum { N_DIRECTIONS = 32 };

/* How far points extend in each direction, from the first of them. */
static void measure_extents(int64_t n, const double (*uvs)[2], double extents[N_DIRECTIONS])
{
    double cosines[N_DIRECTIONS], sines[N_DIRECTIONS];
    for (int i = 0; i < N_DIRECTIONS; i++) {
        cosines[i] = portable_cos(2.0 * PI * i / N_DIRECTIONS);
        sines[i] = portable_sin(2.0 * PI * i / N_DIRECTIONS);
        extents[i] = 0.0;
    }
    for (int64_t at = 1; at < n; at++) {
        const double x = uvs[at][0] - uvs[0][0], y = uvs[at][1] - uvs[0][1];
        for (int i = 0; i < N_DIRECTIONS; i++)
            extents[i] = max_f64(extents[i], x * cosines[i] + y * sines[i]);
    }
}

/* Area of the convex hull, as `hull_area` of pieces.py; `length` gets the greatest extent of the layout
   in any direction. */
static double measure_hull(int64_t n, const double (*uvs)[2], double *length)
{
    double extents[N_DIRECTIONS], products[N_DIRECTIONS];
    measure_extents(n, uvs, extents);
    const double c = portable_cos(2.0 * PI / N_DIRECTIONS);
    *length = 0.0;
    for (int i = 0; i < N_DIRECTIONS; i++) {
        const double before = extents[(i + N_DIRECTIONS - 1) % N_DIRECTIONS];
        const double after = extents[(i + 1) % N_DIRECTIONS];
        products[i] = extents[i] * (before + after - 2.0 * extents[i] * c);
        *length = max_f64(*length, extents[i] + extents[(i + N_DIRECTIONS / 2) % N_DIRECTIONS]);
    }
    return sum_of(N_DIRECTIONS, products) / (2.0 * portable_sin(2.0 * PI / N_DIRECTIONS));
}

/* Write the area of the convex hull of points, and their greatest extent. */
EXPORT void measure_hull_of(int64_t n, const double uvs[n][2], double figures[2])
{
    figures[0] = measure_hull(n, uvs, &figures[1]);
}

/* Write the border of the stitched chart: those of both without the stitched half-edges. A hole of
   two edges between the same two vertices closes. */
static void join_borders(
    struct arena *arena, const struct chart *one, const struct chart *other,
    const struct contact *way, const int32_t *labels, struct chart *made)
{
    const struct chart *charts[2] = {one, other};
    const int64_t n_most = one->n_border + other->n_border;
    int32_t *border = TAKE(arena, int32_t, n_most), (*ends)[2] = take(arena, n_most, sizeof *ends);
    struct outgoing edges = no_edges(arena, made->n_points, n_most);
    bool *is_stitched[2];
    for (int k = 0; k < 2; k++) {
        is_stitched[k] = TAKE_ZEROS(arena, bool, charts[k]->n_border);
        for (int64_t i = 0; i < way->n; i++)
            is_stitched[k][way->at[k][i]] = true;
    }
    int64_t n = 0, at[2] = {0, 0};
    while (at[0] < one->n_border || at[1] < other->n_border) {
        const int k = at[0] == one->n_border
            || (at[1] < other->n_border && other->border[at[1]] < one->border[at[0]]);
        const int64_t i = at[k]++;
        if (is_stitched[k][i])
            continue;
        border[n] = charts[k]->border[i];
        for (int end = 0; end < 2; end++)
            ends[n][end] = labels[charts[k]->ends[i][end] + k * one->n_points];
        add_edge(&edges, ends[n][0], n);
        n++;
    }
    made->n_border = 0;
    made->border = border;
    made->ends = (const int32_t (*)[2])ends;
    bool *is_open = TAKE(arena, bool, n);
    for (int64_t i = 0; i < n; i++) {
        int32_t back = edges.heads[ends[i][1]];
        while (back >= 0 && ends[back][1] != ends[i][0])
            back = edges.next[back];
        is_open[i] = back < 0;
    }
    for (int64_t i = 0; i < n; i++) {
        if (!is_open[i])
            continue;
        border[made->n_border] = border[i];
        memmove(ends[made->n_border++], ends[i], sizeof *ends);
    }
}

/* Number the vertices of both charts together, as far as they are stitched; return how many. */
static int64_t number_vertices(
    const struct chart *one, const struct chart *other, const struct contact *way, int32_t *labels)
{
    const int32_t n_one = (int32_t)one->n_points;
    for (int32_t i = 0; i < n_one + other->n_points; i++)
        labels[i] = i;
    for (int64_t i = 0; i < way->n; i++)
        for (int end = 0; end < 2; end++)
            join_labels(labels, one->ends[way->at[0][i]][end],
                n_one + other->ends[way->at[1][i]][1 - end]);
    return number_labels(labels, n_one + other->n_points);
}

/* Write the faces of both charts, in the order of the mesh. */
static void join_faces(
    struct arena *arena, const struct chart *one, const struct chart *other,
    const int32_t *labels, struct chart *made)
{
    const struct chart *charts[2] = {one, other};
    made->n_faces = one->n_faces + other->n_faces;
    int32_t *face_ids = TAKE(arena, int32_t, made->n_faces);
    int32_t (*faces)[3] = take(arena, made->n_faces, sizeof *faces);
    int64_t at[2] = {0, 0};
    for (int64_t face = 0; face < made->n_faces; face++) {
        const int k = at[0] == one->n_faces
            || (at[1] < other->n_faces && other->face_ids[at[1]] < one->face_ids[at[0]]);
        face_ids[face] = charts[k]->face_ids[at[k]];
        for (int corner = 0; corner < 3; corner++)
            faces[face][corner] = labels[charts[k]->faces[at[k]][corner] + k * one->n_points];
        at[k]++;
    }
    made->face_ids = face_ids;
    made->faces = (const int32_t (*)[3])faces;
}

/* Stitch two charts: the other one is rotated and moved to fit, and stitched vertices are halfway.
   The result may have flips, and its hull is approximate. */
static struct chart stitch(
    struct arena *arena, const struct chart *one, const struct chart *other,
    const struct contact *way)
{
    const int64_t n_one = one->n_points, n_all = n_one + other->n_points;
    int32_t *labels = TAKE(arena, int32_t, n_all);
    struct chart made = {.n_points = number_vertices(one, other, way, labels),
        .area = one->area + other->area};
    join_faces(arena, one, other, labels, &made);
    join_borders(arena, one, other, way, labels, &made);
    double (*laid)[2] = take(arena, n_all, sizeof *laid);
    memcpy(laid, one->uvs, (size_t)n_one * sizeof *laid);
    fit(arena, one, other, way, laid + n_one);
    made.hull_area = measure_hull(n_all, (const double (*)[2])laid, &made.length);
    double (*points)[3] = take(arena, made.n_points, sizeof *points);
    double (*uvs)[2] = take_zeros(arena, made.n_points, sizeof *uvs);
    double *angles = TAKE_ZEROS(arena, double, made.n_points);
    int32_t *counts = TAKE_ZEROS(arena, int32_t, made.n_points);
    for (int64_t i = 0; i < n_all; i++) {
        const int32_t vertex = labels[i];
        memcpy(points[vertex], i < n_one ? one->points[i] : other->points[i - n_one],
            sizeof *points);
        uvs[vertex][0] += laid[i][0];
        uvs[vertex][1] += laid[i][1];
        angles[vertex] += i < n_one ? one->angles[i] : other->angles[i - n_one];
        counts[vertex]++;
    }
    for (int64_t i = 0; i < made.n_points; i++)
        for (int axis = 0; axis < 2; axis++)
            uvs[i][axis] /= counts[i];
    made.points = (const double (*)[3])points;
    made.uvs = (const double (*)[2])uvs;
    made.angles = angles;
    measure_hull(made.n_points, made.uvs, &made.length);
    return made;
}

/* Whether a chart can be flattened: a disk, possibly with holes. */
static bool is_disk(struct arena *arena, const struct chart *chart)
{
    int32_t *loops = TAKE(arena, int32_t, chart->n_points);
    for (int32_t i = 0; i < chart->n_points; i++)
        loops[i] = i;
    for (int64_t i = 0; i < chart->n_border; i++)
        join_labels(loops, chart->ends[i][0], chart->ends[i][1]);
    int64_t n_loops = 0;
    bool *is_seen = TAKE_ZEROS(arena, bool, chart->n_points);
    for (int64_t i = 0; i < chart->n_border; i++) {
        const int32_t loop = find_label(loops, chart->ends[i][0]);
        n_loops += !is_seen[loop];
        is_seen[loop] = true;
    }
    const int64_t n_edges = (3 * chart->n_faces + chart->n_border) / 2;
    return n_loops > 0 && chart->n_points - n_edges + chart->n_faces + n_loops == 2;
}

/* Flatten a chart with less distortion, from its layout if that has no flips; false if no layout
   without flips and overlaps is found. */
static bool relax(struct arena *arena, struct chart *chart, int64_t n_iterations)
{
    struct patch patch;
    if (!make_patch(arena, chart->n_points, chart->n_faces, chart->faces, &patch))
        return false;
    const size_t n_bytes = (size_t)chart->n_points * sizeof *chart->uvs;
    double (*uvs)[2] = take(arena, chart->n_points, sizeof *uvs);
    for (int keep_apart = 0; keep_apart < 2; keep_apart++) {
        const struct limits limits = {n_iterations, ACCURACY, keep_apart, NULL};
        struct flat flat;
        memcpy(uvs, chart->uvs, n_bytes);
        if (!flatten(arena, &patch, chart->points, true, limits, uvs, &flat))
            return false;
        if (flat.is_injective) {
            chart->uvs = (const double (*)[2])uvs;
            chart->l2 = flat.l2;
            chart->hull_area = measure_hull(chart->n_points, chart->uvs, &chart->length);
            return true;
        }
    }
    return false;
}

/* Flatten a chart with less distortion, from the layout `start` if that has no flips; `figures` gets its
   stretch, its hull area and its length. False if no layout without flips and overlaps is found. */
EXPORT int64_t relax_chart(
    int64_t n_points, int64_t n_faces, const double points[n_points][3],
    const int32_t faces[n_faces][3], const double start[n_points][2], int64_t n_iterations,
    double uvs[n_points][2], double figures[3])
{
    OPEN_ARENA(arena);
    struct chart chart = {
        .n_faces = n_faces, .n_points = n_points, .faces = faces, .points = points, .uvs = start};
    const bool is_relaxed = relax(arena, &chart, n_iterations);
    if (is_relaxed) {
        memcpy(uvs, chart.uvs, (size_t)n_points * sizeof *uvs);
        figures[0] = chart.l2;
        figures[1] = chart.hull_area;
        figures[2] = chart.length;
    }
    close_arena(arena);
    return is_relaxed;
}

static double waste_of(const struct chart *chart)
{
    return chart->hull_area - chart->area;
}

/* Area times (L2² - 1), which can be summed over the charts of a mesh. */
static double excess_of(const struct chart *chart)
{
    return chart->area * (chart->l2 * chart->l2 - 1.0);
}

/* Flatten two charts as one, stitched in one way; false if that is impossible. */
static bool merge_in_way(
    struct arena *arena, const struct chart *one, const struct chart *other,
    const struct contact *way, struct tolerance tolerance, double shorter, int64_t n_iterations,
    struct merge *merge)
{
    const double length = sum_of(way->n, way->lengths);
    if (length == 0.0)
        return false;
    struct chart *chart = &merge->chart;
    *chart = stitch(arena, one, other, way);
    merge->share = length / shorter;
    const double waste = waste_of(one), wasted = waste_of(other);
    if (!is_disk(arena, chart) || waste_of(chart) - waste - wasted > tolerance.waste
        || chart->length > tolerance.longest || !relax(arena, chart, n_iterations))
        return false;
    const double more_excess = excess_of(chart) - excess_of(one) - excess_of(other);
    const double more_waste = waste_of(chart) - waste - wasted;
    merge->cost = LEAST_COST;
    if (tolerance.excess > 0.0)
        merge->cost += max_f64(more_excess, 0.0) / tolerance.excess;
    if (tolerance.waste > 0.0)
        merge->cost += max_f64(more_waste, 0.0) / tolerance.waste;
    merge->cost /= merge->share;
    return true;
}

/* Flatten two charts as one, in each way that they can be stitched, and write the cheapest; return
   whether there is one. `measures` are the area, L2 stretch, hull area and length of the border of
   both; `tolerance` is how much stretch and empty area may be added to all charts, and how long a
   chart may be; `weights` are those of seams along half-edges. `counts` gets how many vertices and half-edges of the border it has; `figures` its
   stretch, its hull area, its length, and the stitched share of the shorter border. */
EXPORT int64_t stitch_charts(
    int64_t n_faces, int64_t n_points, int64_t n_border,
    const int32_t face_ids[n_faces], const int32_t faces[n_faces][3],
    const double points[n_points][3], const double uvs[n_points][2], const double angles[n_points],
    const int32_t border[n_border], const int32_t ends[n_border][2],
    int64_t n_faces_2, int64_t n_points_2, int64_t n_border_2,
    const int32_t face_ids_2[n_faces_2], const int32_t faces_2[n_faces_2][3],
    const double points_2[n_points_2][3], const double uvs_2[n_points_2][2],
    const double angles_2[n_points_2], const int32_t border_2[n_border_2],
    const int32_t ends_2[n_border_2][2], int64_t n_half_edges, const int32_t opposite[n_half_edges],
    const double weights[n_half_edges],
    const double measures[2][4], const double tolerance[3], int64_t n_iterations,
    int32_t joined_ids[n_faces + n_faces_2], int32_t joined_faces[n_faces + n_faces_2][3],
    double joined_points[n_points + n_points_2][3], double joined_uvs[n_points + n_points_2][2],
    double joined_angles[n_points + n_points_2], int32_t joined_border[n_border + n_border_2],
    int32_t joined_ends[n_border + n_border_2][2], int64_t counts[2], double figures[4])
{
    OPEN_ARENA(arena);
    const struct chart one = {n_faces, n_points, n_border, face_ids, faces, points, uvs, angles,
        border, ends, measures[0][0], measures[0][1], measures[0][2], 0.0};
    const struct chart other = {n_faces_2, n_points_2, n_border_2, face_ids_2, faces_2, points_2,
        uvs_2, angles_2, border_2, ends_2, measures[1][0], measures[1][1], measures[1][2], 0.0};
    const struct tolerance allowed = {tolerance[0], tolerance[1], tolerance[2]};
    const double shorter = min_f64(measures[0][3], measures[1][3]);
    const struct contact contact = find_contact(arena, &one, &other, opposite, weights);
    struct merge best = {.cost = INFINITY};
    int64_t n_last = contact.n + 1;
    for (int choice = 0; choice < MOST_WAYS && contact.n > 0; choice++) {
        int64_t first = 0;
        const int64_t n = choice == 0 ? contact.n : longest_run(&contact, choice == 2, &first);
        if (n >= n_last)
            continue;
        n_last = n;
        const struct contact way = {n, {contact.at[0] + first, contact.at[1] + first},
            contact.paths + first, contact.lengths + first, contact.turns + first};
        struct merge merge;
        if (merge_in_way(arena, &one, &other, &way, allowed, shorter, n_iterations, &merge)
            && merge.cost < best.cost)
            best = merge;
    }
    const struct chart *chart = &best.chart;
    const bool is_found = best.cost < INFINITY;
    if (is_found) {
        memcpy(joined_ids, chart->face_ids, (size_t)chart->n_faces * sizeof *joined_ids);
        memcpy(joined_faces, chart->faces, (size_t)chart->n_faces * sizeof *joined_faces);
        memcpy(joined_points, chart->points, (size_t)chart->n_points * sizeof *joined_points);
        memcpy(joined_uvs, chart->uvs, (size_t)chart->n_points * sizeof *joined_uvs);
        memcpy(joined_angles, chart->angles, (size_t)chart->n_points * sizeof *joined_angles);
        memcpy(joined_border, chart->border, (size_t)chart->n_border * sizeof *joined_border);
        memcpy(joined_ends, chart->ends, (size_t)chart->n_border * sizeof *joined_ends);
        counts[0] = chart->n_points;
        counts[1] = chart->n_border;
        figures[0] = chart->l2;
        figures[1] = chart->hull_area;
        figures[2] = chart->length;
        figures[3] = best.share;
    }
    close_arena(arena);
    return is_found;
}
