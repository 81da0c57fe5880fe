/* A connected part of a mesh flattened as one chart, or halved until its parts can be.

   Most parts of a mesh are disks of little curvature, however rough they are. They need no cuts
   inside: the layout of least symmetric Dirichlet energy is found at once. A part that is no disk, or
   curves too much, is halved, again and again, as long as that lowers the stretch; cuts do not remove
   the stretch of noise. A single face is always flat. Then small charts join neighbors wherever that
   keeps the stretch in bounds, since halving cuts some surfaces that need no cut.

   Called from texbake/mapping/atlas/cutting/disks.py. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "arena.h"
#include "core.h"
#include "dial_flood.h"
#include "face_parts.h"
#include "flatten.h"
#include "numbers.h"
#include "planar_overlap.h"
#include "union_find.h"

/* Dividing helps if it leaves less than `HELP` of the stretch above 1: on a smooth surface about a
   quarter is left, on noise nearly all. Where it does not help, a stretch of `MOST_NOISE` is
   accepted. */
static const double HELP = 0.9;
static const double MOST_NOISE = 1.25;

/* A layout of which a greater share overlaps itself is useless; less is cut off afterwards. */
static const double MOST_OVERLAP = 0.01;

/* Halves are of similar size: the larger one of a division that counts has at most this share. So
   no part is divided more often than this. */
static const double LARGEST_HALF = 0.9;
enum { MOST_LEVELS = 400 };

/* The least gain that ends the flattening, as in flatten.py. */
static const struct limits LIMITS = {50, 1e-3, false};

/* A chart joins a neighbor with which it shares so much of its border, one of the few that it shares
   most with. Joining ends once as many faces have been flattened for it as the mesh has, times
   `MOST_WORK`; each attempt costs as much as `LEAST_FACES` at least. */
static const double LEAST_SHARED = 0.2;
enum { MOST_TRIES = 3, MOST_WORK = 4, LEAST_FACES = 16 };

/* A chart of more faces, and of a greater share of those of the part, stays as it is. */
enum { SMALL_CHART = 100, SMALL_SHARE = 8 };

/* Some faces of the root part, ascending, and how they are connected and laid out. */
struct part {
    int64_t n_faces;
    int32_t *face_ids;
    int32_t *opposite;     /* of each half-edge, numbered within the part; -1: none */
    int32_t (*faces)[3];   /* vertices: one for each fan of faces */
    int64_t n_vertices;
    double (*uvs)[2];
    double area, l2;
    bool is_laid, is_injective;
    struct part *halves;   /* once they are made */
    int64_t n_halves;
};

/* The root part, and the charts found in it so far. */
struct cutting {
    struct arena *arena;
    const double (*points)[3];
    const int32_t (*corners)[3];
    const double (*lengths)[3];
    double most_l2, depth;
    int64_t n_faces;
    const int32_t *opposite;
    struct part **charts; /* room for two a face; NULL: joined with another */
    int64_t n_charts;
};

static inline int32_t next_corner(int32_t corner)
{
    return corner % 3 == 2 ? corner - 2 : corner + 1;
}

/* Number the vertices of a part: corners are one vertex if the faces between them are connected.
   Writes the places of the vertices. */
static double (*place_vertices(const struct cutting *cutting, struct part *part))[3]
{
    struct arena *arena = cutting->arena;
    const int32_t n_corners = (int32_t)(3 * part->n_faces);
    part->faces = take(arena, part->n_faces, sizeof *part->faces);
    int32_t *labels = *part->faces;
    for (int32_t corner = 0; corner < n_corners; corner++)
        labels[corner] = corner;
    for (int32_t corner = 0; corner < n_corners; corner++)
        if (part->opposite[corner] >= 0)
            join_labels(labels, corner, next_corner(part->opposite[corner]));
    part->n_vertices = number_labels(labels, n_corners);
    double (*places)[3] = take(arena, part->n_vertices, sizeof *places);
    for (int64_t face = 0; face < part->n_faces; face++) {
        const int32_t *corners = cutting->corners[part->face_ids[face]];
        for (int corner = 0; corner < 3; corner++)
            memcpy(places[part->faces[face][corner]], cutting->points[corners[corner]],
                sizeof *places);
    }
    return places;
}

