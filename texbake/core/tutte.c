/* Tutte's embedding: the boundary on a circle, every other vertex at the mean of its neighbors.

   Based on: Tutte, "How to Draw a Graph", 1963; Floater, "One-to-one Piecewise Linear Mappings over
   Triangulations", 2003 (no triangle flips for any positive weights).

   Called from flatten.c. */

#include "flattening.h"

#include <math.h>
#include <string.h>

#include "arena.h"
#include "core.h"
#include "elementary.h"
#include "numbers.h"

/* Edge weights are those of harmonic maps (cotangents), clamped to these bounds: positive, or
   triangles may flip, and similar enough for the solver. */
static const double LEAST_WEIGHT = 0.02;
static const double MOST_WEIGHT = 20.0;

/* Share of the circle that the edges of the boundary share evenly, whatever their lengths. */
static const double EVEN_SHARE = 0.1;

static const double PI = 3.14159265358979323846;

/* Half the sum of the cotangents opposite to each edge, at both its entries. */
static void add_cotangents(
    const struct patch *patch, const double (*points)[3], double *weights)
{
    for (int64_t face = 0; face < patch->n_faces; face++) {
        const int32_t *corners = patch->faces[face];
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            const double *a = points[corners[i]];
            const double *b = points[corners[j]], *c = points[corners[k]];
            double dot = 0.0, first = 0.0, second = 0.0;
            for (int axis = 0; axis < 3; axis++) {
                const double to_j = b[axis] - a[axis], to_k = c[axis] - a[axis];
                dot += to_j * to_k;
                first += to_j * to_j;
                second += to_k * to_k;
            }
            const double doubled = sqrt(max_f64(first * second - dot * dot, 0.0)); /* area */
            const double cotangent = fabs(dot) < MOST_WEIGHT * doubled
                ? dot / doubled : copysign(MOST_WEIGHT, dot);
            weights[patch->entries[face][j][k]] += 0.5 * cotangent;
            weights[patch->entries[face][k][j]] += 0.5 * cotangent;
        }
    }
}

void embed(
    struct arena *arena, const struct patch *patch, const double (*points)[3], const bool *fixed,
    double tolerance, double (*uvs)[2])
{
    const int64_t n = patch->n, n_entries = patch->row_starts[n];
    double *weights = TAKE_ZEROS(arena, double, n_entries);
    double (*blocks)[4] = take_zeros(arena, n_entries, sizeof *blocks);
    double (*target)[2] = take_zeros(arena, n, sizeof *target);
    double (*inner)[2] = take(arena, n, sizeof *inner);
    const int32_t *alone = TAKE_ZEROS(arena, int32_t, n);
    add_cotangents(patch, points, weights);
    for (int64_t i = 0; i < n; i++) {
        if (fixed[i])
            continue;
        double total = 0.0;
        for (int64_t at = patch->row_starts[i] + 1; at < patch->row_starts[i + 1]; at++) {
            const double weight = clamp_f64(weights[at], LEAST_WEIGHT, MOST_WEIGHT);
            const int32_t j = patch->columns[at];
            total += weight;
            if (fixed[j]) {
                target[i][0] += weight * uvs[j][0];
                target[i][1] += weight * uvs[j][1];
            } else {
                blocks[at][0] = blocks[at][3] = -weight;
            }
        }
        blocks[patch->row_starts[i]][0] = blocks[patch->row_starts[i]][3] = total;
    }
    const struct block_matrix matrix = {
        n, patch->row_starts, patch->columns, (const double (*)[4])blocks};
    solve_block_system(
        arena, &matrix, (const double (*)[2])target, (const double (*)[2])uvs, alone, inner,
        tolerance, 20 * n);
    for (int64_t i = 0; i < n; i++)
        if (!fixed[i])
            memcpy(uvs[i], inner[i], sizeof uvs[i]);
}

static double distance(const double a[3], const double b[3])
{
    const double x = b[0] - a[0], y = b[1] - a[1], z = b[2] - a[2];
    return sqrt(x * x + y * y + z * z);
}

