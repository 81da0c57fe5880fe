/* Discrete Fourier transforms of rows of complex numbers, of any length.

   Based on: Cooley, Tukey, "An Algorithm for the Machine Calculation of Complex Fourier Series",
   Mathematics of Computation 19, 1965 (powers of two); Bluestein, "A Linear Filtering Approach to the
   Computation of Discrete Fourier Transform", IEEE Transactions on Audio and Electroacoustics 18(4),
   1970 (other lengths, as a convolution).

   Called from texbake/texture/heights_and_normals.py. */

#include "arena.h"
#include "core.h"
#include "elementary.h"
#include "numbers.h"

/* Constants for rows of one length. `cosines` and `sines` cover the first half turn, with `size`
   steps per turn. For a length that is not a power of two, chirps are exp(i pi k k / length), and
   `filter` is their transform. */
struct fourier_plan {
    int64_t length, size;
    double *cosines, *sines, *chirp_cosines, *chirp_sines, *filter_real, *filter_imaginary;
};

/* Transform `size` numbers in place, with negative exponents. */
static void transform_power_of_two(const struct fourier_plan *plan, double *real, double *imaginary)
{
    const int64_t size = plan->size;
    for (int64_t i = 1, j = 0; i < size; i++) {
        int64_t bit = size >> 1;
        for (; j & bit; bit >>= 1)
            j ^= bit;
        j ^= bit;
        if (i < j) {
            const double kept_real = real[i], kept_imaginary = imaginary[i];
            real[i] = real[j];
            imaginary[i] = imaginary[j];
            real[j] = kept_real;
            imaginary[j] = kept_imaginary;
        }
    }
    for (int64_t half = 1; half < size; half *= 2) {
        const int64_t step = size / (2 * half);
        for (int64_t first = 0; first < size; first += 2 * half)
            for (int64_t k = 0; k < half; k++) {
                const double c = plan->cosines[k * step], s = -plan->sines[k * step];
                double *a = real + first + k, *b = imaginary + first + k;
                const double x = a[half] * c - b[half] * s, y = a[half] * s + b[half] * c;
                a[half] = a[0] - x;
                b[half] = b[0] - y;
                a[0] += x;
                b[0] += y;
            }
    }
}

/* Write the chirps and the transform of their filter. */
static void plan_chirps(struct fourier_plan *plan)
{
    const int64_t n = plan->length;
    for (int64_t i = 0; i < plan->size; i++)
        plan->filter_real[i] = plan->filter_imaginary[i] = 0.0;
    for (int64_t k = 0; k < n; k++) {
        const double angle = PORTABLE_PI.high * (double)(k * k % (2 * n)) / (double)n;
        const int64_t mirrored = k == 0 ? 0 : plan->size - k;
        plan->chirp_cosines[k] = portable_cos(angle);
        plan->chirp_sines[k] = portable_sin(angle);
        plan->filter_real[k] = plan->filter_real[mirrored] = plan->chirp_cosines[k];
        plan->filter_imaginary[k] = plan->filter_imaginary[mirrored] = plan->chirp_sines[k];
    }
    transform_power_of_two(plan, plan->filter_real, plan->filter_imaginary);
}

/* Transform one row of any length in place, with scratch memory for `size` numbers. */
static void transform_by_chirps(
    const struct fourier_plan *plan, double *real, double *imaginary, double *a, double *b)
{
    const int64_t n = plan->length;
    for (int64_t k = 0; k < plan->size; k++) {
        const double c = k < n ? plan->chirp_cosines[k] : 0.0, s = k < n ? plan->chirp_sines[k] : 0.0;
        a[k] = k < n ? real[k] * c + imaginary[k] * s : 0.0;
        b[k] = k < n ? imaginary[k] * c - real[k] * s : 0.0;
    }
    transform_power_of_two(plan, a, b);
    for (int64_t k = 0; k < plan->size; k++) { /* conjugated, so that the next one is the inverse */
        const double x = a[k] * plan->filter_real[k] - b[k] * plan->filter_imaginary[k];
        b[k] = -(a[k] * plan->filter_imaginary[k] + b[k] * plan->filter_real[k]);
        a[k] = x;
    }
    transform_power_of_two(plan, a, b);
    for (int64_t k = 0; k < n; k++) {
        const double x = a[k] / (double)plan->size, y = -b[k] / (double)plan->size;
        real[k] = x * plan->chirp_cosines[k] + y * plan->chirp_sines[k];
        imaginary[k] = y * plan->chirp_cosines[k] - x * plan->chirp_sines[k];
    }
}

/* Transform rows in place. The inverse swaps the real and imaginary parts, and is not divided by
   the length. */
EXPORT int64_t fourier_transform_rows(
    int64_t n, int64_t length, double real[n][length], double imaginary[n][length], bool inverse,
    int64_t start, int64_t stop)
{
    struct fourier_plan plan = {.length = length, .size = 1};
    const bool is_power = (length & (length - 1)) == 0;
    while (plan.size < (is_power ? length : 2 * length - 1))
        plan.size *= 2;
    OPEN_ARENA(arena);
    plan.cosines = TAKE(arena, double, plan.size);
    plan.sines = TAKE(arena, double, plan.size);
    for (int64_t k = 0; 2 * k < plan.size; k++) {
        const double angle = 2.0 * PORTABLE_PI.high * (double)k / (double)plan.size;
        plan.cosines[k] = portable_cos(angle);
        plan.sines[k] = portable_sin(angle);
    }
    double *a = NULL, *b = NULL;
    if (!is_power) {
        plan.chirp_cosines = TAKE(arena, double, length);
        plan.chirp_sines = TAKE(arena, double, length);
        plan.filter_real = TAKE(arena, double, plan.size);
        plan.filter_imaginary = TAKE(arena, double, plan.size);
        plan_chirps(&plan);
        a = TAKE(arena, double, plan.size);
        b = TAKE(arena, double, plan.size);
    }
    for (int64_t row = start; row < stop; row++) {
        double *x = inverse ? imaginary[row] : real[row], *y = inverse ? real[row] : imaginary[row];
        if (is_power)
            transform_power_of_two(&plan, x, y);
        else
            transform_by_chirps(&plan, x, y, a, b);
    }
    close_arena(arena);
    return 0;
}
