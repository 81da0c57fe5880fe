/* Pulses: patterns along one coordinate with the period 1 and values from 0 to 1, and their means over
   intervals. `width` is the share of a period, above 0 and below 1:

   - PULSE_HARD: 1 over the first `width` of the period, then 0.
   - PULSE_SINE: half a wave above 1/2 over the first `width`, half a wave below it over the rest; a
     sine where `width` is 1/2.
   - PULSE_RAMP: straight up to 1 over the first `width`, straight down to 0 over the rest.

   The mean of a pulse over an interval is the difference of its integral at the ends divided by the
   length, which is exact: details finer than a pixel become the right gray.

   Based on: Apodaca and Gritz, "Advanced RenderMan", 2000, chapter 11 (the filtered pulse train). */

#pragma once

#include <math.h>
#include <stdint.h>

#include "elementary.h"
#include "numbers.h"

/* As in texbake/texture/procedures/patterns.py. */
enum { PULSE_HARD, PULSE_SINE, PULSE_RAMP };

static const double PULSE_PI = 3.141592653589793;

static inline double pulse_at(int64_t pattern, double width, double t)
{
    if (pattern == PULSE_HARD)
        return t < width ? 1.0 : 0.0;
    if (t < width) {
        t /= width;
        return pattern == PULSE_SINE ? 0.5 + 0.5 * portable_sin(PULSE_PI * t) : t;
    }
    t = (1.0 - t) / (1.0 - width);
    return pattern == PULSE_SINE ? 0.5 - 0.5 * portable_sin(PULSE_PI * t) : t;
}

/* Integral of a pattern from 0 to t, in [0, 1]. */
static inline double pulse_integral(int64_t pattern, double width, double t)
{
    const double first = min_f64(t, width);
    if (pattern == PULSE_HARD)
        return first;
    const double rest = max_f64(t - width, 0.0), other = 1.0 - width;
    if (pattern == PULSE_SINE) {
        const double above = width * (1.0 - portable_cos(PULSE_PI * first / width));
        const double below = other * (1.0 - portable_cos(PULSE_PI * rest / other));
        return 0.5 * t + 0.5 * (above - below) / PULSE_PI;
    }
    return 0.5 * first * first / width + rest - 0.5 * rest * rest / other;
}

/* Mean of a pattern over `phase` ± `span` / 2, in periods; its value where the span is 0. */
static inline double pulse_mean(int64_t pattern, double width, double phase, double span)
{
    /* Points on a face that lies in an edge of a hard pattern, whose coordinates are rounded either
       way, all count as just above the edge. */
    if (pattern == PULSE_HARD)
        phase += 0x1p-30;
    /* Shorter intervals are points: within them no mean differs from the value by more than 2^-19, and
       the difference of integrals would lose its last digits. */
    if (!(span > 0x1p-20))
        return pulse_at(pattern, width, phase - floor(phase));
    double start = phase - 0.5 * span;
    start -= floor(start);
    const double end = start + span, periods = floor(end);
    const double area = periods * pulse_integral(pattern, width, 1.0) +
                        pulse_integral(pattern, width, end - periods);
    return clamp_f64((area - pulse_integral(pattern, width, start)) / span, 0.0, 1.0);
}