static double length_of_loop(
    const struct patch *patch, const double (*points)[3], int64_t loop)
{
    const int64_t first = patch->loop_starts[loop], last = patch->loop_starts[loop + 1] - 1;
    double length = 0.0;
    for (int64_t at = first; at <= last; at++) {
        const int64_t next = at < last ? at + 1 : first;
        length += distance(points[patch->loop_vertices[at]], points[patch->loop_vertices[next]]);
    }
    return length;
}

/* Put a loop on the unit circle, at angles by the lengths of its edges. */
static void put_on_circle(
    const struct patch *patch, const double (*points)[3], int64_t loop, double length,
    bool *circle, double (*uvs)[2])
{
    const int64_t first = patch->loop_starts[loop], last = patch->loop_starts[loop + 1] - 1;
    const double even = (length > 0.0 ? EVEN_SHARE : 1.0) / (double)(last - first + 1);
    const double scale = length > 0.0 ? (1.0 - EVEN_SHARE) / length : 0.0;
    double turn = 0.0;
    for (int64_t at = first; at <= last; at++) {
        const int32_t vertex = patch->loop_vertices[at];
        circle[vertex] = true;
        uvs[vertex][0] = portable_cos(2.0 * PI * turn);
        uvs[vertex][1] = portable_sin(2.0 * PI * turn);
        if (at < last)
            turn += even + scale * distance(points[vertex], points[patch->loop_vertices[at + 1]]);
    }
}

/* Fill all loops but one by fans about a new vertex in their middle. */
static bool fill_holes(
    struct arena *arena, const struct patch *patch, const double (*points)[3], int64_t outer,
    struct patch *filled, double (**filled_points)[3])
{
    const int64_t n_new = patch->n_faces + patch->n_edges;
    int32_t (*faces)[3] = take(arena, n_new, sizeof *faces);
    double (*all)[3] = take(arena, patch->n + patch->n_loops, sizeof *all);
    memcpy(faces, patch->faces, (size_t)patch->n_faces * sizeof *faces);
    memcpy(all, points, (size_t)patch->n * sizeof *all);
    int64_t n_faces = patch->n_faces, n = patch->n;
    for (int64_t loop = 0; loop < patch->n_loops; loop++) {
        if (loop == outer)
            continue;
        const int64_t first = patch->loop_starts[loop], last = patch->loop_starts[loop + 1] - 1;
        double middle[3] = {0.0, 0.0, 0.0};
        for (int64_t at = first; at <= last; at++) {
            const int32_t vertex = patch->loop_vertices[at];
            faces[n_faces][0] = patch->loop_vertices[at < last ? at + 1 : first];
            faces[n_faces][1] = vertex;
            faces[n_faces++][2] = (int32_t)n;
            for (int axis = 0; axis < 3; axis++)
                middle[axis] += points[vertex][axis] / (double)(last - first + 1);
        }
        memcpy(all[n++], middle, sizeof middle);
    }
    *filled_points = all;
    return make_patch(arena, n, n_faces, (const int32_t (*)[3])faces, filled);
}

bool lay_in_circle(
    struct arena *arena, const struct patch *patch, const double (*points)[3], double tolerance,
    double (*uvs)[2])
{
    const arena_mark mark = mark_arena(arena);
    int64_t outer = 0;
    double longest = -1.0;
    for (int64_t loop = 0; loop < patch->n_loops; loop++) {
        const double length = length_of_loop(patch, points, loop);
        if (length > longest) {
            outer = loop;
            longest = length;
        }
    }
    const int64_t most = patch->n + patch->n_loops;
    double (*laid)[2] = take_zeros(arena, most, sizeof *laid);
    bool *circle = TAKE_ZEROS(arena, bool, most);
    put_on_circle(patch, points, outer, longest, circle, laid);
    bool is_laid = true;
    if (patch->n_loops == 1) {
        embed(arena, patch, points, circle, tolerance, laid);
    } else {
        struct patch filled;
        double (*filled_points)[3];
        is_laid = fill_holes(arena, patch, points, outer, &filled, &filled_points);
        if (is_laid)
            embed(arena, &filled, (const double (*)[3])filled_points, circle, tolerance, laid);
    }
    memcpy(uvs, laid, (size_t)patch->n * sizeof *uvs);
    reset_arena(arena, mark);
    return is_laid;
}
