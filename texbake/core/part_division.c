/* A part of a mesh divided: into connected pieces, along creases, or in halves.

   Creases are the sharp edges of a mechanical part; they bound faces that are flat or bent in one
   direction. On a rough surface sharp edges are everywhere and bound nothing.

   Called from chart_cutting.c. */

#include <math.h>
#include <string.h>

#include "border_straightening.h"
#include "chart_cutting.h"
#include "core.h"
#include "numbers.h"
#include "parts.h"
#include "union_find.h"

/* Cosine of the angle between two faces, of 40 degrees, above which their edge is a crease. */
static const double CREASE_COSINE = 0.766;

/* Creases count if they leave few regions of a single triangle, by area, and not too many regions
   at all. */
static const double MOST_SINGLE = 0.25;
enum { FACES_A_REGION = 6, LEAST_REGIONS = 16 };

/* A region of a smaller share of the area of the part goes to a neighbor, unless their angle is above
   75 degrees: then it is an edge of a mechanical part. */
static const double SMALL_REGION = 1e-3;
static const double EDGE_COSINE = 0.259;

/* Slivers are narrower than this many times the depth of overlaps that do not count: four cells of
   the grid that points lie on. */
static const double SLIVER_DEPTHS = 8.0;

/* Halves are of similar size: the larger one of a division that counts has at most this share. So
   no part is divided more often than MOST_LEVELS of chart_cutting.c. */
static const double LARGEST_HALF = 0.9;

/* Rings of faces in the band in which a border moves, for each of its edges. */
static const double BAND_WIDTH = 0.25;

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

/* The number of faces of the largest label. */
static int64_t largest_label(
    struct arena *arena, int64_t n_faces, const int32_t *labels, int32_t n_labels)
{
    int64_t *sizes = TAKE_ZEROS(arena, int64_t, n_labels), most = 0;
    for (int64_t face = 0; face < n_faces; face++)
        most = max_i64(most, ++sizes[labels[face]]);
    return most;
}

static bool is_division(
    struct arena *arena, const struct part *part, const int32_t *labels, int32_t n_labels)
{
    const int64_t largest = largest_label(arena, part->n_faces, labels, n_labels);
    return (double)largest <= max_f64(LARGEST_HALF * (double)part->n_faces, 1.0);
}

void find_polygons(const struct cutting *cutting, const struct part *part, int32_t *firsts)
{
    const arena_mark mark = mark_arena(cutting->arena);
    int32_t *numbers = TAKE(cutting->arena, int32_t, part->n_faces);
    for (int32_t face = 0; face < part->n_faces; face++)
        numbers[face] = face;
    for (int32_t edge = 0; edge < 3 * part->n_faces; edge++)
        if (is_in_polygon(cutting, part, edge))
            join_labels(numbers, edge / 3, part->opposite[edge] / 3);
    const int32_t n_polygons = number_labels(numbers, part->n_faces);
    int32_t *first_of = TAKE(cutting->arena, int32_t, n_polygons);
    for (int32_t face = (int32_t)part->n_faces - 1; face >= 0; face--)
        first_of[numbers[face]] = face;
    for (int32_t face = 0; face < part->n_faces; face++)
        firsts[face] = first_of[numbers[face]];
    reset_arena(cutting->arena, mark);
}

/* Label the connected faces of equal keys; return how many labels there are. */
static int32_t label_connected(const struct part *part, const int32_t *keys, int32_t *labels)
{
    for (int32_t face = 0; face < part->n_faces; face++)
        labels[face] = face;
    for (int32_t edge = 0; edge < 3 * part->n_faces; edge++) {
        const int32_t across = part->opposite[edge];
        if (across >= 0 && keys[across / 3] == keys[edge / 3])
            join_labels(labels, edge / 3, across / 3);
    }
    return number_labels(labels, part->n_faces);
}

/* Give the faces of a polygon the label of the first, or divide the largest polygon from the rest, as
   long as that leaves a division; return how many labels there are. Pieces that are no longer
   connected get labels of their own. */
