/* Anisotropic filtering: the mean over the ellipse that a pixel covers on the texture.

   A pixel, taken as a round Gaussian, becomes an elliptical one on the texture. Texels are read from
   the two mip levels on which the minor axis of the ellipse is one to two texels long, so that detail
   across that axis is kept however long the ellipse is. Their weights come from a table over the
   squared distance.

   Based on: Greene and Heckbert, "Creating Raster Omnimax Images from Multiple Perspective Views
   Using the Elliptical Weighted Average Filter", 1986; Heckbert, "Fundamentals of Texture Mapping and
   Image Warping", 1989; Pharr, Jakob and Humphreys, "Physically Based Rendering", for the bound on
   the ratio of the axes and the weights that end at 0. Departs from them in that the axes are those
   of the ellipse and not the derivatives, which need not be perpendicular; in that the pixel's part
   of the ellipse has the variance of a square pixel, which is narrower than their unit circle; and in
   that a magnified texture is interpolated, with a transition until the major axis is two texels
   long.

   Called from texbake/texture/sample.py. */

#include <math.h>

#include "arena.h"
#include "core.h"
#include "elementary.h"
#include "numbers.h"
#include "texture_lookup.h"

/* What all lookups of a call have in common. */
struct ellipse_filter {
    const float *texels, *border, *weights; /* weights: over the squared distance, 1 on the ellipse */
    int64_t n_channels, n_weights, wraps;
    const int64_t (*sizes)[2], *offsets;
    double pixel_radius_squared;
};

/* Quadratic form xx, xy, yy. */
struct quadratic_form {
    double xx, xy, yy;
};

static inline double bound_change(double change)
{
    /* So that its square can be computed; what is not a number counts as no change. */
    const double largest = 1e15;
    return change == change ? min_f64(max_f64(change, -largest), largest) : 0.0;
}

/* A pixel on the image, in squared texels, y down. The form's eigenvalues are the squared lengths of
   the axes of the ellipse that a circle of one pixel's radius becomes. */
static struct quadratic_form pixel_form(const float derivatives[4], int64_t width, int64_t height)
{
    struct quadratic_form form = {0.0, 0.0, 0.0};
    for (int k = 0; k < 4; k += 2) {
        const double along = bound_change((double)derivatives[k] * (double)width);
        const double down = bound_change(-(double)derivatives[k + 1] * (double)height);
        form.xx += along * along;
        form.xy += along * down;
        form.yy += down * down;
    }
    return form;
}

/* Bound the ratio of the axes, and write their lengths. The minor axis is lengthened to
   1 / max_anisotropy of the major, then cut to `largest`, the size of the texels of the last level,
   and the major to max_anisotropy times that. */
static struct quadratic_form bound_form(
    const struct quadratic_form *form, double max_anisotropy, double largest, double *minor_axis,
    double *major_axis)
{
    const double squared = max_anisotropy * max_anisotropy;
    const double middle = 0.5 * (form->xx + form->yy);
    const double half_gap = portable_hypot(0.5 * (form->xx - form->yy), form->xy);
    const double major = middle + half_gap;
    const double minor = max_f64(middle - half_gap, 0.0);
    const double new_minor = min_f64(max_f64(minor, major / squared), largest * largest);
    const double new_major = min_f64(major, new_minor * squared);
    const double scale = major > minor ? (new_major - new_minor) / (major - minor) : 0.0;
    const double rest = new_minor - scale * minor;
    *minor_axis = sqrt(new_minor);
    *major_axis = sqrt(new_major);
    const struct quadratic_form bounded = {
        scale * form->xx + rest, scale * form->xy, scale * form->yy + rest};
    return bounded;
}

/* The filter on a level: the pixel's form, and one texel for the level's own. */
static struct quadratic_form level_form(
    const struct ellipse_filter *filter, const struct quadratic_form *pixel, int64_t level)
{
    const int64_t *size = filter->sizes[level], *finest = filter->sizes[0];
    /* Axes of one texel shrink no further. */
    const double half = ldexp(1.0, -(int)level);
    const double y = min_f64((double)size[0] / (double)finest[0], half);
    const double x = min_f64((double)size[1] / (double)finest[1], half);
    const double radius = filter->pixel_radius_squared;
    const struct quadratic_form form = {
        radius * x * x * pixel->xx + 1.0, radius * x * y * pixel->xy,
        radius * y * y * pixel->yy + 1.0};
    return form;
}

/* Write the weighted mean over an ellipse about a `wrap_to_period` coordinate, in texels of a level.
   Differences from one texel are summed, so that a constant stays exactly what it is. */
