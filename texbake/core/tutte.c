/* Tutte's embedding: the boundary on a circle, every other vertex at the mean of its neighbors.

   Based on: Tutte, "How to Draw a Graph", 1963; Floater, "One-to-one Piecewise Linear Mappings over
   Triangulations", 2003 (no triangle flips for any positive weights).

   Called from texbake/mapping/atlas/flattening/flatten.py. */

#include <math.h>

#include "arena.h"
#include "conjugate_gradient.h"
#include "core.h"
#include "numbers.h"

/* Edge weights are those of harmonic maps (cotangents), clamped to these bounds: positive, or
   triangles may flip, and similar enough for the solver. */
static const double LEAST_WEIGHT = 0.02;
static const double MOST_WEIGHT = 20.0;

/* Half the sum of the cotangents opposite to each edge, at both its entries. */
static void add_cotangents(
    int64_t n_faces, const double (*points)[3], const int32_t (*faces)[3],
    const int32_t (*entries)[3][3], double *weights)
{
    for (int64_t face = 0; face < n_faces; face++) {
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            const double *a = points[faces[face][i]];
            const double *b = points[faces[face][j]], *c = points[faces[face][k]];
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
            weights[entries[face][j][k]] += 0.5 * cotangent;
            weights[entries[face][k][j]] += 0.5 * cotangent;
        }
    }
}

/* Move the vertices that are not on the circle to the weighted mean of their neighbors. */
int64_t embed_in_circle(
    int64_t n, int64_t n_faces, int64_t n_entries,
    const double points[n][3], const int32_t faces[n_faces][3], const int64_t row_starts[n + 1],
    const int32_t columns[n_entries], const int32_t entries[n_faces][3][3], const bool circle[n],
    double uvs[n][2], double tolerance)
{
    OPEN_ARENA(arena);
    double *weights = TAKE_ZEROS(arena, double, n_entries);
    double (*blocks)[4] = take_zeros(arena, n_entries, sizeof *blocks);
    double (*target)[2] = take_zeros(arena, n, sizeof *target);
    double (*inner)[2] = take(arena, n, sizeof *inner);
    const int32_t *alone = TAKE_ZEROS(arena, int32_t, n);
    add_cotangents(n_faces, points, faces, entries, weights);
    for (int64_t i = 0; i < n; i++) {
        if (circle[i])
            continue;
        double total = 0.0;
        for (int64_t at = row_starts[i] + 1; at < row_starts[i + 1]; at++) {
            const double weight = clamp_f64(weights[at], LEAST_WEIGHT, MOST_WEIGHT);
            const int32_t j = columns[at];
            total += weight;
            if (circle[j]) {
                target[i][0] += weight * uvs[j][0];
                target[i][1] += weight * uvs[j][1];
            } else {
                blocks[at][0] = blocks[at][3] = -weight;
            }
        }
        blocks[row_starts[i]][0] = blocks[row_starts[i]][3] = total;
    }
    const struct block_matrix matrix = {n, row_starts, columns, (const double (*)[4])blocks};
    solve_block_system(
        arena, &matrix, (const double (*)[2])target, (const double (*)[2])uvs, alone, inner,
        tolerance, 20 * n);
    for (int64_t i = 0; i < n; i++) {
        if (!circle[i]) {
            uvs[i][0] = inner[i][0];
            uvs[i][1] = inner[i][1];
        }
    }
    close_arena(arena);
    return 0;
}
