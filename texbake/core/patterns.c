/* Checkers and stripes, averaged over each pixel, and marble, wood and granite: layers, rings and
   grains, bent by noise. The formulas are in docs/reference/procedures.md.

   Based on: Apodaca and Gritz, "Advanced RenderMan", 2000, chapter 11 (the filtered pulse train);
   Perlin, "An Image Synthesizer", 1985 (marble, and rings bent by noise); Ebert et al., "Texturing and
   Modeling: A Procedural Approach", 3rd edition, 2003 (rings and grain); Upstill, "The RenderMan
   Companion", 1990 (granite from octaves of noise); Haley, "Estimation of the Dosage Mortality
   Relationship When the Dose Is Subject to Error", 1952 (1.702). Departs from Perlin in the factor
   before the turbulence, without which veins are hardly bent.

   Called from texbake/texture/procedures/patterns.py. */

#include <math.h>
#include <stdint.h>

#include "core.h"
#include "elementary.h"
#include "gradient_noise.h"
#include "numbers.h"
#include "procedure_points.h"

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

/* A checker of unit squares or cubes. */
EXPORT void fill_checker(
    int64_t n, int64_t n_coordinates, int64_t n_widths, const double points[n][n_coordinates],
    OPTIONAL const float widths[n][n_widths], float out[n][1], int64_t n_dimensions,
    int64_t start, int64_t stop)
{
    const struct procedure_points given = {
        points[0], widths ? widths[0] : NULL, n_coordinates, n_widths};
    for (int64_t i = start; i < stop; i++) {
        const struct point at = point_at(&given, i);
        const double place[3] = {at.x, at.y, at.z};
        double sign = 1.0;
        for (int64_t axis = 0; axis < n_dimensions; axis++) {
            /* A coordinate that points do not have is 0 all over the pixel. */
            const double span = axis < n_coordinates ? width_along(&given, i, axis) : 0.0;
            sign *= 2.0 * pulse_mean(PULSE_HARD, 0.5, 0.5 * place[axis], 0.5 * span) - 1.0;
        }
        out[i][0] = (float)(0.5 + 0.5 * sign);
    }
}

/* Stripes across a direction, `width` of each period. */
EXPORT void fill_stripes(
    int64_t n, int64_t n_coordinates, int64_t n_widths, const double points[n][n_coordinates],
    OPTIONAL const float widths[n][n_widths], const double direction[3], float out[n][1],
    int64_t pattern, double width, int64_t start, int64_t stop)
{
    const struct procedure_points given = {
        points[0], widths ? widths[0] : NULL, n_coordinates, n_widths};
    for (int64_t i = start; i < stop; i++) {
        const struct point at = point_at(&given, i);
        const double along = direction[0] * at.x + direction[1] * at.y + direction[2] * at.z;
        out[i][0] = (float)pulse_mean(pattern, width, along, span_along(&given, i, direction));
    }
}

/* A ramp of colors, and the color that wide pixels show. */
struct ramp {
    int64_t n_stops;
    const double (*stops)[3], *mean;
};

/* Write `value` to one channel, or to three the color of `sharp`, of whose contrast `kept` is left: 1
   is the color itself, 0 the mean color. */
static inline void write_color(
    const struct ramp *ramp, double value, double sharp, double kept, int64_t n_channels,
    float *out)
{
    if (n_channels == 1) {
        out[0] = (float)clamp_f64(value, 0.0, 1.0);
        return;
    }
    const double place = clamp_f64(sharp, 0.0, 1.0) * (double)(ramp->n_stops - 1);
    const int64_t below = min_i64((int64_t)place, ramp->n_stops - 2);
    const double along = place - (double)below;
    const double *low = ramp->stops[below], *high = ramp->stops[below + 1];
    for (int channel = 0; channel < 3; channel++) {
        const double mean = ramp->mean[channel];
        const double color = low[channel] + along * (high[channel] - low[channel]);
        out[channel] = (float)(mean + kept * (color - mean));
    }
}

/* Layers across a direction, bent by turbulence. `frequency` is of the layers,
   `turbulence_frequency` and `amount` of the turbulence, `variance` that of one octave. */
EXPORT void fill_marble(
    int64_t n, int64_t n_coordinates, int64_t n_widths, int64_t n_stops, int64_t n_channels,
    const double points[n][n_coordinates], OPTIONAL const float widths[n][n_widths],
    const uint8_t permutation[512], const double gradients[256][3], const double direction[3],
    const double stops[n_stops][3], const double mean_color[3], float out[n][n_channels],
    bool quintic, int64_t n_octaves, double frequency, double turbulence_frequency,
    double amount, double lacunarity, double gain, double mean, double variance, int64_t start,
    int64_t stop)
{
    const struct procedure_points given = {
        points[0], widths ? widths[0] : NULL, n_coordinates, n_widths};
    const struct noise_lattice lattice = {permutation, gradients, quintic};
    const struct octaves octaves = {n_octaves, lacunarity, gain, mean};
    const struct ramp ramp = {n_stops, stops, mean_color};
    for (int64_t i = start; i < stop; i++) {
        const struct point at = point_at(&given, i);
        const struct point finer = {
            at.x * turbulence_frequency, at.y * turbulence_frequency, at.z * turbulence_frequency};
        double lost;
        const double total = sum_octaves(
            &lattice, &octaves, &finer, widest(&given, i) * turbulence_frequency, &lost);
        const double along = direction[0] * at.x + direction[1] * at.y + direction[2] * at.z;
        const double layer = portable_sin(frequency * along + amount * total);
        double kept = portable_exp(-0.5 * amount * amount * variance * lost);
        const double half = 0.5 * frequency * span_along(&given, i, direction);
        /* Beyond one whole period the mean of a sine swings about 0; there it stays 0. */
        if (half > 0.0)
            kept *= half < PULSE_PI ? portable_sin(half) / half : 0.0;
        write_color(
            &ramp, 0.5 + 0.5 * kept * layer, 0.5 + 0.5 * layer, kept, n_channels, out[i]);
    }
}