static int32_t keep_polygons(
    const struct cutting *cutting, const struct part *part, int32_t *labels, int32_t n_labels)
{
    int32_t *firsts = TAKE(cutting->arena, int32_t, part->n_faces);
    int32_t *keys = TAKE(cutting->arena, int32_t, part->n_faces);
    int32_t *pieces = TAKE(cutting->arena, int32_t, part->n_faces);
    int32_t *sizes = TAKE_ZEROS(cutting->arena, int32_t, part->n_faces), largest = 0;
    find_polygons(cutting, part, firsts);
    bool is_cut = false;
    for (int32_t face = 0; face < part->n_faces; face++) {
        keys[face] = labels[firsts[face]];
        is_cut |= labels[face] != keys[face];
        largest = ++sizes[firsts[face]] > sizes[largest] ? firsts[face] : largest;
    }
    if (!is_cut)
        return n_labels;
    int32_t n_pieces = label_connected(part, keys, pieces);
    if (!is_division(cutting->arena, part, pieces, n_pieces)) {
        for (int32_t face = 0; face < part->n_faces; face++)
            keys[face] = firsts[face] == largest;
        n_pieces = label_connected(part, keys, pieces);
        /* A polygon of protected faces may be most of a part. */
        const bool is_most = 2 * (int64_t)sizes[largest] > part->n_faces;
        if (n_pieces < 2 || !(is_most || is_division(cutting->arena, part, pieces, n_pieces)))
            return n_labels;
    }
    memcpy(labels, pieces, (size_t)part->n_faces * sizeof *labels);
    return n_pieces;
}

/* The longest side of a face that is too thin for its normal to mean anything; -1 for any other. */
static int longest_side(const struct cutting *cutting, int32_t face)
{
    int longest = 0;
    double most = 0.0;
    for (int side = 0; side < 3; side++) {
        const double length = side_length(cutting, face, side);
        if (length > most) {
            most = length;
            longest = side;
        }
    }
    const double width = most > 0.0 ? 2.0 * cutting->areas[face] / most : 0.0;
    return width < SLIVER_DEPTHS * cutting->limits.depth ? longest : -1;
}

/* Whether two neighbors belong to one region. A sliver belongs to that beyond its longest side. */
static bool is_smooth(const struct cutting *cutting, int32_t face, int side, int32_t other, int back)
{
    const int one = longest_side(cutting, face), two = longest_side(cutting, other);
    if (one >= 0 || two >= 0)
        return one == side || two == back;
    const double *a = cutting->normals[face], *b = cutting->normals[other];
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] >= CREASE_COSINE;
}

/* Merge every region of little area into the one beyond its longest side that is no
   sharp edge; return how many are left. */
static int32_t merge_small(
    const struct cutting *cutting, const struct part *part, int32_t *labels, int32_t n_regions)
{
    struct arena *arena = cutting->arena;
    double *areas = TAKE_ZEROS(arena, double, n_regions);
    double *longest = TAKE_ZEROS(arena, double, n_regions);
    int32_t *into = TAKE(arena, int32_t, n_regions), *beyond = TAKE(arena, int32_t, n_regions);
    for (int32_t region = 0; region < n_regions; region++)
        into[region] = beyond[region] = region;
    for (int64_t face = 0; face < part->n_faces; face++)
        areas[labels[face]] += cutting->areas[part->face_ids[face]];
    for (int32_t corner = 0; corner < 3 * part->n_faces; corner++) {
        const int32_t across = part->opposite[corner], region = labels[corner / 3];
        if (across < 0 || labels[across / 3] == region)
            continue;
        const double *one = cutting->normals[part->face_ids[corner / 3]];
        const double *two = cutting->normals[part->face_ids[across / 3]];
        if (one[0] * two[0] + one[1] * two[1] + one[2] * two[2] < EDGE_COSINE)
            continue;
        const double length = side_length(cutting, part->face_ids[corner / 3], corner % 3);
        if (length > longest[region]) {
            longest[region] = length;
            beyond[region] = labels[across / 3];
        }
    }
    for (int32_t region = 0; region < n_regions; region++)
        if (areas[region] < SMALL_REGION * part->area)
            join_labels(into, region, beyond[region]);
    const int32_t n_left = number_labels(into, n_regions);
    for (int64_t face = 0; face < part->n_faces; face++)
        labels[face] = into[labels[face]];
    return n_left;
}

