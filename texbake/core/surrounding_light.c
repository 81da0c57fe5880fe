/* Light from all around: ambient light, environments, mirrors, glass and fog.

   Values have one row per fragment, or a single row for all of them.

   Based on: Karis, "Real Shading in Unreal Engine 4", 2013; Schlick, "An inexpensive BRDF model for
   physically-based rendering", 1994.

   Called from texbake/rendering/effects: ambient.py, environment.py and mirrors.py. */

#include <math.h>

#include "core.h"
#include "elementary.h"
#include "fragment_values.h"
#include "numbers.h"

/* Add light from above and below, weighted by how far the normal points up; without normals, all of
   it comes from above. */
EXPORT void reflect_ambient(
    int64_t n_normals, int64_t n_base, int64_t n_share, int64_t n, const float normals[n_normals][3],
    const double up[3], const float sky[1][3], const float ground[1][3],
    const float base[n_base][3], const float share[n_share], float out[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const float *color = base[row_of(n_base, i)];
        const float unoccluded = share[row_of(n_share, i)];
        double above = 1.0;
        if (n_normals > 0) {
            const float *normal = normals[i];
            above = 0.5 + 0.5 * (normal[0] * up[0] + normal[1] * up[1] + normal[2] * up[2]);
        }
        for (int k = 0; k < 3; k++) {
            const double light = above * sky[0][k] + (1.0 - above) * ground[0][k];
            out[i][k] = (float)(out[i][k] + unoccluded * light * color[k]);
        }
    }
}

/* Write the reflected view directions, 2 (N·V) N - V. */
EXPORT void mirror_directions(
    int64_t n, const float normals[n][3], const float to_eye[n][3], float out[restrict n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const double along = 2.0 * dot_f32(normals[i], to_eye[i]);
        for (int k = 0; k < 3; k++)
            out[i][k] = (float)(along * normals[i][k] - to_eye[i][k]);
    }
}

/* Scale and bias of the specular reflectance, from a table over n·v and roughness. */
struct split_sum {
    double scale, bias;
};

/* Bilinear between the four texels around a place, with centers at halves. Beyond the last center,
   up to roughness 1, extrapolate linearly. */
static inline struct split_sum look_up_split_sum(
    int64_t size, const float table[size][size][2], double toward_eye, double roughness)
{
    /* With the bound first, what is not a number counts as the bound. */
    const double x = min_f64(max_f64(0.0, toward_eye * size - 0.5), size - 1.0);
    const double y = min_f64(max_f64(0.0, roughness * size - 0.5), size - 0.5);
    const int64_t left = (int64_t)x, top = max_i64(min_i64((int64_t)y, size - 2), 0);
    const int64_t right = min_i64(left + 1, size - 1), below = min_i64(top + 1, size - 1);
    const double fx = x - left, fy = y - top;
    double mixed[2];
    for (int k = 0; k < 2; k++)
        mixed[k] = (1.0 - fy) * ((1.0 - fx) * table[top][left][k] + fx * table[top][right][k])
                   + fy * ((1.0 - fx) * table[below][left][k] + fx * table[below][right][k]);
    return (struct split_sum){mixed[0], mixed[1]};
}

/* Add an environment's light: diffuse, and specular unless `mirrored` is empty. */
EXPORT void reflect_environment(
    int64_t n, int64_t n_mirrored, int64_t size, int64_t n_base, int64_t n_roughness,
    int64_t n_metalness, int64_t n_share, const float normals[n][3], const float to_eye[n][3],
    const float diffuse[n][3], const float mirrored[n_mirrored][3],
    const float table[size][size][2], const float base[n_base][3],
    const float roughness[n_roughness][1], const float metalness[n_metalness][1],
    double dielectric, const float share[n_share], float out[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const float *color = base[row_of(n_base, i)];
        const double metal = metalness[row_of(n_metalness, i)][0];
        struct split_sum split = {0.0, 0.0};
        if (n_mirrored > 0)
            split = look_up_split_sum(
                size, table, fabs(sum_products(normals[i], to_eye[i])),
                roughness[row_of(n_roughness, i)][0]);
        for (int k = 0; k < 3; k++) {
            const double f0 = dielectric + (color[k] - dielectric) * metal;
            const double mirror = f0 * split.scale + split.bias;
            double light = (1.0 - mirror) * (1.0 - metal) * color[k] * diffuse[i][k];
            if (n_mirrored > 0)
                light += mirror * mirrored[i][k];
            out[i][k] = (float)(out[i][k] + share[row_of(n_share, i)] * light);
        }
    }
}

/* Write the view directions refracted by Snell's law. */
EXPORT void refract_directions(
    int64_t n, const float normals[n][3], const float to_eye[n][3], const bool back_facing[n],
    double index, float out[restrict n][3])
{
    for (int64_t i = 0; i < n; i++) {
        /* Into the material at front faces, out of it at back faces. */
        const double eta = back_facing[i] ? index : 1.0 / index;
        const double cosine = sum_products(normals[i], to_eye[i]);
        const double inside = 1.0 - eta * eta * (1.0 - cosine * cosine);
        for (int k = 0; k < 3; k++) {
            if (inside < 0.0) /* total reflection */
                out[i][k] = (float)(2.0 * cosine * normals[i][k] - to_eye[i][k]);
            else
                out[i][k] = (float)(
                    -eta * to_eye[i][k] + (eta * cosine - sqrt(inside)) * normals[i][k]);
        }
    }
}

/* Replace a share of the fragments' light by the environment's. */
EXPORT void mix_in_environment(
    int64_t n, int64_t n_strength, const float normals[n][3], const float to_eye[n][3],
    const float strength[n_strength][3], const float seen[n][3], bool fresnel, float out[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const float *wanted = strength[row_of(n_strength, i)];
        double grazing = 0.0;
        if (fresnel) {
            const double off = 1.0 - min_f64(fabs(sum_products(normals[i], to_eye[i])), 1.0);
            grazing = off * (off * off * (off * off));
        }
        for (int k = 0; k < 3; k++) {
            double share = clamp_f64(wanted[k], 0.0, 1.0);
            share += (1.0 - share) * grazing;
            /* A perfect mirror shows nothing of the surface, not even its rounding. */
            const double shown = out[i][k] + share * (seen[i][k] - out[i][k]);
            out[i][k] = share < 1.0 ? (float)shown : seen[i][k];
        }
    }
}

/* Share of light that remains after a distance in fog; `mode` as in effects/environment.py. */
static double left_after(double distance, int64_t mode, double density, double start, double end)
{
    if (mode == 0)
        return clamp_f64((end - distance) / (end - start), 0.0, 1.0);
    const double thickness = density * distance;
    return portable_exp(mode == 1 ? -thickness : -thickness * thickness);
}

/* Mix light with the fog's color by the distance from the camera. */
EXPORT void fade_into_fog(
    int64_t n, const double positions[n][3], const double eye[3], int64_t mode, double density,
    double start, double end, const double color[3], float out[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        double squared = 0.0;
        for (int k = 0; k < 3; k++) {
            const double apart = positions[i][k] - eye[k];
            squared += apart * apart;
        }
        const double left = left_after(sqrt(squared), mode, density, start, end);
        for (int k = 0; k < 3; k++)
            out[i][k] = (float)(left * out[i][k] + (1.0 - left) * color[k]);
    }
}
