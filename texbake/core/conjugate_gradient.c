/* Conjugate gradients for sparse symmetric systems of 2 x 2 blocks.

   The unknowns are the movements of the vertices of a flat patch. The preconditioner adds two
   corrections: one for each vertex, the inverse of its diagonal block; and one for whole regions of
   the patch, each moved and rotated as a rigid body, from a small dense system. The first alone does
   not see errors that change slowly over the patch, and takes more iterations the finer the patch is.
   The patch is halved into regions of equal size, again and again, across their longer sides.

   Based on: Hestenes, Stiefel, "Methods of Conjugate Gradients for Solving Linear Systems", 1952;
   Vaněk, Mandel, Brezina, "Algebraic Multigrid by Smoothed Aggregation for Second and Fourth Order
   Elliptic Problems", 1996 (rigid bodies as a coarse space; here on two levels, without the
   smoothing, and added); Bentley, "Multidimensional Binary Search Trees Used for Associative
   Searching", 1975; Hoare, "Algorithm 65: Find", 1961 (medians).

   Called from flatten.c, tutte.c and symmetric_dirichlet.c. */

#include <math.h>

#include "arena.h"
#include "core.h"
#include "flattening.h"
#include "numbers.h"

/* Least number of vertices in a region, and most halvings of the patch: 64 regions give a system of
   192 unknowns, which takes about as long as ten iterations with 3,000 vertices. */
enum { REGION_SIZE = 64, MOST_HALVINGS = 6 };

struct key {
    double value;
    int32_t vertex;
};

static inline bool comes_before(struct key a, struct key b)
{
    return a.value < b.value || (a.value == b.value && a.vertex < b.vertex);
}

/* Order keys so that the least `middle` of them come first. */
static void part_at(struct key *keys, int64_t n, int64_t middle)
{
    int64_t low = 0, high = n - 1;
    while (low < high) {
        const struct key pivot = keys[low + (high - low) / 2];
        int64_t i = low - 1, j = high + 1;
        while (true) {
            do
                i++;
            while (comes_before(keys[i], pivot));
            do
                j--;
            while (comes_before(pivot, keys[j]));
            if (i >= j)
                break;
            const struct key kept = keys[i];
            keys[i] = keys[j];
            keys[j] = kept;
        }
        if (middle <= j)
            high = j;
        else
            low = j + 1;
    }
}

static int longer_axis(const double (*uvs)[2], int64_t n, const int32_t *order)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int64_t i = 0; i < n; i++) {
        for (int axis = 0; axis < 2; axis++) {
            low[axis] = min_f64(low[axis], uvs[order[i]][axis]);
            high[axis] = max_f64(high[axis], uvs[order[i]][axis]);
        }
    }
    return high[1] - low[1] > high[0] - low[0];
}

void divide_regions(
    struct arena *arena, int64_t n, const double (*uvs)[2], int32_t *regions)
{
    const arena_mark mark = mark_arena(arena);
    int n_halvings = 0;
    while (n_halvings < MOST_HALVINGS && n >= (int64_t)REGION_SIZE << (n_halvings + 1))
        n_halvings++;
    int32_t *order = TAKE(arena, int32_t, n);
    struct key *keys = TAKE(arena, struct key, n);
    for (int64_t i = 0; i < n; i++)
        order[i] = (int32_t)i;
    for (int level = 0; level < n_halvings; level++) {
        for (int64_t region = 0; region < (int64_t)1 << level; region++) {
            const int64_t first = region * n >> level, end = (region + 1) * n >> level;
            const int64_t middle = (2 * region + 1) * n >> (level + 1);
            const int axis = longer_axis(uvs, end - first, order + first);
            for (int64_t i = first; i < end; i++)
                keys[i] = (struct key){uvs[order[i]][axis], order[i]};
            part_at(keys + first, end - first, middle - first);
            for (int64_t i = first; i < end; i++)
                order[i] = keys[i].vertex;
        }
    }
    for (int64_t region = 0; region < (int64_t)1 << n_halvings; region++)
        for (int64_t i = region * n >> n_halvings; i < (region + 1) * n >> n_halvings; i++)
            regions[order[i]] = (int32_t)region;
    reset_arena(arena, mark);
}

/* Added to the dense system, as a share of its diagonal. Without it the system is singular, because
   the patch as a whole is free to move. */
static const double RIDGE = 1e-9;

struct preconditioner {
    double (*inverses)[3]; /* of the diagonal blocks: xx, xy, yy */
    double (*bodies)[2];   /* vertices relative to the middle of their region */
    double *factor;        /* size * size, lower triangle: Cholesky, its diagonal inverted */
    double *columns;       /* the same, transposed */
    int64_t size;          /* three movements per region, or 0 with a single region */
};

