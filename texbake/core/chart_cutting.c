/* A connected part of a mesh flattened as one chart, or divided until its parts can be.

   Most parts of a mesh are disks of little curvature, however rough they are. They need no cuts
   inside: the layout of least symmetric Dirichlet energy is found at once. A part with holes may
   need a cut from one to another. A part that curves too much is divided, along creases or in halves,
   again and again, as long as that lowers the stretch; cuts do not remove the stretch of noise. A
   single face is always flat. Then charts join neighbors where that adds almost no stretch, since
   halving cuts some surfaces that need no cut.

   Based on: Zheng, Fu, Au, Tai, "Bilateral Normal Filtering for Mesh Denoising", 2011.

   Called from texbake/mapping/atlas/cutting/parts.py. */

#include "chart_cutting.h"

#include <math.h>
#include <string.h>

#include "core.h"
#include "elementary.h"
#include "numbers.h"

/* Dividing helps if it leaves less than `HELP` of the stretch above 1: on a smooth surface about a
   quarter is left, on noise nearly all. Where it does not help on a noisy surface, a stretch of
   `MOST_NOISE` is accepted. */
static const double HELP = 0.9;
static const double MOST_NOISE = 1.25;

/* A surface is noisy if a smaller share of its edges lies between faces of one plane, to 10 degrees. */
static const double EVEN_COSINE = 0.985;
static const double LEAST_EVEN = 0.25;

/* Rounds in which normals are filtered, and the difference of cosines at which a neighbor counts only
   a third: that of 40 degrees, or twice the mean difference where that is more. */
enum { N_FILTERS = 8 };
static const double SIMILAR = 0.234;

/* See LARGEST_HALF in part_division.c. */
enum { MOST_LEVELS = 400 };

/* The stretch above 1 of a part, times its area. */
static double excess_of(const struct part *part)
{
    return part->area * (part->l2 * part->l2 - 1.0);
}

/* The sum for the halves of a part; infinite if one could not be flattened: it is divided further. */
static double excess_of_halves(const struct part *part)
{
    double excess = 0.0;
    for (int64_t i = 0; i < part->n_halves; i++) {
        if (!part->halves[i].is_laid)
            return -INFINITY;
        excess += excess_of(&part->halves[i]);
    }
    return excess;
}

/* Whether dividing a part that is laid out lowers its stretch, as it does where the surface curves.
   The first cut may be unlucky, so that a second one is tried. */
static bool helps_to_divide(const struct cutting *cutting, struct part *part)
{
    const double limit = HELP * part->area * (part->l2 * part->l2 - 1.0);
    divide(cutting, part);
    if (part->n_halves == 0)
        return false;
    if (excess_of_halves(part) <= limit)
        return true;
    double excess = 0.0;
    for (int64_t i = 0; i < part->n_halves; i++) {
        struct part *half = &part->halves[i];
        divide(cutting, half);
        excess += half->n_halves > 0 ? excess_of_halves(half) : excess_of(half);
    }
    return excess <= limit;
}

static void cut(struct cutting *cutting, struct part *part, int level);

/* Make charts of a part that is stretched little enough, divided as often as it takes to pack well. */
static void shape(struct cutting *cutting, struct part *part, int level)
{
    int64_t n_parts = 0;
    struct part *parts = NULL;
    if (level < MOST_LEVELS && !packs_well(cutting, part)) {
        cut_open(cutting, part); /* a ring may be the side of a tube */
        if (!packs_well(cutting, part))
            parts = divide_layout(cutting, part, &n_parts);
    }
    if (!parts) {
        cutting->charts[cutting->n_charts++] = part;
        return;
    }
    for (int64_t i = 0; i < n_parts; i++) {
        if (parts[i].is_laid)
            shape(cutting, &parts[i], level + 1);
        else
            cut(cutting, &parts[i], level + 1);
    }
}

