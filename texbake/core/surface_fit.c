/* Vertices moved to where the triangles between them fit given points best.

   Each sample is a place on a triangle, by the shares of its corners, and the point where that place
   should be. The sum of the weighted squares of the gaps is least where the vertices solve a linear
   system; conjugate gradients solve it from samples, without ever writing it down. A little of the
   squared movement of each vertex is added, so that one without samples stays.

   Based on: Hoppe, DeRose, Duchamp, McDonald, Stuetzle, "Mesh optimization", SIGGRAPH 1993 (vertices
   fitted to points on fixed triangles); Hestenes, Stiefel, "Methods of Conjugate Gradients for Solving
   Linear Systems", 1952.

   Called from texbake/mesh/refit.py. */

#include <math.h>
#include <stdbool.h>

#include "arena.h"
#include "core.h"
#include "vectors.h"

/* What a vertex may do. */
enum freedom { STAYS, MOVES_UPRIGHT, MOVES };

enum { ITERATIONS = 20 };
static const double TOLERANCE = 1e-3; /* of the residual, as a share of the first */
static const double LEAST_SINE = 1e-3; /* of a direction to those that are forbidden */
static const double STIFFNESS = 0.05; /* weight of a movement, as a share of that of the samples */

struct fit {
    int64_t n_vertices, n;
    const int32_t (*corners)[3];
    const double (*shares)[3], *weights;
    double (*allowed)[3][3]; /* of each vertex, the matrix that leaves of a move what it may do */
    double *diagonal;
};

/* Take a direction away from what a vertex may do. */
static void forbid(double (*allowed)[3], struct vector direction)
{
    double part[3], square = 0.0;
    for (int row = 0; row < 3; row++) {
        part[row] = dot(vector_at(allowed[row]), direction);
        square += part[row] * part[row];
    }
    if (!(square > LEAST_SINE * LEAST_SINE))
        return;
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 3; column++)
            allowed[row][column] -= part[row] * part[column] / square;
}

/* What each vertex may do: vertices of exact faces stay in their planes. */
static void find_allowed(
    const struct fit *fit, const uint8_t *freedoms, const double (*normals)[3],
    const double (*points)[3], int64_t n_faces, const int32_t (*faces)[3], const bool *is_exact)
{
    for (int64_t i = 0; i < fit->n_vertices; i++)
        for (int row = 0; row < 3; row++)
            for (int column = 0; column < 3; column++)
                fit->allowed[i][row][column] = freedoms[i] == STAYS ? 0.0
                    : freedoms[i] == MOVES                          ? row == column
                                           : normals[i][row] * normals[i][column];
    for (int64_t face = 0; face < n_faces; face++) {
        const struct vector a = vector_at(points[faces[face][0]]);
        const struct vector across = cross(
            minus(vector_at(points[faces[face][1]]), a), minus(vector_at(points[faces[face][2]]), a));
        const double length = sqrt(dot(across, across));
        for (int k = 0; k < 3 && is_exact[face] && length > 0.0; k++)
            forbid(fit->allowed[faces[face][k]], weighted(across, across, 1.0 / length, 0.0));
    }
}

/* Leave of each vector what its vertex may do. */
static void restrict_moves(const struct fit *fit, double (*vectors)[3])
{
    for (int64_t i = 0; i < fit->n_vertices; i++) {
        const struct vector vector = vector_at(vectors[i]);
        for (int row = 0; row < 3; row++)
            vectors[i][row] = dot(vector_at(fit->allowed[i][row]), vector);
    }
}

/* Add to the corners of each sample its share of a weighted vector. */
static void spread_sample(const struct fit *fit, int64_t i, const double vector[3], double (*sums)[3])
{
    for (int k = 0; k < 3; k++)
        for (int axis = 0; axis < 3; axis++)
            sums[fit->corners[i][k]][axis] += fit->weights[i] * fit->shares[i][k] * vector[axis];
}

/* The place of a sample. */
static void place_sample(const struct fit *fit, int64_t i, const double (*points)[3], double place[3])
{
    const int32_t *corners = fit->corners[i];
    const double *shares = fit->shares[i];
    for (int axis = 0; axis < 3; axis++)
        place[axis] = shares[0] * points[corners[0]][axis] + shares[1] * points[corners[1]][axis]
            + shares[2] * points[corners[2]][axis];
}