/* Invert the diagonal blocks; return the number of regions. */
static int64_t invert_diagonal(
    const struct block_matrix *matrix, const int32_t *regions, double (*inverses)[3])
{
    int64_t n_regions = 0;
    for (int64_t i = 0; i < matrix->n; i++) {
        n_regions = max_i64(n_regions, regions[i] + 1);
        const double *block = matrix->blocks[matrix->row_starts[i]];
        const double a = block[0], b = 0.5 * (block[1] + block[2]), c = block[3];
        const double determinant = a * c - b * b;
        if (determinant > 1e-14 * a * c) {
            inverses[i][0] = c / determinant;
            inverses[i][1] = -b / determinant;
            inverses[i][2] = a / determinant;
        } else { /* also for a vertex without entries */
            inverses[i][0] = a > 0.0 ? 1.0 / a : 0.0;
            inverses[i][1] = 0.0;
            inverses[i][2] = c > 0.0 ? 1.0 / c : 0.0;
        }
    }
    return n_regions;
}

/* Place each vertex relative to the middle of its region, in units of their common spread. */
static void place_in_regions(
    struct arena *arena, int64_t n, const double (*uvs)[2], const int32_t *regions,
    int64_t n_regions, double (*bodies)[2])
{
    double (*sums)[3] = take_zeros(arena, n_regions, sizeof *sums);
    for (int64_t i = 0; i < n; i++) {
        sums[regions[i]][0] += uvs[i][0];
        sums[regions[i]][1] += uvs[i][1];
        sums[regions[i]][2] += 1.0;
    }
    double spread = 0.0;
    for (int64_t i = 0; i < n; i++) {
        const double *sum = sums[regions[i]];
        bodies[i][0] = uvs[i][0] - sum[0] / sum[2];
        bodies[i][1] = uvs[i][1] - sum[1] / sum[2];
        spread += (bodies[i][0] * bodies[i][0] + bodies[i][1] * bodies[i][1]) / n;
    }
    spread = spread > 0.0 ? sqrt(spread) : 1.0;
    for (int64_t i = 0; i < n; i++) {
        bodies[i][0] /= spread;
        bodies[i][1] /= spread;
    }
}

/* Add the blocks of the matrix to the dense system over the movements of the regions. */
static void project_on_regions(
    const struct block_matrix *matrix, const int32_t *regions, struct preconditioner *made)
{
    const int64_t size = made->size;
    for (int64_t i = 0; i < matrix->n; i++) {
        const int64_t row = 3 * (int64_t)regions[i];
        const double xi = made->bodies[i][0], yi = made->bodies[i][1];
        for (int64_t at = matrix->row_starts[i]; at < matrix->row_starts[i + 1]; at++) {
            const int32_t j = matrix->columns[at];
            const int64_t column = 3 * (int64_t)regions[j];
            if (column > row)
                continue;
            const double xj = made->bodies[j][0], yj = made->bodies[j][1];
            const double *block = matrix->blocks[at];
            const double a = block[0], c = block[1], b = block[2], d = block[3];
            /* Movements of i and j along both axes, and a rotation (-y, x). */
            const double turned_x = b * xj - a * yj, turned_y = d * xj - c * yj;
            double *first = made->factor + row * size + column;
            double *second = first + size, *third = second + size;
            first[0] += a;
            first[1] += b;
            first[2] += turned_x;
            second[0] += c;
            second[1] += d;
            second[2] += turned_y;
            third[0] += c * xi - a * yi;
            third[1] += d * xi - b * yi;
            third[2] += turned_y * xi - turned_x * yi;
        }
    }
}

/* Replace the lower triangle by its Cholesky factor, and write that transposed to `columns`; the
   diagonals are stored inverted. Columns are subtracted in their order, each as a whole. */
static void factorize(int64_t size, double *matrix, double *columns)
{
    for (int64_t j = 0; j < size; j++) {
        double *column = columns + j * size;
        for (int64_t i = j; i < size; i++)
            column[i] = matrix[i * size + j];
        column[j] += RIDGE * column[j];
        for (int64_t k = 0; k < j; k++) {
            const double *before = columns + k * size;
            const double share = before[j];
            for (int64_t i = j; i < size; i++)
                column[i] -= before[i] * share;
        }
        /* A region without entries does not move. */
        column[j] = column[j] > 0.0 ? 1.0 / sqrt(column[j]) : 0.0;
        for (int64_t i = j + 1; i < size; i++)
            column[i] *= column[j];
        for (int64_t i = j; i < size; i++)
            matrix[i * size + j] = column[i];
    }
}

static struct preconditioner make_preconditioner(
    struct arena *arena, const struct block_matrix *matrix, const double (*uvs)[2],
    const int32_t *regions)
{
    struct preconditioner made;
    made.inverses = take(arena, matrix->n, sizeof *made.inverses);
    made.bodies = take_zeros(arena, matrix->n, sizeof *made.bodies);
    const int64_t n_regions = invert_diagonal(matrix, regions, made.inverses);
    made.size = n_regions < 2 ? 0 : 3 * n_regions;
    made.factor = TAKE_ZEROS(arena, double, made.size * made.size);
    made.columns = TAKE(arena, double, made.size * made.size);
    if (made.size > 0) {
        place_in_regions(arena, matrix->n, uvs, regions, n_regions, made.bodies);
        project_on_regions(matrix, regions, &made);
        factorize(made.size, made.factor, made.columns);
    }
    return made;
}