/* Whether a part is a single polygon, or protected faces, which count as one. */
static bool is_polygon(const struct cutting *cutting, const struct part *part)
{
    if (part->n_faces < 2 || !(is_in_polygon(cutting, part, 0) || is_in_polygon(cutting, part, 1)
            || is_in_polygon(cutting, part, 2)))
        return false;
    const arena_mark mark = mark_arena(cutting->arena);
    int32_t *firsts = TAKE(cutting->arena, int32_t, part->n_faces);
    find_polygons(cutting, part, firsts);
    bool is_one = true;
    for (int64_t face = 0; face < part->n_faces; face++)
        is_one &= firsts[face] == 0;
    reset_arena(cutting->arena, mark);
    return is_one;
}

/* Make charts of a part, divided as often as it takes. */
static void cut(struct cutting *cutting, struct part *part, int level)
{
    if (part->is_laid && part->is_injective && is_polygon(cutting, part)) {
        cutting->charts[cutting->n_charts++] = part;
        return;
    }
    bool is_done = part->is_laid && part->l2 <= cutting->limits.most_l2;
    if (!is_done)
        is_done = cut_open(cutting, part);
    if (!is_done && part->is_laid && cutting->is_noisy && part->l2 <= MOST_NOISE)
        is_done = !helps_to_divide(cutting, part);
    if (part->is_laid && (is_done || part->n_faces == 1)) {
        shape(cutting, part, level);
        return;
    }
    divide(cutting, part);
    for (int64_t i = 0; i < part->n_halves && level < MOST_LEVELS; i++)
        cut(cutting, &part->halves[i], level + 1);
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

/* Measure the areas of the faces, and make normals of unit length. */
static void measure_faces(struct cutting *cutting, const double (*normals)[3])
{
    cutting->normals = take_zeros(cutting->arena, cutting->n_faces, sizeof *cutting->normals);
    cutting->areas = TAKE(cutting->arena, double, cutting->n_faces);
    for (int64_t face = 0; face < cutting->n_faces; face++) {
        const double *a = cutting->points[cutting->corners[face][0]];
        const double *b = cutting->points[cutting->corners[face][1]];
        const double *c = cutting->points[cutting->corners[face][2]];
        double square = 0.0, length = 0.0;
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            const double across = (b[j] - a[j]) * (c[k] - a[k]) - (b[k] - a[k]) * (c[j] - a[j]);
            square += across * across;
            length += normals[face][i] * normals[face][i];
        }
        cutting->areas[face] = 0.5 * sqrt(square);
        for (int i = 0; i < 3 && length > 0.0; i++)
            cutting->normals[face][i] = normals[face][i] / sqrt(length);
    }
}

/* How rough a surface is: the mean of 1 less the cosine between neighbors. 0 where many faces lie in
   one plane with a neighbor, as those of a mechanical part do. */
static double roughness(const struct cutting *cutting)
{
    int64_t n_sides = 0, n_even = 0;
    double sum = 0.0;
    for (int64_t i = 0; i < 3 * cutting->n_faces; i++) {
        if (cutting->opposite[i] < 0)
            continue;
        const double *one = cutting->normals[i / 3];
        const double *two = cutting->normals[cutting->opposite[i] / 3];
        const double cosine = one[0] * two[0] + one[1] * two[1] + one[2] * two[2];
        n_sides++;
        n_even += cosine > EVEN_COSINE;
        sum += 1.0 - cosine;
    }
    return (double)n_even < LEAST_EVEN * (double)n_sides ? sum / (double)n_sides : 0.0;
}

/* Average the normals of neighbors, by area and by how similar they are: noise is evened out, and
   creases stay. */
