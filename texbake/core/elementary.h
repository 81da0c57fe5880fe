/* Elementary functions that give the same bits on every processor.

   The results of the C library's functions depend on the library and the processor: glibc alone has
   two versions of most of them, with and without fused multiply-adds. The functions here use only
   float64 sums, products, quotients and square roots, which IEEE 754 rounds the same everywhere.
   Where float64 is not precise enough, a value is the sum of two numbers. Errors are below 0.7
   units in the last place.

   Based on: Dekker, "A Floating-Point Technique for Extending the Available Precision", Numerische
   Mathematik 18, 1971 (sums, products and quotients of two numbers); Cody, Waite, "Software Manual
   for the Elementary Functions", 1980 (reduction of arguments); Payne, Hanek, "Radian Reduction for
   Trigonometric Functions", SIGNUM Newsletter 18, 1983 (reduction of large arguments); Muller,
   "Elementary Functions", 3rd edition, 2016. The polynomials are Taylor's. */

#pragma once

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

/* The number high + low, where low is at most half a unit in the last place of high. */
struct double_double {
    double high, low;
};

static const struct double_double PORTABLE_PI = {0x1.921fb54442d18p+1, 0x1.1a62633145c07p-53};

/* high + low, where low is smaller. */
static inline struct double_double renormalized(double high, double low)
{
    const double sum = high + low;
    return (struct double_double){sum, low - (sum - high)};
}

static inline struct double_double exact_sum(double a, double b)
{
    const double sum = a + b, of_b = sum - a;
    return (struct double_double){sum, (a - (sum - of_b)) + (b - of_b)};
}

/* Exact for factors below 2^996. */
static inline struct double_double exact_product(double a, double b)
{
    const double split_a = 134217729.0 * a, split_b = 134217729.0 * b; /* 2^27 + 1 */
    const double a_high = split_a - (split_a - a), a_low = a - a_high;
    const double b_high = split_b - (split_b - b), b_low = b - b_high;
    const double product = a * b;
    return (struct double_double){
        product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low};
}

static inline struct double_double dd_sum(struct double_double a, struct double_double b)
{
    const struct double_double sum = exact_sum(a.high, b.high);
    return renormalized(sum.high, sum.low + (a.low + b.low));
}

static inline struct double_double dd_product(struct double_double a, struct double_double b)
{
    const struct double_double product = exact_product(a.high, b.high);
    return renormalized(product.high, product.low + (a.high * b.low + a.low * b.high));
}

static inline struct double_double dd_quotient(struct double_double a, struct double_double b)
{
    const double quotient = a.high / b.high;
    const struct double_double back = exact_product(quotient, b.high);
    const double rest = ((a.high - back.high) - back.low) + (a.low - quotient * b.low);
    return renormalized(quotient, rest / b.high);
}

static inline struct double_double dd_root(struct double_double a)
{
    const double root = sqrt(a.high);
    if (!(root > 0.0))
        return (struct double_double){root, 0.0};
    const struct double_double square = exact_product(root, root);
    return renormalized(root, (((a.high - square.high) - square.low) + a.low) / (2.0 * root));
}