/* Move the regions: `coarse` holds the sums of their residuals, then their movements. */
static void solve_coarse(const struct preconditioner *made, double *coarse)
{
    const int64_t size = made->size;
    for (int64_t column = 0; column < size; column++) {
        const double *factor = made->columns + column * size;
        coarse[column] *= factor[column];
        for (int64_t row = column + 1; row < size; row++)
            coarse[row] -= factor[row] * coarse[column];
    }
    for (int64_t row = size - 1; row >= 0; row--) {
        const double *factor = made->factor + row * size;
        coarse[row] *= factor[row];
        for (int64_t column = 0; column < row; column++)
            coarse[column] -= factor[column] * coarse[row];
    }
}

/* Write M r to `better`, and return r · M r. */
static double precondition(
    const struct preconditioner *made, int64_t n, const int32_t *regions,
    const double (*residual)[2], double *coarse, double (*better)[2])
{
    const bool has_regions = made->size > 0;
    for (int64_t row = 0; row < made->size; row++)
        coarse[row] = 0.0;
    for (int64_t i = 0; has_regions && i < n; i++) {
        double *sums = coarse + 3 * (int64_t)regions[i];
        const double x = residual[i][0], y = residual[i][1];
        sums[0] += x;
        sums[1] += y;
        sums[2] += made->bodies[i][0] * y - made->bodies[i][1] * x;
    }
    solve_coarse(made, coarse);
    double rho = 0.0;
    for (int64_t i = 0; i < n; i++) {
        const double *inverse = made->inverses[i];
        const double x = residual[i][0], y = residual[i][1];
        double u = inverse[0] * x + inverse[1] * y;
        double v = inverse[1] * x + inverse[2] * y;
        if (has_regions) {
            const double *moved = coarse + 3 * (int64_t)regions[i];
            u += moved[0] - moved[2] * made->bodies[i][1];
            v += moved[1] + moved[2] * made->bodies[i][0];
        }
        better[i][0] = u;
        better[i][1] = v;
        rho += x * u + y * v;
    }
    return rho;
}

/* Write A d to `product`, and return d · A d. */
static double multiply(
    const struct block_matrix *matrix, const double (*direction)[2], double (*product)[2])
{
    double curvature = 0.0;
    for (int64_t i = 0; i < matrix->n; i++) {
        double sums[2] = {0.0, 0.0};
        for (int64_t at = matrix->row_starts[i]; at < matrix->row_starts[i + 1]; at++) {
            const double *block = matrix->blocks[at], *other = direction[matrix->columns[at]];
            for (int axis = 0; axis < 2; axis++)
                sums[axis] += block[axis] * other[0] + block[2 + axis] * other[1];
        }
        for (int axis = 0; axis < 2; axis++)
            product[i][axis] = sums[axis];
        curvature += direction[i][0] * sums[0] + direction[i][1] * sums[1];
    }
    return curvature;
}

/* Solve A x = b in at most `n_iterations`; return how many it took. A may be singular if b lies in
   its range. `tolerance` is the residual at which to stop, as a share of `target`; the
   preconditioner measures both. With a single region there is no second correction. */
int64_t solve_block_system(
    struct arena *arena, const struct block_matrix *matrix, const double (*target)[2],
    const double (*uvs)[2], const int32_t *regions, double (*solution)[2], double tolerance,
    int64_t n_iterations)
{
    const int64_t n = matrix->n;
    const struct preconditioner made = make_preconditioner(arena, matrix, uvs, regions);
    double (*residual)[2] = take(arena, n, sizeof *residual);
    double (*direction)[2] = take_zeros(arena, n, sizeof *direction);
    double (*product)[2] = take(arena, n, sizeof *product);
    double (*better)[2] = take(arena, n, sizeof *better);
    double *coarse = TAKE(arena, double, made.size);
    for (int64_t i = 0; i < n; i++) {
        residual[i][0] = target[i][0];
        residual[i][1] = target[i][1];
        solution[i][0] = solution[i][1] = 0.0;
    }
    double size = 0.0, before = 1.0;
    for (int64_t iteration = 0; iteration < n_iterations; iteration++) {
        const double rho = precondition(&made, n, regions, residual, coarse, better);
        if (iteration == 0)
            size = rho;
        if (rho <= tolerance * tolerance * size)
            return iteration;
        const double ratio = iteration > 0 ? rho / before : 0.0;
        for (int64_t i = 0; i < n; i++) {
            direction[i][0] = better[i][0] + ratio * direction[i][0];
            direction[i][1] = better[i][1] + ratio * direction[i][1];
        }
        const double curvature = multiply(matrix, direction, product);
        if (!(curvature > 0.0))
            return iteration;
        const double step = rho / curvature;
        before = rho;
        for (int64_t i = 0; i < n; i++) {
            solution[i][0] += step * direction[i][0];
            solution[i][1] += step * direction[i][1];
            residual[i][0] -= step * product[i][0];
            residual[i][1] -= step * product[i][1];
        }
    }
    return n_iterations;
}
