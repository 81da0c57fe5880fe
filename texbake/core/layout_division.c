/* A chart that would pack badly divided along a straight line through its layout.

   That is one that is too long, or too large, or leaves too much of its convex hull empty. Of
   several lines through its centroid, the one that leaves the smallest convex hulls is taken.

   Called from chart_cutting.c. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "chart_cutting.h"
#include "core.h"
#include "elementary.h"
#include "numbers.h"
#include "union_find.h"

enum { N_LINES = 8 };
static const double PI = 3.14159265358979323846;

/* A chart may leave this share of its own area empty, or this share of the largest area. */
static const double MOST_WASTE = 0.35;
static const double SMALL_WASTE = 0.1;

/* One more part counts as much as leaving this share of the largest area empty. */
static const double COST_OF_PART = 0.01;

/* A line helps if it leaves at most this share of the length, or of the area of the largest part; or
   no more area empty than before: half a ring leaves as much empty as a ring, a quarter far less. */
static const double HELP = 0.8;

/* A chart that is hardly stretched, such as a plate, may be as large as `most_flat_area`. If that is
   more than any other may be, it may also leave this share of its area empty: plates have holes. */
static const double FLAT = 1.001;
static const double MOST_FLAT_WASTE = 1.0;

/* A chart that is nearly all there is stays whole, however large it is. */
static const double NEARLY_ALL = 0.9;

/* A face, and where it lies across a line. */
struct key {
    double at;
    int32_t face;
};

static int compare_keys(const void *one, const void *other)
{
    const struct key *a = one, *b = other;
    if (a->at != b->at)
        return a->at < b->at ? -1 : 1;
    return (a->face > b->face) - (a->face < b->face);
}

bool packs_well(const struct cutting *cutting, const struct part *part)
{
    const struct chart_limits *limits = &cutting->limits;
    if (part->l2 <= FLAT && part->n_faces == 2 && part->length <= limits->most_length)
        return true; /* a quad is not cut along its diagonal */
    const bool is_flat = part->l2 <= FLAT && limits->most_flat_area > limits->most_area;
    const double most_area = is_flat ? limits->most_flat_area : limits->most_area;
    const double most_waste = (is_flat ? MOST_FLAT_WASTE : MOST_WASTE) * part->area;
    return part->length <= limits->most_length
        && (part->area <= most_area || part->area >= NEARLY_ALL * limits->total_area)
        && part->hull_area - part->area <= max_f64(most_waste, SMALL_WASTE * limits->most_area);
}

/* Label the connected pieces on both sides of a line through the middle of the area; return how many
   there are. The border between them moves once more if it is final. */
static int32_t label_sides(
    const struct cutting *cutting, const struct part *part, double angle, bool is_final,
    int32_t *labels)
{
    struct arena *arena = cutting->arena;
    const arena_mark mark = mark_arena(arena);
    struct key *keys = TAKE(arena, struct key, part->n_faces);
    bool *is_beyond = TAKE_ZEROS(arena, bool, part->n_faces);
    for (int32_t face = 0; face < part->n_faces; face++) {
        keys[face] = (struct key){0.0, face};
        for (int corner = 0; corner < 3; corner++) {
            const double *uv = part->uvs[part->faces[face][corner]];
            keys[face].at += portable_cos(angle) * uv[0] + portable_sin(angle) * uv[1];
        }
    }
    qsort(keys, (size_t)part->n_faces, sizeof *keys, compare_keys);
    double sum = 0.0;
    for (int64_t i = 0; i < part->n_faces; i++) {
        const double area = cutting->areas[part->face_ids[keys[i].face]];
        is_beyond[keys[i].face] = i > 0 && sum + 0.5 * area >= 0.5 * part->area;
        sum += area;
    }
    is_beyond[keys[part->n_faces - 1].face] = true;
    int32_t *firsts = TAKE(arena, int32_t, part->n_faces);
    find_polygons(cutting, part, firsts);
    for (int64_t face = 0; face < part->n_faces; face++)
        labels[face] = is_beyond[firsts[face]];
    if (is_final)
        straighten(cutting, part, labels);
    for (int64_t face = 0; face < part->n_faces; face++) {
        is_beyond[face] = labels[face];
        labels[face] = (int32_t)face;
    }
    for (int32_t corner = 0; corner < 3 * part->n_faces; corner++) {
        const int32_t across = part->opposite[corner];
        if (across >= 0 && is_beyond[across / 3] == is_beyond[corner / 3])
            join_labels(labels, corner / 3, across / 3);
    }
    reset_arena(arena, mark);
    return number_labels(labels, part->n_faces);
}