static double area_of(const struct part *part, const double (*places)[3])
{
    double total = 0.0;
    for (int64_t face = 0; face < part->n_faces; face++) {
        const double *a = places[part->faces[face][0]], *b = places[part->faces[face][1]];
        const double *c = places[part->faces[face][2]];
        double square = 0.0;
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            const double normal =
                (b[j] - a[j]) * (c[k] - a[k]) - (b[k] - a[k]) * (c[j] - a[j]);
            square += normal * normal;
        }
        total += 0.5 * sqrt(square);
    }
    return total;
}

/* Flatten all faces of a part together, unless too many of them overlap. */
static void lay_out(const struct cutting *cutting, struct part *part)
{
    struct arena *arena = cutting->arena;
    const double (*places)[3] = (const double (*)[3])place_vertices(cutting, part);
    part->uvs = take_zeros(arena, part->n_vertices, sizeof *part->uvs);
    part->area = area_of(part, places);
    const arena_mark mark = mark_arena(arena);
    const int32_t (*faces)[3] = (const int32_t (*)[3])part->faces;
    struct patch patch;
    struct flat flat;
    part->is_laid = make_patch(arena, part->n_vertices, part->n_faces, faces, &patch)
        && flatten(arena, &patch, places, false, LIMITS, part->uvs, &flat);
    if (part->is_laid) {
        part->l2 = flat.l2;
        part->is_injective = flat.is_injective;
        if (!flat.is_injective) {
            const int64_t n_overlaps = count_overlaps(
                arena, (const double (*)[2])part->uvs, part->n_faces, faces, cutting->depth);
            part->is_laid = (double)n_overlaps <= MOST_OVERLAP * (double)part->n_faces;
        }
    }
    reset_arena(arena, mark);
}

/* Label the connected pieces of a part; return how many there are. */
static int32_t label_pieces(const struct part *part, int32_t *labels)
{
    for (int32_t face = 0; face < part->n_faces; face++)
        labels[face] = face;
    for (int32_t corner = 0; corner < 3 * part->n_faces; corner++)
        if (part->opposite[corner] >= 0)
            join_labels(labels, corner / 3, part->opposite[corner] / 3);
    return number_labels(labels, part->n_faces);
}

/* Label the first half of the faces as they are met around the first, and the others. */
static int32_t label_disc(struct arena *arena, const struct part *part, int32_t *labels)
{
    int32_t *queue = TAKE(arena, int32_t, part->n_faces);
    int64_t n_met = 1, n_wanted = part->n_faces / 2;
    for (int64_t face = 0; face < part->n_faces; face++)
        labels[face] = 1;
    queue[0] = 0;
    labels[0] = 0;
    for (int64_t at = 0; at < n_met; at++) {
        for (int side = 0; side < 3; side++) {
            const int32_t opposite = part->opposite[3 * queue[at] + side];
            if (opposite >= 0 && labels[opposite / 3] == 1 && n_met < n_wanted) {
                labels[opposite / 3] = 0;
                queue[n_met++] = opposite / 3;
            }
        }
    }
    return 2;
}

/* The number of faces of the largest label. */
static int64_t largest_label(
    struct arena *arena, int64_t n_faces, const int32_t *labels, int32_t n_labels)
{
    int64_t *sizes = TAKE_ZEROS(arena, int64_t, n_labels), most = 0;
    for (int64_t face = 0; face < n_faces; face++)
        most = max_i64(most, ++sizes[labels[face]]);
    return most;
}

