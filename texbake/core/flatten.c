/* A patch of triangles flattened with as little distortion as possible and a free boundary.

   A layout in a circle, without flips, is the start (Tutte's embedding, with holes filled by fans);
   then the symmetric Dirichlet energy is minimized by Newton steps that stop short of the first
   flip.

   Where no triangle is flipped, a point is covered as often as the boundary winds around it. So a
   layout covers nothing twice if its boundary does not meet itself and only one of its loops runs
   counter-clockwise. Where the boundary only touches itself, like the two sides of a closed slit,
   the triangles decide, allowing for rounding.

   Based on: Smith, Schaefer, "Bijective Parameterization with Free Boundaries", 2015. It departs in
   not keeping the boundary from crossing itself unless asked to: it reports whether it does, so
   that the caller can divide the patch. Lipman, "Bijective Mappings of Meshes with Boundary and the
   Degree in Mesh Processing", 2014.

   Called from part_layout.c, chart_joining.c, texbake/mapping/atlas/flatten.py and, beside it,
   joining/pieces.py. */

#include "flattening.h"

#include <math.h>
#include <string.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"

/* Tolerances of layouts in the circle: rough at first, and close to rounding if that has flips. */
static const double CIRCLE_TOLERANCES[] = {1e-4, 1e-12};

bool is_injective(struct arena *arena, const double (*uvs)[2], const struct patch *patch)
{
    const struct boundary boundary = {
        patch->n_edges, (const int32_t (*)[2])patch->edges, patch->edge_loops};
    const int64_t meeting = boundary_meets(arena, uvs, &boundary);
    if (meeting == CROSSING)
        return false;
    if (meeting == APART && !patch->has_touching_fans)
        return true;
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int64_t face = 0; face < patch->n_faces; face++) {
        for (int corner = 0; corner < 3; corner++) {
            const double *uv = uvs[patch->faces[face][corner]];
            for (int axis = 0; axis < 2; axis++) {
                low[axis] = min_f64(low[axis], uv[axis]);
                high[axis] = max_f64(high[axis], uv[axis]);
            }
        }
    }
    const double depth = TOUCH_DEPTH * max_f64(high[0] - low[0], high[1] - low[1]);
    return count_overlaps(arena, uvs, patch->n_faces, patch->faces, depth) == 0;
}

static inline bool is_used(const struct patch *patch, int64_t vertex)
{
    return patch->row_starts[vertex + 1] > patch->row_starts[vertex] + 1;
}

/* Move and scale a layout, and measure it. Vertices without triangles go to the origin. */
static struct flat finish(
    struct arena *arena, const struct patch *patch, const struct shapes *shapes, double (*uvs)[2])
{
    double sums[2] = {0.0, 0.0};
    int64_t n_used = 0;
    for (int64_t i = 0; i < patch->n; i++) {
        if (is_used(patch, i)) {
            sums[0] += uvs[i][0];
            sums[1] += uvs[i][1];
            n_used++;
        }
    }
    const double (*layout)[2] = (const double (*)[2])uvs;
    const struct stretches mean = stretches_of(layout, shapes);
    const double scale = 1.0 / sqrt(mean.growth);
    for (int64_t i = 0; i < patch->n; i++) {
        for (int axis = 0; axis < 2; axis++) {
            const double moved = uvs[i][axis] - sums[axis] / (double)n_used;
            uvs[i][axis] = is_used(patch, i) ? moved * scale : 0.0;
        }
    }
    return (struct flat){
        sqrt(mean.inverse * mean.growth / 2.0),
        mean.dirichlet / mean.growth + mean.inverse * mean.growth,
        is_injective(arena, layout, patch)};
}

/* Lay a disk out in a circle of about its size, without flips; return whether that is possible. */
static bool start_in_circle(
    struct arena *arena, const struct patch *patch, const struct shapes *shapes,
    const double (*points)[3], double (*uvs)[2])
{
    if (!patch->is_disk)
        return false;
    const double (*layout)[2] = (const double (*)[2])uvs;
    for (size_t i = 0; i < sizeof CIRCLE_TOLERANCES / sizeof *CIRCLE_TOLERANCES; i++) {
        if (!lay_in_circle(arena, patch, points, CIRCLE_TOLERANCES[i], uvs))
            return false;
        if (!isfinite(energy_of(layout, shapes)))
            continue;
        const struct stretches mean = stretches_of(layout, shapes);
        const double scale = sqrt(sqrt(mean.inverse / mean.dirichlet)); /* of least energy */
        for (int64_t vertex = 0; vertex < patch->n; vertex++) {
            uvs[vertex][0] *= scale;
            uvs[vertex][1] *= scale;
        }
        return isfinite(energy_of(layout, shapes));
    }
    return false;
}

static bool has_area(const struct shapes *shapes)
{
    for (int64_t face = 0; face < shapes->n_faces; face++)
        if (shapes->areas[face] > 0.0)
            return true;
    return false;
}

bool flatten(
    struct arena *arena, const struct patch *patch, const double (*points)[3], bool has_start,
    struct limits limits, double (*uvs)[2], struct flat *flat)
{
    const arena_mark mark = mark_arena(arena);
    const struct shapes shapes = rest_shapes(arena, patch->n_faces, patch->faces, points);
    int32_t *regions = TAKE(arena, int32_t, patch->n);
    bool is_laid = has_area(&shapes)
        && ((has_start && isfinite(energy_of((const double (*)[2])uvs, &shapes)))
            || start_in_circle(arena, patch, &shapes, points, uvs));
    if (is_laid) {
        divide_regions(arena, patch->n, (const double (*)[2])uvs, regions);
        minimize_energy(arena, patch, &shapes, regions, limits, uvs);
        *flat = finish(arena, patch, &shapes, uvs);
        is_laid = isfinite(flat->l2);
    }
    reset_arena(arena, mark);
    return is_laid;
}

