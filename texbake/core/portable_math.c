/* The elementary functions of `elementary.h` over arrays; and products, inverses, eigenvectors and
   singular values of many small matrices, in a fixed order.

   BLAS and LAPACK add in an order that depends on the processor, and so does their rounding.

   Based on: Golub, Van Loan, "Matrix Computations", 4th edition, 2013: 3.4.1 (elimination with partial
   pivoting), 8.5 (Jacobi's method); Hestenes, "Inversion of Matrices by Biorthogonalization and Related
   Results", Journal of the SIAM 6(1), 1958 (singular values by rotating columns).

   Called from texbake/core/portable_math.py. */

#include <math.h>

#include "core.h"
#include "elementary.h"

/* Bodies of the functions below. */
#define OVER_ARRAY(function)                                                                      \
    {                                                                                             \
        for (int64_t i = 0; i < n; i++)                                                           \
            out[i] = function(x[i]);                                                              \
    }
#define OVER_PAIRS(function)                                                                      \
    {                                                                                             \
        for (int64_t i = 0; i < n; i++)                                                           \
            out[i] = function(x[i], y[i]);                                                        \
    }

EXPORT void array_sin(int64_t n, const double x[n], double out[n])
OVER_ARRAY(portable_sin)
EXPORT void array_cos(int64_t n, const double x[n], double out[n])
OVER_ARRAY(portable_cos)
EXPORT void array_tan(int64_t n, const double x[n], double out[n])
OVER_ARRAY(portable_tan)
EXPORT void array_asin(int64_t n, const double x[n], double out[n])
OVER_ARRAY(portable_asin)
EXPORT void array_acos(int64_t n, const double x[n], double out[n])
OVER_ARRAY(portable_acos)
EXPORT void array_atan(int64_t n, const double x[n], double out[n])
OVER_ARRAY(portable_atan)
EXPORT void array_exp(int64_t n, const double x[n], double out[n])
OVER_ARRAY(portable_exp)
EXPORT void array_log(int64_t n, const double x[n], double out[n])
OVER_ARRAY(portable_log)
EXPORT void array_log2(int64_t n, const double x[n], double out[n])
OVER_ARRAY(portable_log2)
EXPORT void array_log10(int64_t n, const double x[n], double out[n])
OVER_ARRAY(portable_log10)
EXPORT void array_atan2(int64_t n, const double x[n], const double y[n], double out[n])
OVER_PAIRS(portable_atan2)
EXPORT void array_hypot(int64_t n, const double x[n], const double y[n], double out[n])
OVER_PAIRS(portable_hypot)
EXPORT void array_power(int64_t n, const double x[n], const double y[n], double out[n])
OVER_PAIRS(portable_power)

EXPORT void array_float_power(int64_t n, const float x[n], const float y[n], float out[n])
{
    for (int64_t i = 0; i < n; i++)
        out[i] = (float)short_power(x[i], y[i]);
}

/* Rotations stop when no cosine between two columns exceeds this, or after this many rounds. */
static const double ORTHOGONAL = 0x1p-53;
static const int MOST_ROUNDS = 60;

/* Sums of products of the rows of two arrays. */
EXPORT void sum_row_products(
    int64_t n, int64_t inner, const double a[n][inner], const double b[n][inner], double out[n])
{
    for (int64_t i = 0; i < n; i++) {
        double sum = inner > 0 ? a[i][0] * b[i][0] : 0.0;
        for (int64_t k = 1; k < inner; k++)
            sum += a[i][k] * b[i][k];
        out[i] = sum;
    }
}

/* Products of matrices; either list may be a single matrix, used for all of the other list. */
EXPORT void multiply_matrices(
    int64_t n_a, int64_t n_b, int64_t n, int64_t rows, int64_t inner, int64_t columns,
    const double a[n_a][rows][inner], const double b[n_b][inner][columns],
    double out[n][rows][columns])
{
    for (int64_t i = 0; i < n; i++) {
        const double(*left)[inner] = a[n_a == 1 ? 0 : i];
        const double(*right)[columns] = b[n_b == 1 ? 0 : i];
        for (int64_t row = 0; row < rows; row++) {
            double *sums = out[i][row];
            for (int64_t column = 0; column < columns; column++)
                sums[column] = inner > 0 ? left[row][0] * right[0][column] : 0.0;
            for (int64_t k = 1; k < inner; k++)
                for (int64_t column = 0; column < columns; column++)
                    sums[column] += left[row][k] * right[k][column];
        }
    }
}

static void swap_rows(int64_t n, double *a, double *b)
{
    for (int64_t i = 0; i < n; i++) {
        const double kept = a[i];
        a[i] = b[i];
        b[i] = kept;
    }
}

/* Replace right sides by solutions, and write determinants; solutions of singular systems are not
   finite. */
