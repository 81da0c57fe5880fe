/* The symmetric Dirichlet energy of a flat patch, and its minimum by projected Newton steps.

   Let J be the Jacobian that takes a triangle from its shape in space to the plane, and σ1 ≥ σ2 > 0
   its singular values. The energy is the sum of A (σ1² + σ2² + σ1⁻² + σ2⁻²) over the triangles, with
   A their areas in space. It is 4 A where lengths are kept, and infinite where a triangle flips.
   Newton steps use the part of the Hessian that curves upward, and stop short of the first flip.

   Based on: Smith, Schaefer, "Bijective Parameterization with Free Boundaries", 2015 (the energy, and
   the longest step without a flip); Smith, de Goes, Kim, "Analytic Eigensystems for Isotropic
   Distortion Energies", 2019 (the four eigenvalues of a triangle's Hessian, of which only that of a
   rotation can be negative); Teran, Sifakis, Irving, Fedkiw, "Robust Quasistatic Finite Elements and
   Flesh Simulation", 2005 (projected Newton steps solved by conjugate gradients).

   Called from flatten.c. */

#include "flattening.h"

#include <math.h>

#include "arena.h"
#include "core.h"
#include "elementary.h"
#include "numbers.h"

/* Newton systems are solved until the residual is this share of the right side. A step of full
   precision gains little more and takes several times as long. */
static const double TOLERANCE = 0.1;
enum { MOST_SOLVER_STEPS = 1000 };

/* A slight distortion, as a share of the energy: gains are never compared with less than this. */
static const double SLIGHT = 0.025;

/* Least height of a triangle as a share of its longest edge, and least length of that edge as a
   share of the mean. A flatter or smaller triangle is flattened as if it had these, since its own
   shape is lost in rounding and would dominate the energy. */
static const double LEAST_HEIGHT = 1e-5;
static const double LEAST_LENGTH = 1e-5;

struct jacobian {
    double m00, m01, m10, m11;
    double determinant;
    double square; /* of its norm: σ1² + σ2² */
};

/* Squared length of the edge from corner i to the next. */
static double edge_square(const double (*points)[3], const int32_t face[3], int i)
{
    const double *a = points[face[i]], *b = points[face[(i + 1) % 3]];
    const double x = b[0] - a[0], y = b[1] - a[1], z = b[2] - a[2];
    return x * x + y * y + z * z;
}

/* Write the gradients of a triangle's hat functions, and return its area. */
static double set_rest_shape(
    const double (*points)[3], const int32_t face[3], double mean, double (*gradients)[2])
{
    int i = 0;
    double longest = -1.0;
    for (int side = 0; side < 3; side++) {
        const double square = edge_square(points, face, side);
        if (square > longest) {
            i = side;
            longest = square;
        }
    }
    longest = sqrt(longest);
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const double *a = points[face[i]], *b = points[face[j]], *c = points[face[k]];
    double along = 0.0, height = 0.0;
    for (int axis = 0; axis < 3; axis++)
        along += (c[axis] - a[axis]) * (b[axis] - a[axis]);
    const double length = max_f64(longest, LEAST_LENGTH * mean);
    along = longest > 0.0 ? along / longest : 0.5 * length;
    for (int axis = 0; longest > 0.0 && axis < 3; axis++) {
        double off = c[axis] - a[axis];
        off -= along * (b[axis] - a[axis]) / longest;
        height += off * off;
    }
    height = max_f64(sqrt(height), LEAST_HEIGHT * length);
    gradients[j][0] = 1.0 / length;
    gradients[j][1] = -along / (length * height);
    gradients[k][0] = 0.0;
    gradients[k][1] = 1.0 / height;
    gradients[i][0] = -1.0 / length;
    gradients[i][1] = along / (length * height) - 1.0 / height;
    return 0.5 * length * height;
}