static void average_ellipse(
    const struct ellipse_filter *filter, int64_t level, double u, double v,
    const struct quadratic_form *form, float *out)
{
    const int64_t n_channels = filter->n_channels, wraps = filter->wraps;
    const int64_t height = filter->sizes[level][0], width = filter->sizes[level][1];
    const float *texels = filter->texels + filter->offsets[level] * n_channels;
    const double center_x = u * (double)width - 0.5;
    const double center_y = row_of_v(v, (double)height) - 0.5;
    const int64_t base = texel_at((int64_t)center_x, (int64_t)center_y, width, height, wraps);
    const float *known = base >= 0 ? texels + base * n_channels : filter->border;
    /* Inverse of the form: 1 on the ellipse. */
    const double determinant = form->xx * form->yy - form->xy * form->xy;
    const double along = form->yy / determinant, slant = -form->xy / determinant;
    const double down = form->xx / determinant, reach = sqrt(form->yy);
    float total = 0.0f;
    for (int64_t channel = 0; channel < n_channels; channel++)
        out[channel] = 0.0f;
    const int64_t last_row = (int64_t)floor(center_y + reach);
    for (int64_t row = (int64_t)ceil(center_y - reach); row <= last_row; row++) {
        const double dy = (double)row - center_y;
        /* The row's part of the ellipse. */
        const double middle = -slant * dy / along, lean = slant * dy;
        const double inside = max_f64(lean * lean - along * (down * dy * dy - 1.0), 0.0);
        const double half = sqrt(inside) / along;
        const int64_t last = (int64_t)floor(center_x + middle + half);
        const int64_t row_start = wrap_index(row, height, wrap_along_v(wraps)) * width;
        for (int64_t column = (int64_t)ceil(center_x + middle - half); column <= last; column++) {
            const double dx = (double)column - center_x;
            const double squared = along * dx * dx + (2.0 * slant * dx + down * dy) * dy;
            const int64_t place = (int64_t)(squared * (double)filter->n_weights);
            if (place >= filter->n_weights)
                continue;
            const float weight = filter->weights[max_i64(place, 0)];
            total += weight;
            const int64_t at = wrap_index(column, width, wrap_along_u(wraps));
            const float *values =
                at >= 0 && row_start >= 0 ? texels + (row_start + at) * n_channels : filter->border;
            for (int64_t channel = 0; channel < n_channels; channel++)
                out[channel] += weight * (values[channel] - known[channel]);
        }
    }
    for (int64_t channel = 0; channel < n_channels; channel++)
        out[channel] = known[channel] + out[channel] / total;
}

/* Write the mean over the pixel on the levels whose texels are as wide as the minor axis. */
static void average_pixel(
    const struct ellipse_filter *filter, const double uv[2], const struct quadratic_form *pixel,
    double minor, float *mean, float *out)
{
    const double u = wrap_to_period(uv[0], wrap_along_u(filter->wraps));
    const double v = wrap_to_period(uv[1], wrap_along_v(filter->wraps));
    const double level = minor > 1.0 ? portable_log2(minor) : 0.0;
    const int64_t fine = (int64_t)level;
    const float blend = (float)(level - (double)fine);
    for (int64_t k = fine; k < fine + (blend > 0.0f ? 2 : 1); k++) {
        const struct quadratic_form form = level_form(filter, pixel, k);
        average_ellipse(filter, k, u, v, &form, mean);
        for (int64_t channel = 0; channel < filter->n_channels; channel++) {
            const float near = k == fine ? mean[channel] : out[channel];
            out[channel] = near + blend * (mean[channel] - near);
        }
    }
}

/* Write the interpolated value, or add `share` of it to what is there. */
static void interpolate_pixel(
    const struct ellipse_filter *filter, const double uv[2], float share, float *out)
{
    const int64_t n_channels = filter->n_channels, wraps = filter->wraps;
    const float (*texels)[n_channels] = (const float (*)[n_channels])filter->texels;
    const struct texel_cell cell = bilinear_cell(
        wrap_to_unit(uv[0], wrap_along_u(wraps)), wrap_to_unit(uv[1], wrap_along_v(wraps)),
        filter->sizes[0][1], filter->sizes[0][0], wraps, filter->offsets[0]);
    for (int64_t channel = 0; channel < n_channels; channel++) {
        const float value =
            interpolate_cell_f32(n_channels, texels, &cell, channel, filter->border[channel]);
        const float mixed = share == 1.0f ? value : out[channel];
        out[channel] = mixed + share * (value - mixed);
    }
}

/* Fill rows `start` to `stop` of `out`. `pixel_radius_squared` is the squared radius of the ellipse
   in steps of a pixel. */
EXPORT int64_t sample_ellipses(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n, int64_t n_weights,
    const float texels[n_texels][n_channels], const int64_t offsets[n_levels],
    const int64_t sizes[n_levels][2], const double uvs[n][2], const float derivatives[n][4],
    double max_anisotropy, int64_t wraps, const float border[n_channels],
    const float weights[n_weights], double pixel_radius_squared, float out[n][n_channels],
    int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    const struct ellipse_filter filter = {
        texels[0], border, weights, n_channels, n_weights, wraps, sizes, offsets,
        pixel_radius_squared,
    };
    const double largest = ldexp(1.0, (int)(n_levels - 1));
    float *mean = TAKE(arena, float, n_channels);
    for (int64_t i = start; i < stop; i++) {
        double minor, major;
        const struct quadratic_form form = pixel_form(derivatives[i], sizes[0][1], sizes[0][0]);
        const struct quadratic_form pixel =
            bound_form(&form, max_anisotropy, largest, &minor, &major);
        float share = 1.0f; /* of interpolation */
        if (major > 1.0) {
            share = (float)max_f64(2.0 - major, 0.0);
            average_pixel(&filter, uvs[i], &pixel, minor, mean, out[i]);
        }
        if (share > 0.0f)
            interpolate_pixel(&filter, uvs[i], share, out[i]);
    }
    close_arena(arena);
    return 0;
}
