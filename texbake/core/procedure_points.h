/* The points of a procedural texture, and the width of a pixel at each.

   A pixel is a box around its point, with the same width along every axis or one width per axis.

   Based on: Apodaca and Gritz, "Advanced RenderMan", 2000, chapter 11, for fading detail to its mean
   by the width of the filter. */

#pragma once

#include <math.h>
#include <stddef.h>
#include <stdint.h>

#include "numbers.h"

struct procedure_points {
    const double *points; /* n_coordinates per point, up to 3; missing ones are 0 */
    const float *widths;  /* n_widths per point, 1 or as many as coordinates; NULL: no filter */
    int64_t n_coordinates, n_widths;
};

struct point {
    double x, y, z;
};

/* The coordinate, or 0 where it is not finite or too far out to lie within a cell. Neighbors of this
   magnitude in double are 2^-2 apart: what lies further out has no place within a cell any more.
   Times every frequency that can be asked for it stays finite. */
static inline double bound_coordinate(double coordinate)
{
    /* False also for what is not a number. */
    return fabs(coordinate) <= 0x1p50 ? coordinate : 0.0;
}

static inline struct point point_at(const struct procedure_points *given, int64_t i)
{
    const double *at = given->points + i * given->n_coordinates;
    const struct point point = {
        given->n_coordinates > 0 ? bound_coordinate(at[0]) : 0.0,
        given->n_coordinates > 1 ? bound_coordinate(at[1]) : 0.0,
        given->n_coordinates > 2 ? bound_coordinate(at[2]) : 0.0};
    return point;
}

/* Width of a pixel along an axis; 0 where nothing is filtered or it is not a number. */
static inline double width_along(const struct procedure_points *given, int64_t i, int64_t axis)
{
    if (!given->widths || given->n_widths < 1 || (given->n_widths > 1 && axis >= given->n_widths))
        return 0.0;
    const double width = given->widths[i * given->n_widths + (given->n_widths > 1 ? axis : 0)];
    /* Every pattern has reached its mean long before. */
    return width > 0.0 ? min_f64(width, 0x1p50) : 0.0;
}

/* Largest width of a pixel along any axis. */
static inline double widest(const struct procedure_points *given, int64_t i)
{
    const double across = max_f64(width_along(given, i, 0), width_along(given, i, 1));
    return max_f64(across, width_along(given, i, 2));
}

/* How far a pixel reaches along a direction, a unit vector. */
static inline double span_along(
    const struct procedure_points *given, int64_t i, const double direction[3])
{
    if (given->n_widths == 1)
        return width_along(given, i, 0);
    double span = 0.0;
    for (int64_t axis = 0; axis < 3; axis++)
        span += fabs(direction[axis]) * width_along(given, i, axis);
    return span;
}

/* Share of its contrast that noise keeps in a pixel so many cells wide, from 1 down to 0. It is kept
   whole up to a fourth of a cell and gone where a pixel is as wide as a cell. Noise averaged over a
   square keeps 0.96 and 0.62 of its contrast there; the rest is what would alias, since a cell is
   about one period and two pixels per period are the limit. */
static inline double contrast_kept(double cells)
{
    const double kept_below = 0.25, gone_above = 1.0;
    double t = (cells - kept_below) / (gone_above - kept_below);
    t = clamp_f64(t, 0.0, 1.0);
    return 1.0 - t * t * (3.0 - 2.0 * t);
}