/* Noise with so many cells per ring across and along the axis, faded by the pixel's width. */
static double drawn_noise(
    const struct noise_lattice *lattice, const double across[3], double along,
    const double axis[3], double cells_across, double cells_along, double width)
{
    const double kept = contrast_kept(width * cells_across);
    if (kept == 0.0)
        return 0.0;
    return kept * noise_at(
        lattice, cells_across * across[0] + cells_along * along * axis[0],
        cells_across * across[1] + cells_along * along * axis[1],
        cells_across * across[2] + cells_along * along * axis[2]);
}

/* Rings about an axis, with fibers along it. Rings bend over several of their widths and hardly along
   the trunk; fibers are thin and long. `bound` is the upper bound on the size of noise. */
EXPORT void fill_wood(
    int64_t n, int64_t n_coordinates, int64_t n_widths, int64_t n_stops, int64_t n_channels,
    const double points[n][n_coordinates], OPTIONAL const float widths[n][n_widths],
    const uint8_t permutation[512], const double gradients[256][3], const double axis[3],
    const double stops[n_stops][3], const double mean_color[3], float out[n][n_channels],
    bool quintic, double rings, double wobble, double grain, double bound, int64_t start,
    int64_t stop)
{
    const double rise = 0.8; /* share of a ring that grows darker */
    const struct procedure_points given = {
        points[0], widths ? widths[0] : NULL, n_coordinates, n_widths};
    const struct noise_lattice lattice = {permutation, gradients, quintic};
    const struct ramp ramp = {n_stops, stops, mean_color};
    for (int64_t i = start; i < stop; i++) {
        const struct point at = point_at(&given, i);
        /* One ring is one unit from here on. */
        const double x = rings * at.x, y = rings * at.y, z = rings * at.z;
        const double width = rings * widest(&given, i);
        const double along = axis[0] * x + axis[1] * y + axis[2] * z;
        const double across[3] = {x - along * axis[0], y - along * axis[1], z - along * axis[2]};
        const double radius =
            sqrt(across[0] * across[0] + across[1] * across[1] + across[2] * across[2]);
        const double bend = drawn_noise(&lattice, across, along, axis, 0.2, 0.05, width);
        const double fiber = drawn_noise(&lattice, across, along, axis, 5.0, 0.12, width);
        const double ring = pulse_mean(PULSE_RAMP, rise, radius + wobble * bend, width);
        const double value = (1.0 - grain) * ring + grain * (0.5 + 0.5 * fiber / bound);
        write_color(&ramp, value, value, contrast_kept(0.5 * width), n_channels, out[i]);
    }
}

/* A sum taken to an even distribution. */
static inline double even_out(double total, double variance)
{
    return 1.0 / (1.0 + portable_exp(-1.702 * total / sqrt(variance)));
}

/* Grains: a fractal sum, taken to an even distribution. `squares` is the sum of the squared amplitudes
   of the octaves, `variance` that of one octave. */
EXPORT void fill_granite(
    int64_t n, int64_t n_coordinates, int64_t n_widths, int64_t n_stops, int64_t n_channels,
    const double points[n][n_coordinates], OPTIONAL const float widths[n][n_widths],
    const uint8_t permutation[512], const double gradients[256][3],
    const double stops[n_stops][3], const double mean_color[3], float out[n][n_channels],
    bool quintic, int64_t n_octaves, double frequency, double lacunarity, double gain,
    double squares, double variance, int64_t start, int64_t stop)
{
    const struct procedure_points given = {
        points[0], widths ? widths[0] : NULL, n_coordinates, n_widths};
    const struct noise_lattice lattice = {permutation, gradients, quintic};
    const struct octaves octaves = {n_octaves, lacunarity, gain, -1.0};
    const struct ramp ramp = {n_stops, stops, mean_color};
    for (int64_t i = start; i < stop; i++) {
        const struct point at = point_at(&given, i);
        const struct point finer = {frequency * at.x, frequency * at.y, frequency * at.z};
        double lost;
        const double total =
            sum_octaves(&lattice, &octaves, &finer, frequency * widest(&given, i), &lost);
        const double kept = sqrt(max_f64(squares - lost, 0.0) / squares);
        const double value = even_out(total, variance * (squares + lost));
        /* What is left of the sum, with the distribution that all of it would have. */
        const double sharp =
            kept > 0.0 ? even_out(total, variance * (squares - lost)) : 0.5;
        write_color(&ramp, value, sharp, kept, n_channels, out[i]);
    }
}