static void multiply(const struct fit *fit, const double (*moves)[3], double (*product)[3])
{
    for (int64_t i = 0; i < fit->n_vertices; i++)
        for (int axis = 0; axis < 3; axis++)
            product[i][axis] = STIFFNESS * fit->diagonal[i] * moves[i][axis];
    for (int64_t i = 0; i < fit->n; i++) {
        double place[3];
        place_sample(fit, i, moves, place);
        spread_sample(fit, i, place, product);
    }
    restrict_moves(fit, product);
}

static double product_of(const struct fit *fit, const double (*a)[3], const double (*b)[3])
{
    double sum = 0.0;
    for (int64_t i = 0; i < fit->n_vertices; i++)
        sum += dot(vector_at(a[i]), vector_at(b[i]));
    return sum;
}

/* Write the residual, divided by the diagonal, to `better`. */
static void precondition(const struct fit *fit, const double (*residual)[3], double (*better)[3])
{
    for (int64_t i = 0; i < fit->n_vertices; i++)
        for (int axis = 0; axis < 3; axis++)
            better[i][axis] = fit->diagonal[i] > 0.0 ? residual[i][axis] / fit->diagonal[i] : 0.0;
}

/* Add a multiple of some vectors to others. */
static void add(
    const struct fit *fit, double factor, const double (*added)[3], double kept, double (*to)[3])
{
    for (int64_t i = 0; i < fit->n_vertices; i++)
        for (int axis = 0; axis < 3; axis++)
            to[i][axis] = factor * added[i][axis] + kept * to[i][axis];
}

/* Move points so that the samples come close to their targets: `shares` are those of their corners.
   `freedoms` are 0 for a vertex that stays, 1 for one that moves along its normal, else 2. Exact faces
   stay in their planes. */
EXPORT int64_t fit_vertices(
    int64_t n_vertices, int64_t n, int64_t n_faces, const int32_t corners[n][3],
    const double shares[n][3], const double targets[n][3], const double weights[n],
    const int32_t faces[n_faces][3], const bool is_exact[n_faces],
    const uint8_t freedoms[n_vertices], const double normals[n_vertices][3],
    double points[n_vertices][3])
{
    OPEN_ARENA(arena);
    struct fit fit = {n_vertices, n, corners, shares, weights, NULL, NULL};
    fit.allowed = take(arena, n_vertices, sizeof *fit.allowed);
    find_allowed(
        &fit, freedoms, normals, (const double(*)[3])points, n_faces, faces, is_exact);
    fit.diagonal = TAKE_ZEROS(arena, double, n_vertices);
    double (*residual)[3] = take_zeros(arena, n_vertices, sizeof *residual);
    double (*direction)[3] = take_zeros(arena, n_vertices, sizeof *direction);
    double (*better)[3] = take(arena, n_vertices, sizeof *better);
    double (*product)[3] = take(arena, n_vertices, sizeof *product);
    for (int64_t i = 0; i < n; i++) {
        double gap[3];
        place_sample(&fit, i, (const double(*)[3])points, gap);
        for (int axis = 0; axis < 3; axis++)
            gap[axis] = targets[i][axis] - gap[axis];
        spread_sample(&fit, i, gap, residual);
        for (int k = 0; k < 3; k++)
            fit.diagonal[corners[i][k]] += weights[i] * shares[i][k] * shares[i][k];
    }
    restrict_moves(&fit, residual);
    double first = 0.0, before = 1.0;
    for (int iteration = 0; iteration < ITERATIONS; iteration++) {
        precondition(&fit, (const double(*)[3])residual, better);
        const double size = product_of(
            &fit, (const double(*)[3])residual, (const double(*)[3])better);
        if (iteration == 0)
            first = size;
        if (!(size > TOLERANCE * TOLERANCE * first))
            break;
        add(&fit, 1.0, (const double(*)[3])better, iteration ? size / before : 0.0, direction);
        multiply(&fit, (const double(*)[3])direction, product);
        const double step = size
            / product_of(&fit, (const double(*)[3])direction, (const double(*)[3])product);
        add(&fit, step, (const double(*)[3])direction, 1.0, points);
        add(&fit, -step, (const double(*)[3])product, 1.0, residual);
        before = size;
    }
    close_arena(arena);
    return 0;
}
