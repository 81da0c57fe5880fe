/* Screen-space ambient occlusion: the unoccluded share of ambient light at each pixel.

   At each pixel the hemisphere around the surface normal is divided into slices across the screen.
   In each slice the horizon within the radius is searched on both sides, and the visible arc between
   the two horizons is integrated analytically, weighted by the cosine to the normal. The slices are
   rotated from pixel to pixel in a 4 x 4 pattern, which is then averaged out over as many pixels of
   the same surface. Only surfaces that the camera sees can occlude.

   Based on: Jimenez, Wu, Pesce and Jarabo, "Practical real-time strategies for accurate indirect
   occlusion", 2016. Unlike there, normals are those of the triangles, so that a flat surface never
   occludes itself.

   Called from texbake/rendering/effects/ambient.py. */

#include <math.h>

#include "core.h"
#include "elementary.h"
#include "numbers.h"

static const double PI = 3.141592653589793;

/* Width of the pattern of rotations, and of the mean that removes it. */
enum { PATTERN = 4 };

/* Least sine of the elevation at which a point occludes. With float32 depths, points of a flat
   surface seen at a grazing angle deviate from it by this much. */
static const double FLAT = 1e-3;

static inline double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline bool is_zero(const double vector[3])
{
    return vector[0] == 0.0 && vector[1] == 0.0 && vector[2] == 0.0;
}

/* Write the normal of a triangle on the side that is seen from its place, unless it has no area. */
static void write_facing_normal(
    const double a[3], const double b[3], const double c[3], const double place[3],
    double normal[3])
{
    double p[3], q[3];
    for (int k = 0; k < 3; k++) {
        p[k] = b[k] - a[k];
        q[k] = c[k] - a[k];
    }
    const double crossed[3] = {
        p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]};
    const double length = sqrt(dot(crossed, crossed));
    if (!(0.0 < length && length < INFINITY))
        return;
    const double turned = dot(crossed, place) <= 0.0 ? length : -length;
    for (int k = 0; k < 3; k++)
        normal[k] = crossed[k] / turned;
}

/* Write position (relative to the camera) and normal of each pixel's nearest surface, or leave 0. */
EXPORT void find_places(
    int64_t sample_rows, int64_t sample_columns, int64_t n_positions, int64_t n_faces,
    int64_t height, int64_t width, const int32_t face_ids[sample_rows][sample_columns],
    const float depths[sample_rows][sample_columns], int64_t side, double near,
    const double positions[n_positions][3], const int32_t faces[n_faces][3],
    const double rays[3][3], double places[height][width][3], double normals[height][width][3],
    int64_t start, int64_t stop)
{
    for (int64_t row = start; row < stop; row++) {
        for (int64_t column = 0; column < width; column++) {
            float nearest = 0.0f;
            int32_t face = -1;
            double x = 0.0, y = 0.0;
            for (int64_t j = row * side; j < (row + 1) * side; j++) {
                for (int64_t i = column * side; i < (column + 1) * side; i++) {
                    if (depths[j][i] > nearest) {
                        nearest = depths[j][i];
                        face = face_ids[j][i];
                        x = (i + 0.5) / side;
                        y = (j + 0.5) / side;
                    }
                }
            }
            if (face < 0)
                continue;
            const double away = near / nearest;
            double *place = places[row][column];
            for (int k = 0; k < 3; k++)
                place[k] = away * (rays[0][k] + x * rays[1][k] + y * rays[2][k]);
            const int32_t *corners = faces[face];
            write_facing_normal(
                positions[corners[0]], positions[corners[1]], positions[corners[2]], place,
                normals[row][column]);
        }
    }
}

/* The picture, and how a pixel is searched. */
struct search {
    int64_t height, width, n_steps;
    const double *places; /* height x width x 3 */
    double radius;
    const double *right, *up; /* axes of the camera */
};

/* A pixel: its place, its normal, and the direction to the camera. */
struct pixel {
    int64_t row, column;
    const double *place, *normal;
    double to_eye[3];
    double reach, offset; /* of the steps across the screen, in pixels and in steps */
};

/* Cosine between the horizon on one side of a pixel and the view direction; -1 for none. */
static double horizon_of(const struct search *search, const struct pixel *pixel, double dx, double dy)
{
    const double radius = search->radius;
    double highest = -1.0;
    for (int64_t step = 0; step < search->n_steps; step++) {
        const double away =
            max_f64(pixel->reach * (step + pixel->offset) / search->n_steps, 1.0);
        const double y = floor(pixel->row + 0.5 + away * dy);
        const double x = floor(pixel->column + 0.5 + away * dx);
        if (!(0.0 <= y && y < search->height && 0.0 <= x && x < search->width))
            continue;
        const int64_t j = (int64_t)y, i = (int64_t)x;
        if (j == pixel->row && i == pixel->column)
            continue;
        const double *there = search->places + 3 * (j * search->width + i);
        if (is_zero(there))
            continue;
        double squared = 0.0, along = 0.0, above = 0.0;
        for (int k = 0; k < 3; k++) {
            const double apart = there[k] - pixel->place[k];
            squared += apart * apart;
            along += apart * pixel->to_eye[k];
            above += apart * pixel->normal[k];
        }
        if (!(0.0 < squared && squared < radius * radius))
            continue;
        const double distance = sqrt(squared);
        if (above <= FLAT * distance)
            continue;
        /* Fade out toward the radius to avoid a discontinuity. */
        const double share = min_f64(1.0, 2.0 * (1.0 - distance / radius));
        highest = max_f64(highest, share * (along / distance + 1.0) - 1.0);
    }
    return highest;
}