/* Label two or three halves of similar size, or the pieces of a part that is not connected. */
static int32_t label_halves(const struct cutting *cutting, const struct part *part, int32_t *labels)
{
    struct arena *arena = cutting->arena;
    const int64_t n_faces = part->n_faces;
    int32_t n_labels = label_pieces(part, labels);
    if (n_labels > 1)
        return n_labels;
    int32_t (*neighbors)[3] = take(arena, n_faces, sizeof *neighbors);
    double (*lengths)[3] = take(arena, n_faces, sizeof *lengths);
    for (int64_t face = 0; face < n_faces; face++) {
        memcpy(lengths[face], cutting->lengths[part->face_ids[face]], sizeof *lengths);
        for (int side = 0; side < 3; side++) {
            const int32_t opposite = part->opposite[3 * face + side];
            neighbors[face][side] = opposite >= 0 ? opposite / 3 : -1;
        }
    }
    const struct face_graph graph = {
        n_faces, (const int32_t (*)[3])neighbors, (const double (*)[3])lengths};
    /* If a second part does not grow, several smaller ones may. */
    for (int64_t n_parts = 2; n_parts <= 8; n_parts *= 2) {
        for (int64_t face = 0; face < n_faces; face++)
            labels[face] = OPEN_FACE;
        n_labels = divide_faces(arena, &graph, NULL, (n_faces + n_parts - 1) / n_parts, labels);
        const int64_t largest = largest_label(arena, n_faces, labels, n_labels);
        if ((double)largest <= max_f64(LARGEST_HALF * (double)n_faces, 1.0))
            return n_labels;
    }
    return label_disc(arena, part, labels);
}

/* Make a part of the faces of each label. */
static struct part *split(
    struct arena *arena, const struct part *part, const int32_t *labels, int32_t n_labels)
{
    struct part *parts = take_zeros(arena, n_labels, sizeof *parts);
    int32_t *within = TAKE(arena, int32_t, part->n_faces);
    for (int64_t face = 0; face < part->n_faces; face++)
        within[face] = (int32_t)parts[labels[face]].n_faces++;
    for (int32_t label = 0; label < n_labels; label++) {
        parts[label].face_ids = TAKE(arena, int32_t, parts[label].n_faces);
        parts[label].opposite = TAKE(arena, int32_t, 3 * parts[label].n_faces);
    }
    for (int64_t face = 0; face < part->n_faces; face++) {
        struct part *own = &parts[labels[face]];
        own->face_ids[within[face]] = part->face_ids[face];
        for (int side = 0; side < 3; side++) {
            const int32_t opposite = part->opposite[3 * face + side];
            const bool is_inside = opposite >= 0 && labels[opposite / 3] == labels[face];
            own->opposite[3 * within[face] + side] =
                is_inside ? 3 * within[opposite / 3] + opposite % 3 : -1;
        }
    }
    return parts;
}

/* Divide a part in halves, and flatten each. */
static void halve(const struct cutting *cutting, struct part *part)
{
    if (part->halves || part->n_faces < 2)
        return;
    struct arena *arena = cutting->arena;
    int32_t *labels = TAKE(arena, int32_t, part->n_faces);
    const arena_mark mark = mark_arena(arena);
    const int32_t n_labels = label_halves(cutting, part, labels);
    reset_arena(arena, mark);
    part->halves = split(arena, part, labels, n_labels);
    part->n_halves = n_labels;
    for (int64_t i = 0; i < part->n_halves; i++)
        lay_out(cutting, &part->halves[i]);
}

/* The stretch above 1 that the halves of a part have, times their areas; infinite if one could not be
   flattened: it is divided further. */
static double excess_of_halves(const struct part *part)
{
    double excess = 0.0;
    for (int64_t i = 0; i < part->n_halves; i++) {
        const struct part *half = &part->halves[i];
        if (!half->is_laid)
            return -INFINITY;
        excess += half->area * (half->l2 * half->l2 - 1.0);
    }
    return excess;
}

/* Whether dividing a part that is laid out lowers its stretch, as it does where the surface curves.
   The first cut may be unlucky, so that a second one is tried. */
static bool helps_to_halve(const struct cutting *cutting, struct part *part)
{
    const double limit = HELP * part->area * (part->l2 * part->l2 - 1.0);
    halve(cutting, part);
    if (part->n_halves == 0)
        return false;
    if (excess_of_halves(part) <= limit)
        return true;
    double excess = 0.0;
    for (int64_t i = 0; i < part->n_halves; i++) {
        struct part *half = &part->halves[i];
        halve(cutting, half);
        excess += half->n_halves > 0 ? excess_of_halves(half)
                                     : half->area * (half->l2 * half->l2 - 1.0);
    }
    return excess <= limit;
}