static void write_figures(const struct flat *flat, double figures[3])
{
    figures[0] = flat->l2;
    figures[1] = flat->energy;
    figures[2] = flat->is_injective;
}

/* Flatten a patch, from the layout in `uvs` if `has_start`; `figures` gets its stretch, its energy,
   and 1 if it is injective. Returns whether there is a layout. */
EXPORT int64_t flatten_patch(
    int64_t n, int64_t n_faces, const double points[n][3], const int32_t faces[n_faces][3],
    bool has_start, int64_t n_iterations, double accuracy, bool keep_apart, double uvs[n][2],
    double figures[3])
{
    OPEN_ARENA(arena);
    struct patch patch;
    struct flat flat;
    const struct limits limits = {n_iterations, accuracy, keep_apart, NULL};
    const bool is_laid = make_patch(arena, n, n_faces, faces, &patch)
        && flatten(arena, &patch, points, has_start, limits, uvs, &flat);
    if (is_laid)
        write_figures(&flat, figures);
    close_arena(arena);
    return is_laid;
}

double stretch_of_face(
    const double (*points)[3], const int32_t corners[3], const double (*uvs)[2],
    const int32_t flat_corners[3])
{
    double first = 0.0, dot = 0.0, second = 0.0, a[2], b[2];
    for (int axis = 0; axis < 3; axis++) {
        const double start = points[corners[0]][axis];
        const double x = points[corners[1]][axis] - start, y = points[corners[2]][axis] - start;
        first += x * x;
        dot += x * y;
        second += y * y;
    }
    for (int axis = 0; axis < 2; axis++) {
        const double start = uvs[flat_corners[0]][axis];
        a[axis] = uvs[flat_corners[1]][axis] - start;
        b[axis] = uvs[flat_corners[2]][axis] - start;
    }
    const double square = first * second - dot * dot, growth = a[0] * b[1] - a[1] * b[0];
    const double sum = second * (a[0] * a[0] + a[1] * a[1])
        - 2.0 * dot * (a[0] * b[0] + a[1] * b[1]) + first * (b[0] * b[0] + b[1] * b[1]);
    const double root = sqrt(max_f64(sum * sum - 4.0 * square * growth * growth, 0.0));
    return square > 0.0 && growth > 0.0 ? sqrt((sum + root) / 2.0) / growth : 1.0;
}

/* Return the largest stretch of a triangle of a layout. */
EXPORT double greatest_stretch(
    int64_t n, int64_t n_faces, const double points[n][3], const int32_t faces[n_faces][3],
    const double uvs[n][2])
{
    double most = 1.0;
    for (int64_t face = 0; face < n_faces; face++)
        most = max_f64(most, stretch_of_face(points, faces[face], uvs, faces[face]));
    return most;
}

/* Move a layout to the origin, give it its area in space, and measure it as `flatten_patch` does.
   Returns false if the triangles form no oriented surface, or one is flipped or has no area. */
EXPORT int64_t measure_layout(
    int64_t n, int64_t n_faces, const double points[n][3], const int32_t faces[n_faces][3],
    double uvs[n][2], double figures[3])
{
    OPEN_ARENA(arena);
    struct patch patch;
    bool is_measured = false;
    if (make_patch(arena, n, n_faces, faces, &patch)) {
        const struct shapes shapes = rest_shapes(arena, n_faces, faces, points);
        is_measured = isfinite(energy_of((const double (*)[2])uvs, &shapes));
        if (is_measured) {
            const struct flat flat = finish(arena, &patch, &shapes, uvs);
            write_figures(&flat, figures);
        }
    }
    close_arena(arena);
    return is_measured;
}

/* Flatten a disk whose border has the places in `uvs`, on a convex outline: `fixed` vertices stay
   there. Returns whether there is a layout without flips; `uvs` and `figures` as in `flatten_patch`. */
EXPORT int64_t flatten_within(
    int64_t n, int64_t n_faces, const double points[n][3], const int32_t faces[n_faces][3],
    const bool fixed[n], int64_t n_iterations, double accuracy, double uvs[n][2],
    double figures[3])
{
    OPEN_ARENA(arena);
    struct patch patch;
    bool is_laid = false;
    if (make_patch(arena, n, n_faces, faces, &patch) && patch.is_disk && patch.n_loops == 1) {
        const struct shapes shapes = rest_shapes(arena, n_faces, faces, points);
        const struct limits limits = {n_iterations, accuracy, false, fixed};
        embed(arena, &patch, points, fixed, CIRCLE_TOLERANCES[1], uvs);
        if (has_area(&shapes) && isfinite(energy_of((const double (*)[2])uvs, &shapes))) {
            const int32_t *regions = TAKE_ZEROS(arena, int32_t, n);
            minimize_energy(arena, &patch, &shapes, regions, limits, uvs);
            const struct flat flat = finish(arena, &patch, &shapes, uvs);
            write_figures(&flat, figures);
            is_laid = isfinite(flat.l2);
        }
    }
    close_arena(arena);
    return is_laid;
}
