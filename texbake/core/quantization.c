/* Integer codes of values, with exact rounding.

   A code is floor(x + 1/2) of the exact x, computed in double, where the product of a float and a
   16-bit factor is exact.

   Called from texbake/texture/encoding.py. */

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "core.h"
#include "numbers.h"

/* Values that are coded together: whole texels of 1, 2, 3, 4, 6 or 8 channels, and few enough for vector
   instructions without a remainder. */
#define ROUND 24

/* How channels are coded, repeated over a round. */
struct coding {
    double factors[ROUND], offsets[ROUND], lows[ROUND], sizes[ROUND];
    double noise, top;
};

static struct coding repeat_coding(
    int64_t n_channels, const double factors[], const double offsets[], const double *lows,
    const double *sizes, double noise, double top)
{
    struct coding coding;
    for (int64_t i = 0; i < ROUND; i++) {
        const int64_t channel = i % n_channels;
        coding.factors[i] = factors[channel];
        coding.offsets[i] = offsets[channel];
        coding.lows[i] = lows ? lows[channel] : 0.0;
        coding.sizes[i] = sizes ? sizes[channel] : 1.0;
    }
    coding.noise = noise;
    coding.top = top;
    return coding;
}

/* Code of a value at a place in the round; a share of its bounds first becomes a float. */
static inline int32_t code_of(
    double value, int64_t place, const struct coding *coding, bool has_bounds)
{
    if (has_bounds)
        value = (float)((value - coding->lows[place]) / coding->sizes[place]);
    value = fabs(value) <= coding->noise ? 0.0 : value;
    const double code = value * coding->factors[place] + coding->offsets[place] + 0.5;
    /* NaN becomes 0, too. */
    return (int32_t)(code > 0.0 ? min_f64(code, coding->top) : 0.0);
}

/* Defines a function for codes of a type: codes `value * factor + offset`, rounded and at most `top`;
   |value| <= noise counts as 0, and NaN becomes 0. With lows and sizes, values are first taken
   relative to them. The number of channels divides ROUND. */
#define QUANTIZE(name, type)                                                                  \
    static inline void name##_values(                                                         \
        int64_t n, const float *restrict values, const struct coding *restrict coding,        \
        bool has_bounds, type *restrict codes)                                                \
    {                                                                                         \
        int64_t i = 0;                                                                        \
        for (; i + ROUND <= n; i += ROUND)                                                    \
            for (int64_t k = 0; k < ROUND; k++)                                               \
                codes[i + k] = (type)code_of(values[i + k], k, coding, has_bounds);           \
        for (int64_t k = 0; i + k < n; k++)                                                   \
            codes[i + k] = (type)code_of(values[i + k], k, coding, has_bounds);               \
    }                                                                                         \
                                                                                              \
    void name(                                                                                \
        int64_t n, int64_t n_channels, const float values[n][n_channels],                     \
        const double factors[n_channels], const double offsets[n_channels],                   \
        OPTIONAL const double lows[n_channels], OPTIONAL const double sizes[n_channels],      \
        type codes[n][n_channels], double noise, double top, int64_t start, int64_t stop)     \
    {                                                                                         \
        const struct coding coding =                                                          \
            repeat_coding(n_channels, factors, offsets, lows, sizes, noise, top);             \
        const int64_t n_values = (stop - start) * n_channels;                                 \
        if (lows)                                                                             \
            name##_values(n_values, values[start], &coding, true, codes[start]);              \
        else                                                                                  \
            name##_values(n_values, values[start], &coding, false, codes[start]);             \
    }

EXPORT void quantize_u8(
    int64_t n, int64_t n_channels, const float values[n][n_channels],
    const double factors[n_channels], const double offsets[n_channels],
    OPTIONAL const double lows[n_channels], OPTIONAL const double sizes[n_channels],
    uint8_t codes[n][n_channels], double noise, double top, int64_t start, int64_t stop);
EXPORT void quantize_u16(
    int64_t n, int64_t n_channels, const float values[n][n_channels],
    const double factors[n_channels], const double offsets[n_channels],
    OPTIONAL const double lows[n_channels], OPTIONAL const double sizes[n_channels],
    uint16_t codes[n][n_channels], double noise, double top, int64_t start, int64_t stop);

QUANTIZE(quantize_u8, uint8_t)
QUANTIZE(quantize_u16, uint16_t)

/* sRGB code of a linear value: the number of thresholds that it reaches. The upper half of the value's
   bits leaves few of them to search: `first_codes` has the code of the least value of each half. */
static inline int64_t srgb_code_of(
    float value, int64_t n_codes, const float thresholds[], const uint16_t first_codes[])
{
    if (!(value > 0.0f)) /* NaN too */
        return 0;
    if (value >= 1.0f)
        return n_codes;
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    int64_t least = first_codes[bits >> 16], most = first_codes[(bits >> 16) + 1];
    while (least < most) {
        const int64_t middle = (least + most) / 2;
        if (value >= thresholds[middle])
            least = middle + 1;
        else
            most = middle;
    }
    return least;
}

/* Defines a function for codes of a type: the first `n_colors` channels become sRGB, the others are
   rounded as they are. */
#define QUANTIZE_SRGB(name, code_t)                                                           \
    void name(                                                                                \
        int64_t n, int64_t n_channels, int64_t n_codes, const float values[n][n_channels],    \
        const float thresholds[n_codes], const uint16_t first_codes[16257],                  \
        code_t codes[n][n_channels], int64_t n_colors, int64_t start, int64_t stop)           \
    {                                                                                         \
        const double factor = (double)n_codes, offset = 0.0;                                  \
        const struct coding coding =                                                          \
            repeat_coding(1, &factor, &offset, NULL, NULL, 0.0, factor);                      \
        for (int64_t i = start; i < stop; i++) {                                              \
            for (int64_t channel = 0; channel < n_colors; channel++)                          \
                codes[i][channel] = (code_t)srgb_code_of(                                     \
                    values[i][channel], n_codes, thresholds, first_codes);                    \
            for (int64_t channel = n_colors; channel < n_channels; channel++)                 \
                codes[i][channel] = (code_t)code_of(values[i][channel], 0, &coding, false);   \
        }                                                                                     \
    }

EXPORT void quantize_srgb_u8(
    int64_t n, int64_t n_channels, int64_t n_codes, const float values[n][n_channels],
    const float thresholds[n_codes], const uint16_t first_codes[16257],
    uint8_t codes[n][n_channels], int64_t n_colors, int64_t start, int64_t stop);
EXPORT void quantize_srgb_u16(
    int64_t n, int64_t n_channels, int64_t n_codes, const float values[n][n_channels],
    const float thresholds[n_codes], const uint16_t first_codes[16257],
    uint16_t codes[n][n_channels], int64_t n_colors, int64_t start, int64_t stop);

QUANTIZE_SRGB(quantize_srgb_u8, uint8_t)
QUANTIZE_SRGB(quantize_srgb_u16, uint16_t)
