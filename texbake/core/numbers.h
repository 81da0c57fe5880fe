/* Arithmetic with the rules of Python, where those of C differ. */

#pragma once

#include <math.h>
#include <stdint.h>

/* The first argument where they are equal or the second is NaN, as with Python's min and max. */
static inline double min_f64(double a, double b) { return b < a ? b : a; }
static inline double max_f64(double a, double b) { return b > a ? b : a; }
static inline float min_f32(float a, float b) { return b < a ? b : a; }
static inline float max_f32(float a, float b) { return b > a ? b : a; }
static inline int64_t min_i64(int64_t a, int64_t b) { return b < a ? b : a; }
static inline int64_t max_i64(int64_t a, int64_t b) { return b > a ? b : a; }

static inline double clamp_f64(double x, double low, double high)
{
    return min_f64(max_f64(x, low), high);
}

static inline int64_t clamp_i64(int64_t x, int64_t low, int64_t high)
{
    return min_i64(max_i64(x, low), high);
}

/* Quotient rounded down, and the remainder with the sign of b; b is not 0. */
static inline int64_t floor_div(int64_t a, int64_t b)
{
    return a / b - (a % b != 0 && (a % b < 0) != (b < 0));
}

static inline int64_t floor_mod(int64_t a, int64_t b)
{
    const int64_t remainder = a % b;
    return remainder != 0 && (remainder < 0) != (b < 0) ? remainder + b : remainder;
}
