/* The elementary functions of `elementary.h` over arrays.

   Called from texbake/core/portable_math.py. */

#include "elementary.h"

#include "core.h"

#define OVER_ARRAY(name, function)                                                                \
    void name(int64_t n, const double x[n], double out[n])                                        \
    {                                                                                             \
        for (int64_t i = 0; i < n; i++)                                                           \
            out[i] = function(x[i]);                                                              \
    }
#define OVER_PAIRS(name, function)                                                                \
    void name(int64_t n, const double x[n], const double y[n], double out[n])                     \
    {                                                                                             \
        for (int64_t i = 0; i < n; i++)                                                           \
            out[i] = function(x[i], y[i]);                                                        \
    }

OVER_ARRAY(array_sin, portable_sin)
OVER_ARRAY(array_cos, portable_cos)
OVER_ARRAY(array_tan, portable_tan)
OVER_ARRAY(array_asin, portable_asin)
OVER_ARRAY(array_acos, portable_acos)
OVER_ARRAY(array_atan, portable_atan)
OVER_ARRAY(array_exp, portable_exp)
OVER_ARRAY(array_log, portable_log)
OVER_ARRAY(array_log2, portable_log2)
OVER_ARRAY(array_log10, portable_log10)
OVER_PAIRS(array_atan2, portable_atan2)
OVER_PAIRS(array_hypot, portable_hypot)
OVER_PAIRS(array_power, portable_power)

void array_float_power(int64_t n, const float x[n], const float y[n], float out[n])
{
    for (int64_t i = 0; i < n; i++)
        out[i] = (float)short_power(x[i], y[i]);
}