struct shapes rest_shapes(
    struct arena *arena, int64_t n_faces, const int32_t (*faces)[3], const double (*points)[3])
{
    struct shapes shapes = {n_faces, faces, NULL, TAKE(arena, double, n_faces)};
    shapes.gradients = take(arena, n_faces, sizeof *shapes.gradients);
    double mean = 0.0;
    for (int64_t face = 0; face < n_faces; face++)
        for (int i = 0; i < 3; i++)
            mean += sqrt(edge_square(points, faces[face], i)) / (double)(3 * n_faces);
    for (int64_t face = 0; face < n_faces; face++)
        shapes.areas[face] = set_rest_shape(points, faces[face], mean, shapes.gradients[face]);
    return shapes;
}

static inline struct jacobian jacobian_of(
    const double (*uvs)[2], const struct shapes *shapes, int64_t face)
{
    struct jacobian j = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    for (int i = 0; i < 3; i++) {
        const double *uv = uvs[shapes->faces[face][i]], *gradient = shapes->gradients[face][i];
        j.m00 += uv[0] * gradient[0];
        j.m01 += uv[0] * gradient[1];
        j.m10 += uv[1] * gradient[0];
        j.m11 += uv[1] * gradient[1];
    }
    j.determinant = j.m00 * j.m11 - j.m01 * j.m10;
    j.square = j.m00 * j.m00 + j.m01 * j.m01 + j.m10 * j.m10 + j.m11 * j.m11;
    return j;
}

double energy_of(const double (*uvs)[2], const struct shapes *shapes)
{
    double total = 0.0;
    for (int64_t face = 0; face < shapes->n_faces; face++) {
        const struct jacobian j = jacobian_of(uvs, shapes, face);
        if (!(j.determinant > 0.0))
            return INFINITY;
        total += shapes->areas[face] * (j.square + j.square / (j.determinant * j.determinant));
    }
    return total;
}

struct stretches stretches_of(const double (*uvs)[2], const struct shapes *shapes)
{
    double dirichlet = 0.0, inverse = 0.0, growth = 0.0, total = 0.0;
    for (int64_t face = 0; face < shapes->n_faces; face++) {
        const struct jacobian j = jacobian_of(uvs, shapes, face);
        const double area = shapes->areas[face];
        dirichlet += area * j.square;
        inverse += area * j.square / (j.determinant * j.determinant);
        growth += area * j.determinant;
        total += area;
    }
    return (struct stretches){dirichlet / total, inverse / total, growth / total};
}

/* Triangles of which the rotations are found together, by vector instructions. */
enum { LANES = 16 };

/* J = U diag(σ) Vᵀ. The sum and the difference of σ1 and σ2, and the rotations U and V by half of
   (difference ± sum) of two angles, as cosines and sines. */
struct rotations {
    double total[LANES], spread[LANES], cu[LANES], su[LANES], cv[LANES], sv[LANES];
};

static void set_rotations(const struct jacobian jacobians[LANES], struct rotations *made)
{
    double x[LANES], y[LANES], s[LANES], t[LANES];
    for (int i = 0; i < LANES; i++) {
        const struct jacobian *j = &jacobians[i];
        x[i] = j->m00 + j->m11;
        y[i] = j->m10 - j->m01;
        s[i] = j->m00 - j->m11;
        t[i] = j->m10 + j->m01;
    }
    for (int i = 0; i < LANES; i++) {
        const double minus = plain_atan2(y[i], x[i]), plus = plain_atan2(t[i], s[i]);
        const struct direction u = plain_direction(0.5 * (plus + minus));
        const struct direction v = plain_direction(0.5 * (plus - minus));
        made->total[i] = plain_hypot(x[i], y[i]);
        made->spread[i] = plain_hypot(s[i], t[i]);
        made->cu[i] = u.cosine;
        made->su[i] = u.sine;
        made->cv[i] = v.cosine;
        made->sv[i] = v.sine;
    }
    for (int i = 0; i < LANES; i++) {
        if (are_plain(x[i], y[i]) && are_plain(s[i], t[i]))
            continue;
        const double minus = portable_atan2(y[i], x[i]), plus = portable_atan2(t[i], s[i]);
        made->total[i] = portable_hypot(x[i], y[i]);
        made->spread[i] = portable_hypot(s[i], t[i]);
        made->cu[i] = portable_cos(0.5 * (plus + minus));
        made->su[i] = portable_sin(0.5 * (plus + minus));
        made->cv[i] = portable_cos(0.5 * (plus - minus));
        made->sv[i] = portable_sin(0.5 * (plus - minus));
    }
}

