/* The elementary functions of `elementary.h` over arrays.

   Called from texbake/core/portable_math.py. */

#include "elementary.h"

#include "core.h"

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
