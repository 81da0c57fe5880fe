/* A part of a mesh laid out in the plane: a flat one by projection, any other with least distortion.

   Called from chart_cutting.c and its other files. */

#include <float.h>
#include <math.h>
#include <string.h>

#include "chart_cutting.h"
#include "core.h"
#include "elementary.h"
#include "flattening.h"
#include "numbers.h"
#include "union_find.h"

/* A layout of which a greater share overlaps itself is useless; less is cut off afterwards. */
static const double MOST_OVERLAP = 0.01;

/* The least gain that ends the flattening, as in flatten.py. */
static const double ACCURACY = 1e-3;

/* A part between marked seams is not divided because of stretch, and is flattened in more steps. */
enum { MARKED_EFFORT = 300 };
static const double MARKED_ACCURACY = 1e-4;

/* Length of the mean of the normals, by area, of a part that counts as flat: they deviate by less
   than a tenth of a degree. */
static const double FLAT = 1.0 - 1e-6;
/* The same for one whose projection is where its layout starts if it has no other. */
static const double NEARLY_FLAT = 0.95;

/* Slivers are flattened as if they were wider. The layout of a part that is mostly slivers is
   useless if its area grows by more than this factor and its length exceeds the bounding box in
   space by more. */
static const double MOST_GROWTH = 1.5;

/* Directions in which a layout is measured, over half a turn. */
enum { N_DIRECTIONS = 16 };
static const double PI = 3.14159265358979323846;

double (*place_vertices(const struct cutting *cutting, struct part *part))[3]
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

/* The sum of the normals of a part, each as long as its face is large; sets its area. */
static void sum_normals(struct part *part, const double (*places)[3], double sum[3])
{
    sum[0] = sum[1] = sum[2] = 0.0;
    part->area = 0.0;
    for (int64_t face = 0; face < part->n_faces; face++) {
        const double *a = places[part->faces[face][0]], *b = places[part->faces[face][1]];
        const double *c = places[part->faces[face][2]];
        double square = 0.0;
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            const double normal =
                (b[j] - a[j]) * (c[k] - a[k]) - (b[k] - a[k]) * (c[j] - a[j]);
            square += normal * normal;
            sum[i] += 0.5 * normal;
        }
        part->area += 0.5 * sqrt(square);
    }
}

/* Project a part along its mean normal if that is at least so long, relative to the area. */
static bool project(
    struct part *part, const double (*places)[3], const double normal[3], double least_length)
{
    const double length =
        sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    if (!(length > 0.0 && length >= least_length * part->area))
        return false;
    int least = 0;
    for (int axis = 1; axis < 3; axis++)
        if (fabs(normal[axis]) < fabs(normal[least]))
            least = axis;
    double up[3], across[3], n[3], square = 0.0;
    for (int axis = 0; axis < 3; axis++)
        n[axis] = normal[axis] / length;
    for (int axis = 0; axis < 3; axis++) {
        up[axis] = (axis == least) - n[least] * n[axis];
        square += up[axis] * up[axis];
    }
    for (int axis = 0; axis < 3; axis++)
        up[axis] /= sqrt(square);
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        across[i] = up[j] * n[k] - up[k] * n[j];
    }
    for (int64_t vertex = 0; vertex < part->n_vertices; vertex++) {
        double u = 0.0, v = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            u += across[axis] * places[vertex][axis];
            v += up[axis] * places[vertex][axis];
        }
        part->uvs[vertex][0] = u;
        part->uvs[vertex][1] = v;
    }
    return true;
}

static double flat_area(const struct part *part)
{
    double area = 0.0;
    for (int64_t face = 0; face < part->n_faces; face++) {
        const double *a = part->uvs[part->faces[face][0]], *b = part->uvs[part->faces[face][1]];
        const double *c = part->uvs[part->faces[face][2]];
        area += 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
    }
    return area;
}

/* Diagonal of the bounding box in space. */
static double diagonal_of(const struct part *part, const double (*places)[3])
{
    double square = 0.0;
    for (int axis = 0; axis < 3; axis++) {
        double low = INFINITY, high = -INFINITY;
        for (int64_t vertex = 0; vertex < part->n_vertices; vertex++) {
            low = min_f64(low, places[vertex][axis]);
            high = max_f64(high, places[vertex][axis]);
        }
        square += (high - low) * (high - low);
    }
    return sqrt(square);
}