EXPORT void solve_systems(
    int64_t n, int64_t size, int64_t columns, double matrices[n][size][size],
    double sides[n][size][columns], double determinants[n])
{
    for (int64_t i = 0; i < n; i++) {
        double(*a)[size] = matrices[i];
        double(*b)[columns] = sides[i];
        double determinant = 1.0;
        for (int64_t k = 0; k < size; k++) {
            int64_t pivot = k;
            for (int64_t row = k + 1; row < size; row++)
                if (fabs(a[row][k]) > fabs(a[pivot][k]))
                    pivot = row;
            if (pivot != k) {
                swap_rows(size, a[k], a[pivot]);
                swap_rows(columns, b[k], b[pivot]);
                determinant = -determinant;
            }
            determinant *= a[k][k];
            for (int64_t row = k + 1; row < size && a[k][k] != 0.0; row++) {
                const double share = a[row][k] / a[k][k];
                for (int64_t column = k + 1; column < size; column++)
                    a[row][column] -= share * a[k][column];
                for (int64_t column = 0; column < columns; column++)
                    b[row][column] -= share * b[k][column];
            }
        }
        determinants[i] = determinant;
        for (int64_t row = size - 1; row >= 0; row--)
            for (int64_t column = 0; column < columns; column++) {
                double sum = b[row][column];
                for (int64_t k = row + 1; k < size; k++)
                    sum -= a[row][k] * b[k][column];
                b[row][column] = sum / a[row][row];
            }
    }
}

/* Rotate two columns of a matrix by the angle with this cosine and sine. */
static void rotate(
    int64_t rows, int64_t columns, double matrix[rows][columns], int64_t p, int64_t q,
    double cosine, double sine)
{
    for (int64_t row = 0; row < rows; row++) {
        const double x = matrix[row][p], y = matrix[row][q];
        matrix[row][p] = cosine * x - sine * y;
        matrix[row][q] = sine * x + cosine * y;
    }
}

/* Tangent of the rotation that makes two columns orthogonal, from their squares and product. */
static double rotation_tangent(double p_square, double q_square, double product)
{
    const double cotangent = (q_square - p_square) / (2.0 * product);
    const double size = 1.0 / (fabs(cotangent) + sqrt(1.0 + cotangent * cotangent));
    return cotangent < 0.0 ? -size : size;
}

/* Rotate the columns of matrices until they are orthogonal; write the rotations, whose columns are
   the right singular vectors. The lengths of the columns are the singular values. */
EXPORT void orthogonalize_columns(
    int64_t n, int64_t rows, int64_t columns, double matrices[n][rows][columns],
    double rotations[n][columns][columns])
{
    for (int64_t i = 0; i < n; i++) {
        double(*a)[columns] = matrices[i];
        for (int64_t row = 0; row < columns; row++)
            for (int64_t column = 0; column < columns; column++)
                rotations[i][row][column] = row == column ? 1.0 : 0.0;
        bool is_done = false;
        for (int round = 0; round < MOST_ROUNDS && !is_done; round++) {
            is_done = true;
            for (int64_t p = 0; p < columns; p++)
                for (int64_t q = p + 1; q < columns; q++) {
                    double p_square = 0.0, q_square = 0.0, product = 0.0;
                    for (int64_t row = 0; row < rows; row++) {
                        p_square += a[row][p] * a[row][p];
                        q_square += a[row][q] * a[row][q];
                        product += a[row][p] * a[row][q];
                    }
                    if (!(fabs(product) > ORTHOGONAL * sqrt(p_square) * sqrt(q_square)))
                        continue;
                    is_done = false;
                    const double tangent = rotation_tangent(p_square, q_square, product);
                    const double cosine = 1.0 / sqrt(1.0 + tangent * tangent);
                    rotate(rows, columns, a, p, q, cosine, cosine * tangent);
                    rotate(columns, columns, rotations[i], p, q, cosine, cosine * tangent);
                }
        }
    }
}

/* Diagonalize symmetric matrices by rotations of rows and columns; write the rotations, whose
   columns are the eigenvectors. */
EXPORT void diagonalize(
    int64_t n, int64_t size, double matrices[n][size][size], double rotations[n][size][size])
{
    for (int64_t i = 0; i < n; i++) {
        double(*a)[size] = matrices[i];
        for (int64_t row = 0; row < size; row++)
            for (int64_t column = 0; column < size; column++)
                rotations[i][row][column] = row == column ? 1.0 : 0.0;
        double total = 0.0;
        for (int64_t row = 0; row < size; row++)
            for (int64_t column = 0; column < size; column++)
                total += fabs(a[row][column]);
        bool is_done = false;
        for (int round = 0; round < MOST_ROUNDS && !is_done; round++) {
            is_done = true;
            for (int64_t p = 0; p < size; p++)
                for (int64_t q = p + 1; q < size; q++) {
                    if (!(fabs(a[p][q]) > 0x1p-60 * total))
                        continue;
                    is_done = false;
                    const double tangent = rotation_tangent(a[p][p], a[q][q], a[p][q]);
                    const double cosine = 1.0 / sqrt(1.0 + tangent * tangent);
                    const double sine = cosine * tangent;
                    rotate(size, size, a, p, q, cosine, sine);
                    for (int64_t column = 0; column < size; column++) {
                        const double x = a[p][column], y = a[q][column];
                        a[p][column] = cosine * x - sine * y;
                        a[q][column] = sine * x + cosine * y;
                    }
                    a[p][q] = a[q][p] = 0.0;
                    rotate(size, size, rotations[i], p, q, cosine, sine);
                }
        }
    }
}
