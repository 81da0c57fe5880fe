/* Integer codes of values, with exact rounding.

   A code is floor(x + 1/2) of the exact x, computed in double, where the product of a float and a
   16-bit factor is exact.

   Called from texbake/texture/encoding.py. */

#include <math.h>

#include "core.h"
#include "numbers.h"

/* Codes `value * factor + offset`, rounded and at most `top`; |value| <= noise counts as 0, and NaN
   becomes 0. */
void quantize(
    int64_t n, int64_t n_channels,
    const float values[n][n_channels], const double factors[n_channels],
    const double offsets[n_channels], double noise, double top, uint16_t codes[n][n_channels],
    int64_t start, int64_t stop)
{
    for (int64_t i = start; i < stop; i++)
        for (int64_t channel = 0; channel < n_channels; channel++) {
            double value = values[i][channel];
            if (fabs(value) <= noise)
                value = 0.0;
            const double code = value * factors[channel] + offsets[channel] + 0.5;
            codes[i][channel] = code > 0.0 ? (uint16_t)(int32_t)min_f64(code, top) : 0;
        }
}