/* Light between the view direction and a horizon, weighted by the cosine to the normal. */
static double arc_light(double horizon, double tilt)
{
    return 0.25 * (-portable_cos(2.0 * horizon - tilt) + portable_cos(tilt) + 2.0 * horizon * portable_sin(tilt));
}

/* Add the unoccluded light in one slice through the view direction, and the total without
   occlusion. */
static void add_slice(
    const struct search *search, const struct pixel *pixel, double cosine, double sine,
    double *arriving, double *total)
{
    const double *right = search->right, *up = search->up;
    const double *to_eye = pixel->to_eye, *normal = pixel->normal;
    /* Axis of the slice: its screen direction orthogonal to the view. Then the slice's normal. */
    double along_eye = 0.0, axis[3];
    for (int k = 0; k < 3; k++)
        along_eye += (cosine * right[k] - sine * up[k]) * to_eye[k];
    for (int k = 0; k < 3; k++)
        axis[k] = cosine * right[k] - sine * up[k] - along_eye * to_eye[k];
    const double length = sqrt(dot(axis, axis));
    for (int k = 0; k < 3; k++)
        axis[k] /= length;
    const double across = dot(normal, axis), toward = dot(normal, to_eye);
    const double projected = sqrt(across * across + toward * toward);
    if (projected < 1e-6) /* the slice lies in the surface */
        return;
    const double tilt = portable_atan2(across, toward);
    const double ahead = horizon_of(search, pixel, cosine, sine);
    const double behind = horizon_of(search, pixel, -cosine, -sine);
    /* Horizons as angles from the view direction, limited by the surface itself. */
    const double most = tilt + 0.5 * PI, least = tilt - 0.5 * PI;
    const double first = min_f64(portable_acos(clamp_f64(ahead, -1.0, 1.0)), most);
    const double second = max_f64(-portable_acos(clamp_f64(behind, -1.0, 1.0)), least);
    *arriving += projected * (arc_light(first, tilt) + arc_light(second, tilt));
    *total += projected * (arc_light(most, tilt) + arc_light(least, tilt));
}

/* Write the unoccluded share of ambient light at each pixel with a surface. */
EXPORT void find_arriving_shares(
    int64_t height, int64_t width, const double places[height][width][3],
    const double normals[height][width][3], const double right[3], const double up[3],
    double pixels_per_unit, double radius, int64_t n_slices, int64_t n_steps,
    float out[height][width], int64_t start, int64_t stop)
{
    const struct search search = {height, width, n_steps, places[0][0], radius, right, up};
    for (int64_t row = start; row < stop; row++) {
        for (int64_t column = 0; column < width; column++) {
            struct pixel pixel = {
                .row = row, .column = column, .place = places[row][column],
                .normal = normals[row][column]};
            if (is_zero(pixel.normal))
                continue;
            const double distance = sqrt(dot(pixel.place, pixel.place));
            for (int k = 0; k < 3; k++)
                pixel.to_eye[k] = -pixel.place[k] / distance;
            pixel.reach = min_f64(radius * pixels_per_unit / distance, 0.5 * width);
            const int64_t turn = row % PATTERN * PATTERN + column % PATTERN;
            pixel.offset = 0.25 + 0.75 * (turn * 5 % 16) / 16.0;
            double arriving = 0.0, total = 0.0;
            for (int64_t s = 0; s < n_slices; s++) {
                const double angle = PI * (s + (turn * 7 % 16) / 16.0) / n_slices;
                add_slice(&search, &pixel, portable_cos(angle), portable_sin(angle), &arriving, &total);
            }
            /* Relative to the unoccluded light in the same slices, so that a plane gives 1. */
            out[row][column] = total > 0.0 ? (float)clamp_f64(arriving / total, 0.0, 1.0) : 1.0f;
        }
    }
}

/* Average over the pixels of the pattern that lie on the same surface. */
EXPORT void smooth_shares(
    int64_t height, int64_t width, const float rough[height][width],
    const double places[height][width][3], const double normals[height][width][3], double radius,
    float out[height][width], int64_t start, int64_t stop)
{
    for (int64_t row = start; row < stop; row++) {
        for (int64_t column = 0; column < width; column++) {
            const double *place = places[row][column], *normal = normals[row][column];
            const int64_t bottom = min_i64(row + PATTERN / 2, height);
            const int64_t end = min_i64(column + PATTERN / 2, width);
            double total = 0.0, weight = 0.0;
            for (int64_t j = max_i64(row - PATTERN / 2, 0); j < bottom; j++) {
                for (int64_t i = max_i64(column - PATTERN / 2, 0); i < end; i++) {
                    double off = 0.0, alike = 0.0;
                    for (int k = 0; k < 3; k++) {
                        off += (places[j][i][k] - place[k]) * normal[k];
                        alike += normals[j][i][k] * normal[k];
                    }
                    if (fabs(off) < 0.1 * radius && alike > 0.5) {
                        total += rough[j][i];
                        weight += 1.0;
                    }
                }
            }
            out[row][column] = weight > 0.0 ? (float)(total / weight) : 1.0f;
        }
    }
}