/* With the extent h(i) in each of n directions, it has sides of
   lengths (h(i + 1) + h(i - 1) - 2 h(i) cos δ) / sin δ. */
void measure_hull(struct part *part)
{
    double extents[2 * N_DIRECTIONS];
    for (int i = 0; i < N_DIRECTIONS; i++) {
        const double x = portable_cos(PI * i / N_DIRECTIONS), y = portable_sin(PI * i / N_DIRECTIONS);
        double low = INFINITY, high = -INFINITY;
        for (int64_t vertex = 0; vertex < part->n_vertices; vertex++) {
            const double at = x * part->uvs[vertex][0] + y * part->uvs[vertex][1];
            low = min_f64(low, at);
            high = max_f64(high, at);
        }
        extents[i] = high;
        extents[i + N_DIRECTIONS] = -low;
    }
    part->hull_area = part->length = 0.0;
    const double step = PI / N_DIRECTIONS;
    for (int i = 0; i < 2 * N_DIRECTIONS; i++) {
        const double before = extents[(i + 2 * N_DIRECTIONS - 1) % (2 * N_DIRECTIONS)];
        const double after = extents[(i + 1) % (2 * N_DIRECTIONS)];
        const double side = before + after - 2.0 * extents[i] * portable_cos(step);
        part->hull_area += extents[i] * side / (2.0 * portable_sin(step));
        part->length =
            max_f64(part->length, extents[i] + extents[(i + N_DIRECTIONS) % (2 * N_DIRECTIONS)]);
    }
}

void lay_out_from(
    const struct cutting *cutting, struct part *part, const double (*places)[3], bool has_start,
    int64_t n_steps)
{
    struct arena *arena = cutting->arena;
    double normal[3];
    sum_normals(part, places, normal);
    const arena_mark mark = mark_arena(arena);
    const int32_t (*faces)[3] = (const int32_t (*)[3])part->faces;
    struct patch patch;
    struct flat flat;
    part->is_laid = false;
    if (make_patch(arena, part->n_vertices, part->n_faces, faces, &patch)) {
        const bool is_flat = project(part, places, normal, FLAT);
        const bool is_marked = isinf(cutting->limits.most_l2);
        struct limits limits = {is_flat ? 0 : n_steps, ACCURACY, false, NULL};
        if (is_marked && !is_flat)
            limits = (struct limits){MARKED_EFFORT, MARKED_ACCURACY, false, NULL};
        part->is_laid = flatten(
            arena, &patch, places, is_flat || has_start, limits, part->uvs, &flat);
        if (is_marked && part->is_laid && !is_flat && !flat.is_injective) {
            limits.keep_apart = true; /* from a circle, which no triangle leaves */
            part->is_laid = flatten(arena, &patch, places, has_start, limits, part->uvs, &flat);
        }
    }
    if (part->is_laid) {
        part->l2 = flat.l2;
        part->is_injective = flat.is_injective;
        if (!flat.is_injective) {
            const int64_t n_overlaps = count_overlaps(
                arena, (const double (*)[2])part->uvs, part->n_faces, faces, cutting->limits.depth);
            part->is_laid = (double)n_overlaps <= MOST_OVERLAP * (double)part->n_faces;
        }
        measure_hull(part);
        if (flat_area(part) > MOST_GROWTH * part->area
            && part->length > MOST_GROWTH * diagonal_of(part, places))
            part->is_laid = false;
    }
    reset_arena(arena, mark);
}

void lay_out(const struct cutting *cutting, struct part *part)
{
    const double (*places)[3] = (const double (*)[3])place_vertices(cutting, part);
    part->uvs = take_zeros(cutting->arena, part->n_vertices, sizeof *part->uvs);
    lay_out_from(cutting, part, places, false, FULL_EFFORT);
    double normal[3];
    sum_normals(part, places, normal);
    /* A plate with holes and bevels is no disk, and needs a start. */
    if (!part->is_laid && project(part, places, normal, NEARLY_FLAT))
        lay_out_from(cutting, part, places, true, FULL_EFFORT);
}