/* A triangle's Hessian in the basis of the singular vectors. */
struct eigensystem {
    double cu, su, cv, sv;
    double stretch_1, stretch_2, same, other;
};

/* In that basis the Hessian has the eigenvalues f''(σ1) and f''(σ2) for the two stretches, and
   (f'(σ1) ∓ f'(σ2)) / (σ1 ∓ σ2) for shear and turn, where f(σ) = σ² + σ⁻². A negative one, of a
   turn, is left out. */
static inline struct eigensystem eigensystem_of(
    const struct jacobian *j, const struct rotations *rotations, int64_t lane, double area)
{
    const double first = 0.5 * (rotations->total[lane] + rotations->spread[lane]);
    const double second = j->determinant / first;
    const double first_2 = first * first, second_2 = second * second;
    const double cubed = j->determinant * (j->determinant * j->determinant);
    const double shear = area * (2.0 + 2.0 * (j->square + j->determinant) / cubed);
    const double turn = area * (2.0 - 2.0 * (j->square - j->determinant) / cubed);
    const double twist = max_f64(turn, 0.0);
    return (struct eigensystem){
        rotations->cu[lane], rotations->su[lane], rotations->cv[lane], rotations->sv[lane],
        area * (2.0 + 6.0 / (first_2 * first_2)),
        area * (2.0 + 6.0 / (second_2 * second_2)), 0.5 * (shear + twist), 0.5 * (shear - twist)};
}

static inline void add_gradient(
    const struct shapes *shapes, int64_t face, const struct jacobian *j, double (*descent)[2])
{
    /* f(J) = |J|² + |J|² / det², of which the slope is 2 J (1 + det⁻²) - 2 |J|² det⁻³ cof J. */
    const double area = shapes->areas[face], determinant = j->determinant;
    const double keep = 2.0 * area * (1.0 + 1.0 / (determinant * determinant));
    const double turn = -2.0 * area * j->square / (determinant * determinant * determinant);
    const double p00 = keep * j->m00 + turn * j->m11, p01 = keep * j->m01 - turn * j->m10;
    const double p10 = keep * j->m10 - turn * j->m01, p11 = keep * j->m11 + turn * j->m00;
    for (int i = 0; i < 3; i++) {
        const double *gradient = shapes->gradients[face][i];
        double *slope = descent[shapes->faces[face][i]];
        slope[0] -= p00 * gradient[0] + p01 * gradient[1];
        slope[1] -= p10 * gradient[0] + p11 * gradient[1];
    }
}

static inline void add_hessian(
    const struct shapes *shapes, int64_t face, const struct eigensystem *basis,
    const int32_t (*entries)[3], double (*blocks)[4])
{
    const double cu = basis->cu, su = basis->su;
    double alpha[3], beta[3];
    for (int i = 0; i < 3; i++) {
        const double *gradient = shapes->gradients[face][i];
        alpha[i] = basis->cv * gradient[0] + basis->sv * gradient[1];
        beta[i] = basis->cv * gradient[1] - basis->sv * gradient[0];
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const double a =
                basis->stretch_1 * alpha[i] * alpha[j] + basis->same * beta[i] * beta[j];
            const double b = basis->other * beta[i] * alpha[j];
            const double c = basis->other * alpha[i] * beta[j];
            const double d =
                basis->stretch_2 * beta[i] * beta[j] + basis->same * alpha[i] * alpha[j];
            /* U [[a, b], [c, d]] Uᵀ with U = [[cu, -su], [su, cu]] */
            const double e = cu * a - su * c, f = cu * b - su * d;
            const double g = su * a + cu * c, h = su * b + cu * d;
            double *block = blocks[entries[i][j]];
            block[0] += e * cu - f * su;
            block[1] += g * cu - h * su;
            block[2] += e * su + f * cu;
            block[3] += g * su + h * cu;
        }
    }
}

