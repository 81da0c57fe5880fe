/* The values of a map before they are encoded: their range, how many lie beyond it, and the
   value at a rank, found without sorting.

   The value at a rank comes from counts of the upper halves of the values' bits, then of the lower
   halves of those with the right upper half: the bits of positive floats sort as the floats do.

   Based on: Knuth, "The Art of Computer Programming", volume 3, section 5.2.5 (radix sorting; here
   only the counts).

   Called from texbake/texture/encoding.py and texbake/baking/report.py. */

#include <math.h>
#include <string.h>

#include "core.h"

/* Widen the range of each channel, minimum and maximum, to the finite values of covered texels. */
EXPORT void measure_ranges(
    int64_t n, int64_t n_channels, const float values[n][n_channels], const bool covered[n],
    float ranges[n_channels][2], int64_t start, int64_t stop)
{
    for (int64_t i = start; i < stop; i++) {
        if (!covered[i])
            continue;
        for (int64_t channel = 0; channel < n_channels; channel++) {
            const float value = values[i][channel];
            float *range = ranges[channel];
            if (!isfinite(value))
                continue;
            range[0] = value < range[0] ? value : range[0];
            range[1] = value > range[1] ? value : range[1];
        }
    }
}

/* Values of covered texels whose level, value / scale + mid, is below `least` or above `most`. */
EXPORT int64_t count_outside(
    int64_t n, int64_t n_channels, const float values[n][n_channels], const bool covered[n],
    double scale, double mid, double least, double most, int64_t start, int64_t stop)
{
    int64_t count = 0;
    for (int64_t i = start; i < stop; i++) {
        if (!covered[i])
            continue;
        for (int64_t channel = 0; channel < n_channels; channel++) {
            const double level = values[i][channel] / scale + mid;
            count += level < least || level > most;
        }
    }
    return count;
}

/* Write the squared lengths of vectors to those that have a face, not below 0, one after the other from
   `start` on; return how many there are. */
EXPORT int64_t measure_lengths(
    int64_t n, const float vectors[n][3], const int32_t faces[n], int64_t start, int64_t stop,
    double squares[n])
{
    int64_t next = start;
    for (int64_t i = start; i < stop; i++) {
        /* The squares of very small and very large lengths are in the range of double. */
        const double x = vectors[i][0], y = vectors[i][1], z = vectors[i][2];
        squares[next] = x * x + y * y + z * z;
        next += faces[i] >= 0;
    }
    return next - start;
}

static inline uint32_t bits_of_size(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits & 0x7FFFFFFF;
}

/* Count the covered values by the upper half of the bits of their size. */
EXPORT void count_upper_halves(
    int64_t n, int64_t n_channels, const float values[n][n_channels], const bool covered[n],
    int64_t counts[1 << 16], int64_t start, int64_t stop)
{
    for (int64_t i = start; i < stop; i++)
        for (int64_t channel = 0; covered[i] && channel < n_channels; channel++)
            counts[bits_of_size(values[i][channel]) >> 16]++;
}

/* Count those with the upper half `upper` by the lower half. */
EXPORT void count_lower_halves(
    int64_t n, int64_t n_channels, const float values[n][n_channels], const bool covered[n],
    int64_t counts[1 << 16], int64_t upper, int64_t start, int64_t stop)
{
    for (int64_t i = start; i < stop; i++)
        for (int64_t channel = 0; covered[i] && channel < n_channels; channel++) {
            const uint32_t bits = bits_of_size(values[i][channel]);
            if (bits >> 16 == upper)
                counts[bits & 0xFFFF]++;
        }
}