static inline uint64_t bits_of(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static inline double from_bits(uint64_t bits)
{
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* 2^exponent, for exponents of normal numbers. */
static inline double power_of_two(int64_t exponent)
{
    return from_bits((uint64_t)(exponent + 1023) << 52);
}

/* ---------------------------------------------------------------- logarithms, exponentials */

/* Logarithm of a positive finite number, with a relative error of 2^-70: that of its power of two,
   plus that of the rest m between sqrt(1/2) and sqrt(2), 2 artanh((m - 1) / (m + 1)). */
static inline struct double_double dd_log(double x, int64_t *exponent)
{
    int64_t power = 0;
    if (x < 0x1p-1022) {
        x *= 0x1p54;
        power = -54;
    }
    const uint64_t bits = bits_of(x);
    double rest = from_bits((bits & 0x000fffffffffffffu) | 0x3ff0000000000000u);
    power += (int64_t)(bits >> 52) - 1023;
    if (rest > 1.4142135623730951) {
        rest *= 0.5;
        power += 1;
    }
    *exponent = power;
    const struct double_double above = {rest - 1.0, 0.0}, sum = exact_sum(rest, 1.0);
    const struct double_double s = dd_quotient(above, sum), z = dd_product(s, s);
    const double t = z.high;
    const double tail =
        t * (1.0 / 7 + t * (1.0 / 9 + t * (1.0 / 11 + t * (1.0 / 13 + t * (1.0 / 15 + t *
        (1.0 / 17 + t * (1.0 / 19 + t * (1.0 / 21 + t * (1.0 / 23)))))))));
    const struct double_double third = {0x1.5555555555555p-2, 0x1.5555555555555p-56};
    const struct double_double fifth = {0x1.999999999999ap-3, -0x1.999999999999ap-57};
    struct double_double series = dd_sum(fifth, (struct double_double){tail, 0.0});
    series = dd_sum(third, dd_product(z, series));
    series = dd_product(s, dd_product(z, series));
    series = dd_sum(s, series);
    return (struct double_double){2.0 * series.high, 2.0 * series.low};
}

static inline struct double_double dd_natural_log(double x)
{
    int64_t exponent;
    const struct double_double rest = dd_log(x, &exponent);
    const double power = (double)exponent; /* the product with the first part of ln 2 is exact */
    const struct double_double whole =
        renormalized(power * 0x1.62e42fef00000p-1, power * 0x1.473de6af278edp-34);
    return dd_sum(whole, rest);
}

/* The logarithm of numbers that are not positive and finite, to any base. */
static inline double log_limit(double x)
{
    return x == 0.0 ? -INFINITY : x > 0.0 ? x : x != x ? x : NAN;
}

static inline double portable_log(double x)
{
    if (!(x > 0.0 && x < INFINITY))
        return log_limit(x);
    return dd_natural_log(x).high;
}

static inline double portable_log2(double x)
{
    if (!(x > 0.0 && x < INFINITY))
        return log_limit(x);
    int64_t exponent;
    const struct double_double rest = dd_log(x, &exponent);
    const struct double_double per_unit = {0x1.71547652b82fep+0, 0x1.777d0ffda0d24p-56};
    return dd_sum((struct double_double){(double)exponent, 0.0}, dd_product(rest, per_unit)).high;
}

static inline double portable_log10(double x)
{
    if (!(x > 0.0 && x < INFINITY))
        return log_limit(x);
    int64_t exponent;
    const struct double_double rest = dd_log(x, &exponent);
    const struct double_double per_unit = {0x1.bcb7b1526e50ep-2, 0x1.95355baaafad3p-57};
    const struct double_double per_power = {0x1.34413509f79ffp-2, -0x1.9dc1da994fd21p-59};
    const struct double_double power = {(double)exponent, 0.0};
    return dd_sum(dd_product(power, per_power), dd_product(rest, per_unit)).high;
}

/* e to the power of high + low, from e^(x - k ln 2) for the nearest k. */
static inline double exp_of_sum(double high, double low)
{
    if (high > 710.0)
        return INFINITY;
    if (high < -746.0)
        return 0.0;
    const double k = floor(high * 0x1.71547652b82fep+0 + 0.5);
    const struct double_double r =
        exact_sum(high - k * 0x1.62e42fef00000p-1, low - k * 0x1.473de6af278edp-34);
    const double x = r.high;
    const double tail =
        x * x * x * (1.0 / 6 + x * (1.0 / 24 + x * (1.0 / 120 + x * (1.0 / 720 + x * (1.0 / 5040 +
        x * (1.0 / 40320 + x * (1.0 / 362880 + x * (1.0 / 3628800 + x * (1.0 / 39916800 + x *
        (1.0 / 479001600 + x * (1.0 / 6227020800.0)))))))))));
    const struct double_double square = exact_product(x, x);
    struct double_double sum = exact_sum(1.0, x);
    const struct double_double half = exact_sum(sum.high, 0.5 * square.high);
    sum.low += half.low + 0.5 * square.low + (r.low + r.low * x) + tail;
    const double result = half.high + sum.low;
    const int64_t power = (int64_t)k;
    if (power >= 1024)
        return result * 0x1p1023 * power_of_two(power - 1023);
    if (power >= -1021)
        return result * power_of_two(power);
    return result * power_of_two(power + 1000) * 0x1p-1000;
}

static inline double portable_exp(double x)
{
    return x != x ? x : exp_of_sum(x, 0.0);
}

/* Whether a finite number is whole, and whether a whole number is odd. */
static inline bool is_whole(double x) { return floor(x) == x; }
static inline bool is_odd(double x) { return fabs(x) < 0x1p53 && fmod(x, 2.0) != 0.0; }

/* x to the power of y, with the special cases of C. */
static inline double portable_power(double x, double y)
{
    if (y == 0.0 || x == 1.0)
        return 1.0;
    if (x != x || y != y)
        return x + y;
    const double size = fabs(x);
    if (fabs(y) == INFINITY)
        return size == 1.0 ? 1.0 : (size > 1.0) == (y > 0.0) ? INFINITY : 0.0;
    const double sign = bits_of(x) >> 63 && is_whole(y) && is_odd(y) ? -1.0 : 1.0;
    if (size == 0.0 || size == INFINITY)
        return sign * ((size == 0.0) == (y < 0.0) ? INFINITY : 0.0);
    if (x < 0.0 && !is_whole(y))
        return NAN;
    const struct double_double log = dd_natural_log(size);
    if (fabs(y) > 0x1p70) /* the result is 0, 1 or infinite, and the product would not be exact */
        return sign * exp_of_sum(log.high * y, 0.0);
    const struct double_double product = exact_product(log.high, y);
    const struct double_double power = renormalized(product.high, product.low + log.low * y);
    return sign * exp_of_sum(power.high, power.low);
}

/* Binary logarithm of a positive normal number, with an error of 2^-48 of itself or of 1. */
static inline double short_log2(double x)
{
    const uint64_t bits = bits_of(x);
    double rest = from_bits((bits & 0x000fffffffffffffu) | 0x3ff0000000000000u);
    double exponent = (double)((int64_t)(bits >> 52) - 1023);
    if (rest > 1.4142135623730951) {
        rest *= 0.5;
        exponent += 1.0;
    }
    const double s = (rest - 1.0) / (rest + 1.0), z = s * s;
    const double series =
        1.0 + z * (1.0 / 3 + z * (1.0 / 5 + z * (1.0 / 7 + z * (1.0 / 9 + z * (1.0 / 11 + z *
        (1.0 / 13 + z * (1.0 / 15)))))));
    return exponent + 2.0 * 0x1.71547652b82fep+0 * s * series;
}

/* x to the power of y for results that become float32: relative error 2^-38, four times as fast. */
static inline double short_power(double x, double y)
{
    if (!(x >= 0x1p-1022 && x < INFINITY))
        return portable_power(x, y);
    const double power = y * short_log2(x);
    if (!(fabs(power) < 1000.0))
        return portable_power(x, y);
    const double whole = floor(power + 0.5), t = (power - whole) * 0x1.62e42fefa39efp-1;
    const double part =
        1.0 + t * (1.0 + t * (1.0 / 2 + t * (1.0 / 6 + t * (1.0 / 24 + t * (1.0 / 120 + t *
        (1.0 / 720 + t * (1.0 / 5040 + t * (1.0 / 40320 + t * (1.0 / 362880)))))))));
    return part * power_of_two((int64_t)whole);
}

/* ---------------------------------------------------------------- trigonometric functions */

/* 2 / pi in binary, from the first bit after the point. */
static const uint64_t TWO_OVER_PI[20] = {
    0xa2f9836e4e441529u, 0xfc2757d1f534ddc0u, 0xdb6295993c439041u, 0xfe5163abdebbc561u,
    0xb7246e3a424dd2e0u, 0x06492eea09d1921cu, 0xfe1deb1cb129a73eu, 0xe88235f52ebb4484u,
    0xe99c7026b45f7e41u, 0x3991d639835339f4u, 0x9c845f8bbdf9283bu, 0x1ff897ffde05980fu,
    0xef2f118b5a0a6d1fu, 0x6d367ecf27cb09b7u, 0x4f463f669e5fea2du, 0x7527bac7ebe5f17bu,
    0x3d0739f78a5292eau, 0x6bfb5fb11f8d5d08u, 0x56033046fc7b6babu, 0xf0cfbc209af4361du,
};

/* 64 bits of 2 / pi, starting at a bit; bits before the point are 0. */
static inline uint64_t bits_from(int64_t bit)
{
    if (bit <= -64)
        return 0;
    if (bit < 0)
        return TWO_OVER_PI[0] >> -bit;
    const int64_t word = bit / 64, shift = bit % 64;
    const uint64_t first = TWO_OVER_PI[word] << shift;
    return shift ? first | TWO_OVER_PI[word + 1] >> (64 - shift) : first;
}

/* As below, for large angles: x = m 2^e. Of the product with 2 / pi, only the bits from 2^1 to
   2^-190 matter. */
static inline struct double_double reduce_large(double x, int64_t *quarter)
{
    const uint64_t bits = bits_of(x);
    const uint64_t m = (bits & 0x000fffffffffffffu) | 0x0010000000000000u;
    const int64_t e = (int64_t)(bits >> 52 & 0x7ff) - 1075;
    uint64_t words[4], carry = 0; /* the product, modulo 4, with 62 bits of words[0] after the point */
    for (int i = 3; i >= 0; i--) {
        const unsigned __int128 product =
            (unsigned __int128)m * bits_from(e - 2 + 64 * i) + carry;
        words[i] = (uint64_t)product;
        carry = (uint64_t)(product >> 64);
    }
    int64_t n = (int64_t)(words[0] >> 62);
    const bool above = words[0] >> 61 & 1; /* an eighth turn or more: count from the next quarter */
    uint64_t part[3] = {
        words[0] << 2 | words[1] >> 62, words[1] << 2 | words[2] >> 62, words[2] << 2 | words[3] >> 62};
    if (above) {
        n += 1;
        for (int i = 0; i < 3; i++)
            part[i] = ~part[i];
    }
    /* Leading zeros are shifted out, so that the two numbers hold 106 significant bits. */
    int64_t shift = 0;
    while (shift < 128 && !(part[0] >> 63)) {
        part[0] = part[0] << 1 | part[1] >> 63;
        part[1] = part[1] << 1 | part[2] >> 63;
        part[2] <<= 1;
        shift++;
    }
    const double scale = power_of_two(-shift) * (above ? -1.0 : 1.0);
    const struct double_double turns = renormalized(
        (double)(part[0] >> 11) * 0x1p-53 * scale,
        (double)((part[0] & 0x7ff) << 42 | part[1] >> 22) * 0x1p-106 * scale);
    const struct double_double half_pi = {0x1.921fb54442d18p+0, 0x1.1a62633145c07p-54};
    struct double_double rest = dd_product(turns, half_pi);
    if (bits >> 63) {
        rest = (struct double_double){-rest.high, -rest.low};
        n = -n;
    }
    *quarter = n & 3;
    return rest;
}

/* An angle minus n pi / 2. Three parts of pi / 2 of 33 bits, whose products with n are exact, and the
   rest. */
static inline struct double_double less_quarters(double x, double n)
{
    const struct double_double first =
        exact_sum(x - n * 0x1.921fb54400000p+0, -(n * 0x1.0b4611a600000p-34));
    const struct double_double second = exact_sum(first.high, -(n * 0x1.3198a2e000000p-69));
    return renormalized(
        second.high, second.low + (first.low - n * 0x1.b839a252049c1p-104));
}

/* The angle minus the nearest multiple of pi / 2, and that multiple modulo 4. */
static inline struct double_double reduce_angle(double x, int64_t *quarter)
{
    if (fabs(x) >= 0x1p19)
        return reduce_large(x, quarter);
    const double n = floor(x * 0x1.45f306dc9c883p-1 + 0.5);
    *quarter = (int64_t)n & 3;
    return n == 0.0 ? (struct double_double){x, 0.0} : less_quarters(x, n);
}

/* Sine and cosine of an angle of at most pi / 4. */
static inline struct double_double dd_sin(struct double_double angle)
{
    const double x = angle.high, z = x * x;
    const double series =
        z * (1.0 / 120 - z * (1.0 / 5040 - z * (1.0 / 362880 - z * (1.0 / 39916800 - z *
        (1.0 / 6227020800.0 - z * (1.0 / 1307674368000.0 - z * (1.0 / 355687428096000.0)))))));
    const double tail = x * z * (series - 1.0 / 6);
    return renormalized(x, tail + angle.low * (1.0 - 0.5 * z));
}

static inline struct double_double dd_cos(struct double_double angle)
{
    const double x = angle.high;
    const struct double_double square = exact_product(x, x);
    const double z = square.high;
    const double tail =
        z * z * (1.0 / 24 - z * (1.0 / 720 - z * (1.0 / 40320 - z * (1.0 / 3628800 - z *
        (1.0 / 479001600 - z * (1.0 / 87178291200.0 - z * (1.0 / 20922789888000.0)))))));
    const struct double_double sum = exact_sum(1.0, -0.5 * z);
    return renormalized(sum.high, sum.low + (tail - 0.5 * square.low - x * angle.low));
}

static inline double portable_sin(double x)
{
    if (!(fabs(x) < INFINITY))
        return NAN;
    int64_t quarter;
    const struct double_double angle = reduce_angle(x, &quarter);
    if (x == 0.0)
        return x;
    const double value = quarter & 1 ? dd_cos(angle).high : dd_sin(angle).high;
    return quarter & 2 ? -value : value;
}

static inline double portable_cos(double x)
{
    if (!(fabs(x) < INFINITY))
        return NAN;
    int64_t quarter;
    const struct double_double angle = reduce_angle(x, &quarter);
    const double value = quarter & 1 ? dd_sin(angle).high : dd_cos(angle).high;
    return (quarter + 1) & 2 ? -value : value;
}

static inline double portable_tan(double x)
{
    if (!(fabs(x) < INFINITY))
        return NAN;
    if (x == 0.0)
        return x;
    int64_t quarter;
    const struct double_double angle = reduce_angle(x, &quarter);
    const struct double_double sin = dd_sin(angle), cos = dd_cos(angle);
    return quarter & 1 ? -dd_quotient(cos, sin).high : dd_quotient(sin, cos).high;
}

/* ---------------------------------------------------------------- inverse functions */

/* atan(k / 8) */
static const struct double_double ARCTANGENTS[9] = {
    {0.0, 0.0},
    {0x1.fd5ba9aac2f6ep-4, -0x1.cd37686760c17p-59},
    {0x1.f5b75f92c80ddp-3, 0x1.8ab6e3cf7afbdp-57},
    {0x1.6f61941e4def1p-2, -0x1.c63aae6f6e918p-56},
    {0x1.dac670561bb4fp-2, 0x1.a2b7f222f65e2p-56},
    {0x1.1e00babdefeb4p-1, -0x1.928df287a668fp-58},
    {0x1.4978fa3269ee1p-1, 0x1.2419a87f2a458p-56},
    {0x1.700a7c5784634p-1, -0x1.8c34d25aadef6p-56},
    {0x1.921fb54442d18p-1, 0x1.1a62633145c07p-55},
};

/* ARCTANGENTS[k], as a sum of which one term is not 0: loops with vector instructions cannot look it
   up. */
static inline struct double_double nearest_arctangent(int k)
{
    struct double_double sum = {0.0, 0.0};
#pragma GCC unroll 8
    for (int i = 1; i <= 8; i++) {
        const double share = k == i;
        sum.high += share * ARCTANGENTS[i].high;
        sum.low += share * ARCTANGENTS[i].low;
    }
    return sum;
}

/* Angle of the point (x, y) with 0 <= y <= x and x > 0, from that of the nearest slope k / 8. */
static inline struct double_double first_octant_angle(
    struct double_double y, struct double_double x)
{
    const int k = (int)(8.0 * (y.high / x.high) + 0.5);
    const double slope = k / 8.0;
    const struct double_double up = exact_product(x.high, slope);
    const struct double_double right = exact_product(y.high, slope);
    const struct double_double across =
        dd_sum(y, (struct double_double){-up.high, -(up.low + slope * x.low)});
    const struct double_double along =
        dd_sum(x, (struct double_double){right.high, right.low + slope * y.low});
    const struct double_double u = dd_quotient(across, along);
    const double z = u.high * u.high;
    const double tail =
        u.high * z * (-1.0 / 3 + z * (1.0 / 5 - z * (1.0 / 7 - z * (1.0 / 9 - z * (1.0 / 11 - z *
        (1.0 / 13 - z * (1.0 / 15)))))));
    const struct double_double start = nearest_arctangent(k);
    const struct double_double sum = exact_sum(start.high, u.high);
    return renormalized(sum.high, sum.low + (start.low + u.low + tail));
}

/* Angle of the point (x, y); the high parts have the signs of the numbers. Without branches, so that
   loops can use vector instructions. */
static inline double angle_of(struct double_double y, struct double_double x)
{
    const double across = copysign(1.0, x.high), up = copysign(1.0, y.high);
    const struct double_double width = {across * x.high, across * x.low};
    const struct double_double height = {up * y.high, up * y.low};
    const bool is_steep = height.high > width.high;
    const struct double_double rise = is_steep ? width : height;
    struct double_double run = is_steep ? height : width;
    run.high = run.high > 0.0 ? run.high : 1.0;
    const struct double_double angle = first_octant_angle(rise, run);
    /* From the nearest half axis, to its left or right. */
    const double turns = is_steep ? 0.5 : across < 0.0 ? 1.0 : 0.0;
    const double side = is_steep ? -across : across;
    const struct double_double axis = {turns * PORTABLE_PI.high, turns * PORTABLE_PI.low};
    return up * dd_sum(axis, (struct double_double){side * angle.high, side * angle.low}).high;
}

/* portable_atan2 for two numbers of similar size, without a branch. */
static inline double plain_atan2(double y, double x)
{
    return angle_of((struct double_double){y, 0.0}, (struct double_double){x, 0.0});
}

static inline double portable_atan2(double y, double x)
{
    if (x != x || y != y)
        return x + y;
    if (fabs(x) == INFINITY || fabs(y) == INFINITY) {
        x = copysign(fabs(x) == INFINITY ? 1.0 : 0.0, x);
        y = copysign(fabs(y) == INFINITY ? 1.0 : 0.0, y);
    }
    if (fabs(x) > 0x1p70 * fabs(y) && y != 0.0)
        return x > 0.0 ? y / x : copysign(PORTABLE_PI.high, y);
    if (fabs(y) > 0x1p70 * fabs(x))
        return copysign(0.5 * PORTABLE_PI.high, y);
    /* Scaled so that no product overflows or loses bits. */
    const double largest = fabs(x) > fabs(y) ? fabs(x) : fabs(y);
    if (largest > 0x1p500 || largest < 0x1p-500) {
        const double scale = largest > 1.0 ? 0x1p-600 : 0x1p600;
        x *= scale;
        y *= scale;
    }
    return plain_atan2(y, x);
}

/* portable_atan2(y, x), for loops with vector instructions: y is positive, and neither is above 2^500
   or above 2^70 times the other, but x may be 0. */
static inline double positive_atan2(double y, double x)
{
    const double scale = y < 0x1p-500 && fabs(x) < 0x1p-500 ? 0x1p600 : 1.0;
    return plain_atan2(scale * y, scale * x);
}

static inline double portable_atan(double x) { return portable_atan2(x, 1.0); }

/* sqrt(1 - x x) */
static inline struct double_double other_leg(double x)
{
    const struct double_double square = exact_product(x, x);
    const struct double_double rest = exact_sum(1.0, -square.high);
    return dd_root(renormalized(rest.high, rest.low - square.low));
}

static inline double portable_asin(double x)
{
    if (!(fabs(x) <= 1.0))
        return NAN;
    return fabs(x) < 0x1p-300 ? x : angle_of((struct double_double){x, 0.0}, other_leg(x));
}

static inline double portable_acos(double x)
{
    if (!(fabs(x) <= 1.0))
        return NAN;
    return angle_of(other_leg(x), (struct double_double){x, 0.0});
}

/* sqrt(x x + y y), without overflow of the squares. */
static inline double portable_hypot(double x, double y)
{
    x = fabs(x);
    y = fabs(y);
    if (x == INFINITY || y == INFINITY)
        return INFINITY;
    const double largest = x > y ? x : y;
    double scale = 1.0;
    if (largest > 0x1p500)
        scale = 0x1p-600;
    else if (largest < 0x1p-400)
        scale = 0x1p600;
    const struct double_double width = exact_product(scale * x, scale * x);
    const struct double_double height = exact_product(scale * y, scale * y);
    return dd_root(dd_sum(width, height)).high / scale;
}

/* ---------------------------------------------------------------- without special cases */

/* The same bits as above without a branch, so that loops use vector instructions: for two numbers of
   similar size, and for angles of at most a turn. */

static inline bool are_plain(double x, double y)
{
    const double a = fabs(x), b = fabs(y);
    return (a > 0x1p-200) & (b > 0x1p-200) & (a < 0x1p200) & (b < 0x1p200) & (a < 0x1p60 * b)
        & (b < 0x1p60 * a);
}

static inline double plain_hypot(double x, double y)
{
    const struct double_double square = dd_sum(exact_product(x, x), exact_product(y, y));
    const double root = sqrt(square.high);
    const struct double_double back = exact_product(root, root);
    return root + (((square.high - back.high) - back.low) + square.low) / (2.0 * root);
}

struct direction {
    double cosine, sine;
};

static inline struct direction plain_direction(double x)
{
    const double n = floor(x * 0x1.45f306dc9c883p-1 + 0.5);
    const struct double_double angle = less_quarters(x, n);
    const double cosine = dd_cos(angle).high, sine = dd_sin(angle).high;
    const bool is_odd_quarter = (n == 1.0) | (n == -1.0), is_half = (n == 2.0) | (n == -2.0);
    const double along = is_odd_quarter ? sine : cosine, up = is_odd_quarter ? cosine : sine;
    return (struct direction){
        (is_half | (n == 1.0)) ? -along : along, (is_half | (n == -1.0)) ? -up : up};
}