/* Write the negative gradient of the energy and a positive Hessian; no triangle is flipped. */
static void set_model(
    const double (*uvs)[2], const struct shapes *shapes, const int32_t (*entries)[3][3],
    int64_t n, double (*descent)[2], int64_t n_entries, double (*blocks)[4])
{
    for (int64_t i = 0; i < n; i++)
        descent[i][0] = descent[i][1] = 0.0;
    for (int64_t at = 0; at < n_entries; at++)
        blocks[at][0] = blocks[at][1] = blocks[at][2] = blocks[at][3] = 0.0;
    struct jacobian jacobians[LANES];
    struct rotations rotations;
    for (int64_t first = 0; first < shapes->n_faces; first += LANES) {
        for (int lane = 0; lane < LANES; lane++)
            jacobians[lane] = jacobian_of(uvs, shapes, min_i64(first + lane, shapes->n_faces - 1));
        set_rotations(jacobians, &rotations);
        for (int64_t face = first; face < min_i64(first + LANES, shapes->n_faces); face++) {
            const struct jacobian *j = &jacobians[face - first];
            const struct eigensystem basis =
                eigensystem_of(j, &rotations, face - first, shapes->areas[face]);
            add_gradient(shapes, face, j, descent);
            add_hessian(shapes, face, &basis, entries[face], blocks);
        }
    }
}

/* Largest t up to which every triangle of uvs + t steps keeps a positive area; may be infinite. The
   area of a triangle is a quadratic function of t, positive at 0. */
static double longest_step(
    const double (*uvs)[2], const double (*steps)[2], const struct shapes *shapes)
{
    double longest = INFINITY;
    for (int64_t face = 0; face < shapes->n_faces; face++) {
        const int32_t *corners = shapes->faces[face];
        const int32_t i = corners[0], j = corners[1], k = corners[2];
        const double ax = uvs[j][0] - uvs[i][0], ay = uvs[j][1] - uvs[i][1];
        const double bx = uvs[k][0] - uvs[i][0], by = uvs[k][1] - uvs[i][1];
        const double px = steps[j][0] - steps[i][0], py = steps[j][1] - steps[i][1];
        const double qx = steps[k][0] - steps[i][0], qy = steps[k][1] - steps[i][1];
        const double c = ax * by - ay * bx;
        const double b = ax * qy - ay * qx + px * by - py * bx;
        const double a = px * qy - py * qx;
        /* The least positive root of a t² + b t + c, in the form that does not cancel for b < 0. */
        const double discriminant = b * b - 4.0 * a * c;
        if (discriminant < 0.0)
            continue;
        const double root = sqrt(discriminant);
        if (b < 0.0)
            longest = min_f64(longest, 2.0 * c / (root - b));
        else if (a < 0.0)
            longest = min_f64(longest, -(b + root) / (2.0 * a));
    }
    return longest;
}

/* A layout while its energy is lowered, and what a step needs. */
struct descent {
    const struct patch *patch;
    const struct shapes *shapes;
    const int32_t *regions;
    const bool *fixed; /* vertices that do not move; NULL for none */
    double (*uvs)[2];
    double (*slope)[2]; /* downhill */
    double (*steps)[2];
    double (*tried)[2];
    double (*blocks)[4];
    double energy;
};

/* Take the rows and columns of vertices that do not move out of the model. */
static void hold_fixed(struct descent *descent)
{
    const struct patch *patch = descent->patch;
    for (int64_t i = 0; i < patch->n; i++) {
        if (descent->fixed[i])
            descent->slope[i][0] = descent->slope[i][1] = 0.0;
        for (int64_t at = patch->row_starts[i]; at < patch->row_starts[i + 1]; at++)
            if (descent->fixed[i] || descent->fixed[patch->columns[at]])
                for (int k = 0; k < 4; k++)
                    descent->blocks[at][k] = 0.0;
    }
}