/* Label the regions between creases; return how many there are, 0 if creases bound nothing. */
static int32_t label_regions(
    const struct cutting *cutting, const struct part *part, int32_t *labels)
{
    for (int32_t face = 0; face < part->n_faces; face++)
        labels[face] = face;
    for (int32_t corner = 0; corner < 3 * part->n_faces; corner++) {
        const int32_t face = corner / 3, other = part->opposite[corner] / 3;
        if (part->opposite[corner] < 0 || other < face)
            continue;
        if (is_smooth(cutting, part->face_ids[face], corner % 3, part->face_ids[other],
                part->opposite[corner] % 3))
            join_labels(labels, face, other);
    }
    const int32_t n_regions =
        merge_small(cutting, part, labels, number_labels(labels, part->n_faces));
    if (n_regions < 2
        || n_regions > max_i64(LEAST_REGIONS, part->n_faces / FACES_A_REGION)
        || !is_division(cutting->arena, part, labels, n_regions))
        return 0;
    int64_t *sizes = TAKE_ZEROS(cutting->arena, int64_t, n_regions);
    for (int64_t face = 0; face < part->n_faces; face++)
        sizes[labels[face]]++;
    double single = 0.0, total = 0.0;
    for (int64_t face = 0; face < part->n_faces; face++) {
        const double area = cutting->areas[part->face_ids[face]];
        total += area;
        single += sizes[labels[face]] == 1 ? area : 0.0;
    }
    return single <= MOST_SINGLE * total ? n_regions : 0;
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

/* Label two or three halves of similar size of a connected part. */
static int32_t label_halves(const struct cutting *cutting, const struct part *part, int32_t *labels)
{
    struct arena *arena = cutting->arena;
    const int64_t n_faces = part->n_faces;
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
        const int32_t n_labels =
            divide_faces(arena, &graph, NULL, (n_faces + n_parts - 1) / n_parts, labels);
        if (is_division(arena, part, labels, n_labels))
            return n_labels;
    }
    return label_disc(arena, part, labels);
}

struct part *split(
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

void straighten(const struct cutting *cutting, const struct part *part, int32_t *labels)
{
    struct arena *arena = cutting->arena;
    const arena_mark mark = mark_arena(arena);
    int32_t (*corners)[3] = take(arena, part->n_faces, sizeof *corners);
    double (*weights)[3] = take(arena, part->n_faces, sizeof *weights);
    for (int64_t face = 0; face < part->n_faces; face++) {
        memcpy(corners[face], cutting->corners[part->face_ids[face]], sizeof *corners);
        memcpy(weights[face], cutting->weights[part->face_ids[face]], sizeof *weights);
    }
    const struct weighted_surface surface = {part->n_faces, cutting->points,
        (const int32_t (*)[3])corners, part->opposite, (const double (*)[3])weights};
    straighten_labels(arena, &surface, BAND_WIDTH, labels);
    reset_arena(arena, mark);
}

bool is_connected(const struct cutting *cutting, const struct part *part)
{
    const arena_mark mark = mark_arena(cutting->arena);
    const int32_t n_pieces = label_pieces(part, TAKE(cutting->arena, int32_t, part->n_faces));
    reset_arena(cutting->arena, mark);
    return n_pieces == 1;
}

void divide(const struct cutting *cutting, struct part *part)
{
    if (part->halves || part->n_faces < 2)
        return;
    struct arena *arena = cutting->arena;
    int32_t *labels = TAKE(arena, int32_t, part->n_faces);
    const arena_mark mark = mark_arena(arena);
    int32_t n_labels = label_pieces(part, labels);
    if (n_labels == 1)
        n_labels = label_regions(cutting, part, labels);
    if (n_labels == 0)
        n_labels = label_halves(cutting, part, labels);
    n_labels = keep_polygons(cutting, part, labels, n_labels);
    straighten(cutting, part, labels);
    reset_arena(arena, mark);
    part->halves = split(arena, part, labels, n_labels);
    part->n_halves = n_labels;
    for (int64_t i = 0; i < part->n_halves; i++)
        lay_out(cutting, &part->halves[i]);
}