/* Make charts of a part, divided as often as it takes. */
static void cut(struct cutting *cutting, struct part *part, int level)
{
    bool is_done = part->is_laid && part->l2 <= cutting->most_l2;
    if (!is_done && part->is_laid && part->l2 <= MOST_NOISE)
        is_done = !helps_to_halve(cutting, part);
    if (is_done || part->n_faces == 1) {
        if (part->is_laid)
            cutting->charts[cutting->n_charts++] = part;
        return;
    }
    halve(cutting, part);
    for (int64_t i = 0; i < part->n_halves && level < MOST_LEVELS; i++)
        cut(cutting, &part->halves[i], level + 1);
}

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

static double side_length(const struct cutting *cutting, int32_t face, int side)
{
    const double *a = cutting->points[cutting->corners[face][side]];
    const double *b = cutting->points[cutting->corners[face][(side + 1) % 3]];
    const double x = b[0] - a[0], y = b[1] - a[1], z = b[2] - a[2];
    return sqrt(x * x + y * y + z * z);
}

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
    lay_out(cutting, joined);
    return joined;
}

/* Let a chart join a neighbor; return whether there is one. */
static bool join_neighbor(struct cutting *cutting, struct joining *joining, int32_t chart)
{
    struct neighbor best[MOST_TRIES];
    const int n_best = find_neighbors_of(cutting, joining, chart, best);
    for (int at = 0; at < n_best; at++) {
        const struct part *one = cutting->charts[chart], *other = cutting->charts[best[at].chart];
        const arena_mark mark = mark_arena(cutting->arena);
        struct part *joined = join_parts(cutting, joining, one, other);
        joining->work += joined->n_faces + LEAST_FACES;
        if (joined->is_laid && joined->is_injective && joined->l2 <= cutting->most_l2) {
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
static void join_charts(struct cutting *cutting)
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

/* Write the charts that are left, in their order; return the number of coordinates. */
static int64_t write_charts(
    const struct cutting *cutting, int32_t *labels, int32_t (*faces)[3], double (*uvs)[2],
    int64_t *n_charts)
{
    int64_t n_vertices = 0;
    for (int64_t chart = 0; chart < cutting->n_charts; chart++) {
        const struct part *part = cutting->charts[chart];
        if (!part)
            continue;
        for (int64_t i = 0; i < part->n_faces; i++) {
            labels[part->face_ids[i]] = (int32_t)*n_charts;
            for (int corner = 0; corner < 3; corner++)
                faces[part->face_ids[i]][corner] = (int32_t)(n_vertices + part->faces[i][corner]);
        }
        memcpy(uvs[n_vertices], part->uvs, (size_t)part->n_vertices * sizeof *uvs);
        n_vertices += part->n_vertices;
        (*n_charts)++;
    }
    return n_vertices;
}

/* Cut a part into charts of at most `most_l2` stretch, unless dividing does not lower it; return
   their number. `labels` gets the chart of each face, -1 without one: `faces` and `uvs` are its
   layout; `n_vertices` the number of coordinates. `lengths` come from `find_step_lengths`; overlaps
   up to `depth` do not count. */
int64_t cut_disks(
    int64_t n, int64_t n_faces, int64_t n_corners, const double points[n][3],
    const int32_t corners[n_faces][3], const int32_t opposite[3 * n_faces],
    const double lengths[n_faces][3], double most_l2, double depth, int32_t labels[n_faces],
    int32_t faces[n_faces][3], double uvs[n_corners][2], int64_t n_vertices[1])
{
    n_vertices[0] = 0;
    if (n_corners < 3 * n_faces)
        return 0;
    OPEN_ARENA(arena);
    struct cutting cutting = {
        arena, points, corners, lengths, most_l2, depth, n_faces, opposite,
        take(arena, 2 * n_faces, sizeof *cutting.charts), 0};
    struct part whole = {.n_faces = n_faces, .face_ids = TAKE(arena, int32_t, n_faces),
        .opposite = TAKE(arena, int32_t, 3 * n_faces)};
    for (int32_t face = 0; face < n_faces; face++) {
        whole.face_ids[face] = face;
        labels[face] = -1;
    }
    memcpy(whole.opposite, opposite, (size_t)(3 * n_faces) * sizeof *opposite);
    lay_out(&cutting, &whole);
    cut(&cutting, &whole, 0);
    join_charts(&cutting);
    int64_t n_charts = 0;
    n_vertices[0] = write_charts(&cutting, labels, faces, uvs, &n_charts);
    close_arena(arena);
    return n_charts;
}