/* Find the direction of a Newton step; return how fast the energy falls along it. */
static double find_direction(struct arena *arena, struct descent *descent)
{
    const arena_mark mark = mark_arena(arena);
    const struct patch *patch = descent->patch;
    const double (*uvs)[2] = (const double (*)[2])descent->uvs;
    const struct block_matrix matrix = {
        patch->n, patch->row_starts, patch->columns, (const double (*)[4])descent->blocks};
    set_model(
        uvs, descent->shapes, (const int32_t (*)[3][3])patch->entries, patch->n, descent->slope,
        patch->row_starts[patch->n], descent->blocks);
    if (descent->fixed != NULL)
        hold_fixed(descent);
    solve_block_system(
        arena, &matrix, (const double (*)[2])descent->slope, uvs, descent->regions,
        descent->steps, TOLERANCE, MOST_SOLVER_STEPS);
    double downhill = 0.0;
    for (int64_t i = 0; i < patch->n; i++) {
        if (descent->fixed != NULL && descent->fixed[i])
            descent->steps[i][0] = descent->steps[i][1] = 0.0;
        downhill += descent->slope[i][0] * descent->steps[i][0]
            + descent->slope[i][1] * descent->steps[i][1];
    }
    reset_arena(arena, mark);
    return downhill;
}

/* Go along the direction as far as the energy falls enough; return whether there is such a step. */
static bool search_along(
    struct arena *arena, struct descent *descent, double downhill, bool keep_apart)
{
    const struct patch *patch = descent->patch;
    const struct boundary boundary = {
        patch->n_edges, (const int32_t (*)[2])patch->edges, patch->edge_loops};
    double (*uvs)[2] = descent->uvs, (*steps)[2] = descent->steps, (*tried)[2] = descent->tried;
    const double before = descent->energy;
    double step = min_f64(1.0, 0.9 * longest_step(
        (const double (*)[2])uvs, (const double (*)[2])steps, descent->shapes));
    while (true) {
        for (int64_t i = 0; i < patch->n; i++) {
            tried[i][0] = uvs[i][0] + step * steps[i][0];
            tried[i][1] = uvs[i][1] + step * steps[i][1];
        }
        const double (*layout)[2] = (const double (*)[2])tried;
        descent->energy = energy_of(layout, descent->shapes);
        if (descent->energy <= before - 1e-4 * step * downhill
            && (!keep_apart || boundary_meets(arena, layout, &boundary) != CROSSING))
            break;
        step *= 0.5;
        if (step < 1e-10)
            return false;
    }
    for (int64_t i = 0; i < patch->n; i++) {
        uvs[i][0] = tried[i][0];
        uvs[i][1] = tried[i][1];
    }
    return true;
}

int64_t minimize_energy(
    struct arena *arena, const struct patch *patch, const struct shapes *shapes,
    const int32_t *regions, struct limits limits, double (*uvs)[2])
{
    const arena_mark mark = mark_arena(arena);
    struct descent descent = {
        .patch = patch, .shapes = shapes, .regions = regions, .fixed = limits.fixed,
        .uvs = uvs,
        .energy = energy_of((const double (*)[2])uvs, shapes)};
    descent.slope = take(arena, patch->n, sizeof *descent.slope);
    descent.steps = take(arena, patch->n, sizeof *descent.steps);
    descent.tried = take(arena, patch->n, sizeof *descent.tried);
    descent.blocks = take(arena, patch->row_starts[patch->n], sizeof *descent.blocks);
    double least = 0.0;
    for (int64_t face = 0; face < shapes->n_faces; face++)
        least += 4.0 * shapes->areas[face];
    int64_t n_done = 0;
    while (n_done < limits.n_iterations) {
        const double downhill = find_direction(arena, &descent);
        const double before = descent.energy;
        if (!(downhill > 0.0) || !search_along(arena, &descent, downhill, limits.keep_apart))
            break;
        n_done++;
        const double gained = before - descent.energy;
        if (gained <= limits.accuracy * (descent.energy - least + SLIGHT * least))
            break;
    }
    reset_arena(arena, mark);
    return n_done;
}