/* Divide a part along a line, and measure the parts; they keep its layout. */
static struct part *divide_along(
    const struct cutting *cutting, const struct part *part, double angle, bool is_final,
    int64_t *n_parts)
{
    struct arena *arena = cutting->arena;
    int32_t *labels = TAKE(arena, int32_t, part->n_faces);
    const int32_t n_labels = label_sides(cutting, part, angle, is_final, labels);
    struct part *parts = split(arena, part, labels, n_labels);
    int64_t *n_met = TAKE_ZEROS(arena, int64_t, n_labels);
    for (int32_t label = 0; label < n_labels; label++) {
        struct part *own = &parts[label];
        place_vertices(cutting, own);
        own->uvs = take_zeros(arena, own->n_vertices, sizeof *own->uvs);
    }
    for (int64_t face = 0; face < part->n_faces; face++) {
        struct part *own = &parts[labels[face]];
        const int32_t *vertices = own->faces[n_met[labels[face]]++];
        for (int corner = 0; corner < 3; corner++)
            memcpy(own->uvs[vertices[corner]], part->uvs[part->faces[face][corner]],
                sizeof *own->uvs);
        own->area += cutting->areas[part->face_ids[face]];
    }
    for (int32_t label = 0; label < n_labels; label++)
        measure_hull(&parts[label]);
    *n_parts = n_labels;
    return parts;
}

/* Whether parts are better than the whole. */
static bool helps(
    const struct cutting *cutting, const struct part *part, const struct part *parts,
    int64_t n_parts)
{
    double length = 0.0, area = 0.0, waste = 0.0;
    for (int64_t i = 0; i < n_parts; i++) {
        length = max_f64(length, parts[i].length);
        area = max_f64(area, parts[i].area);
        waste += parts[i].hull_area - parts[i].area;
    }
    return (part->length > cutting->limits.most_length && length <= HELP * part->length)
        || (part->area > cutting->limits.most_area && area <= HELP * part->area)
        || waste <= part->hull_area - part->area;
}

struct part *divide_layout(const struct cutting *cutting, const struct part *part, int64_t *n_parts)
{
    struct arena *arena = cutting->arena;
    double least = INFINITY, best = 0.0;
    for (int line = 0; line < N_LINES && part->n_faces > 1; line++) {
        const arena_mark mark = mark_arena(arena);
        const struct part *parts = divide_along(cutting, part, PI * line / N_LINES, false, n_parts);
        double cost = COST_OF_PART * cutting->limits.most_area * (double)*n_parts;
        for (int64_t i = 0; i < *n_parts; i++)
            cost += parts[i].hull_area;
        if (*n_parts > 1 && cost < least && helps(cutting, part, parts, *n_parts)) {
            least = cost;
            best = PI * line / N_LINES;
        }
        reset_arena(arena, mark);
    }
    if (!isfinite(least))
        return NULL;
    struct part *parts = divide_along(cutting, part, best, true, n_parts);
    for (int64_t i = 0; i < *n_parts; i++) {
        const double (*places)[3] = (const double (*)[3])place_vertices(cutting, &parts[i]);
        lay_out_from(cutting, &parts[i], places, true, FULL_EFFORT);
    }
    return parts;
}
