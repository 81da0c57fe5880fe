/* The elementary functions of `elementary.h` over arrays.

   Called from texbake/core/portable_math.py. */

#include "elementary.h"

#include "core.h"

#define OVER_ARRAY(name)                                                                          \
    void array_##name(int64_t n, const double x[n], double out[n])                                \
    {                                                                                             \
        for (int64_t i = 0; i < n; i++)                                                           \
            out[i] = portable_##name(x[i]);                                                       \
    }
#define OVER_PAIRS(name)                                                                          \
    void array_##name(int64_t n, const double x[n], const double y[n], double out[n])             \
    {                                                                                             \
        for (int64_t i = 0; i < n; i++)                                                           \
            out[i] = portable_##name(x[i], y[i]);                                                 \
    }

OVER_ARRAY(sin)
OVER_ARRAY(cos)
OVER_ARRAY(tan)
OVER_ARRAY(asin)
OVER_ARRAY(acos)
OVER_ARRAY(atan)
OVER_ARRAY(exp)
OVER_ARRAY(log)
OVER_ARRAY(log2)
OVER_ARRAY(log10)
OVER_PAIRS(atan2)
OVER_PAIRS(hypot)
OVER_PAIRS(power)

void array_float_power(int64_t n, const float x[n], const float y[n], float out[n])
{
    for (int64_t i = 0; i < n; i++)
        out[i] = (float)short_power(x[i], y[i]);
}