static void filter_normals(struct cutting *cutting, double similar)
{
    const arena_mark mark = mark_arena(cutting->arena);
    double (*sums)[3] = take(cutting->arena, cutting->n_faces, sizeof *sums);
    for (int round = 0; round < N_FILTERS; round++) {
        for (int64_t face = 0; face < cutting->n_faces; face++) {
            const double *normal = cutting->normals[face];
            for (int axis = 0; axis < 3; axis++)
                sums[face][axis] = cutting->areas[face] * normal[axis];
            for (int side = 0; side < 3; side++) {
                const int32_t other = cutting->opposite[3 * face + side] / 3;
                if (cutting->opposite[3 * face + side] < 0)
                    continue;
                const double *next = cutting->normals[other];
                const double cosine =
                    normal[0] * next[0] + normal[1] * next[1] + normal[2] * next[2];
                const double weight = cutting->areas[other] * portable_exp((cosine - 1.0) / similar);
                for (int axis = 0; axis < 3; axis++)
                    sums[face][axis] += weight * next[axis];
            }
        }
        for (int64_t face = 0; face < cutting->n_faces; face++) {
            const double *sum = sums[face];
            const double length = sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
            for (int axis = 0; axis < 3 && length > 0.0; axis++)
                cutting->normals[face][axis] = sum[axis] / length;
        }
    }
    reset_arena(cutting->arena, mark);
}

/* Cut a part into charts of at most `most_l2` stretch, unless dividing does not lower it; return
   their number. Charts longer than `most_length` or larger than `most_area`, or `most_flat_area` where
   hardly stretched, of a mesh of `total_area`, are divided; those up to `tiny_area` may join with more
   stretch. `labels` gets the chart of each face, -1 without one; `faces` and `uvs` its layout;
   `n_vertices` the number of coordinates. Creases are where `normals`, of any length, differ; in a
   bevel they are those of the plane next to it. `lengths` come from `find_step_lengths`, `weights` are
   those of seams along each side; overlaps up to `depth` do not count. */
EXPORT int64_t cut_charts(
    int64_t n, int64_t n_faces, int64_t n_corners, const double points[n][3],
    const int32_t corners[n_faces][3], const int32_t opposite[3 * n_faces],
    const double normals[n_faces][3], const double lengths[n_faces][3],
    const double weights[n_faces][3], double most_l2, double most_length, double most_area,
    double most_flat_area, double total_area, double tiny_area, double depth, int32_t labels[n_faces],
    int32_t faces[n_faces][3], double uvs[n_corners][2], int64_t n_vertices[1])
{
    n_vertices[0] = 0;
    if (n_corners < 3 * n_faces)
        return 0;
    OPEN_ARENA(arena);
    struct cutting cutting = {
        .arena = arena, .points = points, .corners = corners, .lengths = lengths,
        .weights = weights,
        .limits = {most_l2, most_length, most_area, most_flat_area, total_area, tiny_area, depth},
        .n_faces = n_faces,
        .opposite = TAKE(arena, int32_t, 3 * n_faces),
        .charts = take(arena, 2 * n_faces, sizeof *cutting.charts)};
    struct part whole = {.n_faces = n_faces, .face_ids = TAKE(arena, int32_t, n_faces),
        .opposite = TAKE(arena, int32_t, 3 * n_faces)};
    for (int32_t face = 0; face < n_faces; face++) {
        whole.face_ids[face] = face;
        labels[face] = -1;
    }
    memcpy(whole.opposite, opposite, (size_t)(3 * n_faces) * sizeof *opposite);
    memcpy(cutting.opposite, opposite, (size_t)(3 * n_faces) * sizeof *opposite);
    measure_faces(&cutting, normals);
    const double rough = roughness(&cutting);
    cutting.is_noisy = rough > 0.0;
    if (cutting.is_noisy)
        filter_normals(&cutting, max_f64(SIMILAR, 2.0 * rough));
    if (is_connected(&cutting, &whole)) {
        lay_out(&cutting, &whole);
        cut(&cutting, &whole, 0);
    } else {
        divide(&cutting, &whole);
        for (int64_t i = 0; i < whole.n_halves; i++)
            cut(&cutting, &whole.halves[i], 0);
    }
    join_charts(&cutting);
    int64_t n_charts = 0;
    n_vertices[0] = write_charts(&cutting, labels, faces, uvs, &n_charts);
    close_arena(arena);
    return n_charts;
}
