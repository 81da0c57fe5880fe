/* The light of lamps: how it arrives at fragments, and how the shading models reflect it.

   Values have one row per fragment, or a single row for all of them.

   Based on: Blinn, "Models of light reflection for computer synthesized pictures", SIGGRAPH 1977; the
   glTF 2.0 specification, appendix B; Schlick, "An inexpensive BRDF model for physically-based
   rendering", 1994.

   Called from texbake/rendering/effects: lights.py and shading_models.py. */

#include <math.h>

#include "core.h"
#include "elementary.h"
#include "fragment_values.h"
#include "numbers.h"

/* Least distance between a point and a light, in model units, so that its strength stays finite. */
static const double NEAREST = 1e-3;

/* Write the direction and the strength of a lamp's light at points; `inner` and `outer` are the
   cosines of a spot's cones, or -1. */
EXPORT void find_arriving_light(
    int64_t n, const double points[n][3], const float normals[n][3], const double position[3],
    const double axis[3], double inner, double outer, double decay, const float color[1][3],
    float directions[n][3], float radiance[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        double x = position[0] - points[i][0], y = position[1] - points[i][1];
        double z = position[2] - points[i][2];
        const double distance = sqrt(x * x + y * y + z * z);
        if (0.0 < distance && distance < INFINITY) {
            x /= distance;
            y /= distance;
            z /= distance;
        } else {
            x = normals[i][0];
            y = normals[i][1];
            z = normals[i][2];
        }
        directions[i][0] = (float)x;
        directions[i][1] = (float)y;
        directions[i][2] = (float)z;
        double strength = short_power(max_f64(distance, NEAREST), -decay);
        if (outer > -1.0) {
            const double cosine = -(x * axis[0] + y * axis[1] + z * axis[2]);
            if (cosine <= outer) {
                strength = 0.0;
            } else if (cosine < inner) {
                const double t = (cosine - outer) / (inner - outer);
                strength *= t * t * (3.0 - 2.0 * t);
            }
        }
        for (int k = 0; k < 3; k++)
            radiance[i][k] = (float)(strength * color[0][k]);
    }
}

/* Add a lamp's light, reflected by Lambert's law. */
EXPORT void reflect_lambert(
    int64_t n, int64_t n_directions, int64_t n_radiance, int64_t n_base, const float normals[n][3],
    const float directions[n_directions][3], const float radiance[n_radiance][3],
    const float base[n_base][3], float out[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const float *light = radiance[row_of(n_radiance, i)], *color = base[row_of(n_base, i)];
        const float facing = dot_f32(normals[i], directions[row_of(n_directions, i)]);
        if (facing > 0.0f) {
            for (int k = 0; k < 3; k++)
                out[i][k] += light[k] * color[k] * facing;
        }
    }
}

/* The directions at a fragment in relation to each other: N·L, N·V, N·(L + V) and |L + V|^2. */
struct angles {
    double facing, toward_eye, halfway, squared;
};

static inline struct angles angles_between(
    const float normal[3], const float to_light[3], const float to_eye[3])
{
    struct angles found = {0.0, 0.0, 0.0, 0.0};
    for (int k = 0; k < 3; k++) {
        const float half = to_light[k] + to_eye[k];
        found.facing += normal[k] * to_light[k];
        found.toward_eye += normal[k] * to_eye[k];
        found.halfway += normal[k] * half;
        found.squared += half * half;
    }
    return found;
}

/* Add a lamp's light, reflected by the model of Blinn and Phong. */
EXPORT void reflect_blinn_phong(
    int64_t n, int64_t n_directions, int64_t n_radiance, int64_t n_base, int64_t n_specular,
    int64_t n_exponent, int64_t n_gloss, const float normals[n][3],
    const float directions[n_directions][3], const float radiance[n_radiance][3],
    const float to_eye[n][3], const float base[n_base][3], const float specular[n_specular][3],
    const float exponent[n_exponent][1], const float gloss[n_gloss][1], float out[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const float *light = radiance[row_of(n_radiance, i)], *color = base[row_of(n_base, i)];
        const float *highlight = specular[row_of(n_specular, i)];
        const struct angles at =
            angles_between(normals[i], directions[row_of(n_directions, i)], to_eye[i]);
        if (at.facing <= 0.0)
            continue;
        double shine = 0.0;
        if (at.halfway > 0.0) {
            const double power = exponent[row_of(n_exponent, i)][0];
            shine = gloss[row_of(n_gloss, i)][0] *
                    short_power(at.halfway / sqrt(at.squared), power);
        }
        for (int k = 0; k < 3; k++) {
            const double reflected = color[k] * at.facing + highlight[k] * shine;
            out[i][k] = (float)(out[i][k] + light[k] * reflected);
        }
    }
}

/* pi D V of the distribution of Trowbridge and Reitz, with the height-correlated V. */
static inline double microfacets(double halfway, double facing, double toward_eye, double alpha)
{
    const double a2 = alpha * alpha;
    const double spread = halfway * halfway * (a2 - 1.0) + 1.0;
    return a2 / (spread * spread) * 0.5
           / (facing * sqrt(toward_eye * toward_eye * (1.0 - a2) + a2)
              + toward_eye * sqrt(facing * facing * (1.0 - a2) + a2));
}

/* Add a lamp's light, reflected by the metallic-roughness model of glTF 2.0. `dielectric` is the
   reflectance at normal incidence of what is not metal; alpha is at least `least_alpha`. */
EXPORT void reflect_metallic(
    int64_t n, int64_t n_directions, int64_t n_radiance, int64_t n_base, int64_t n_roughness,
    int64_t n_metalness, const float normals[n][3], const float directions[n_directions][3],
    const float radiance[n_radiance][3], const float to_eye[n][3], const float base[n_base][3],
    const float roughness[n_roughness][1], const float metalness[n_metalness][1],
    double dielectric, double least_alpha, float out[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const float *light = radiance[row_of(n_radiance, i)], *color = base[row_of(n_base, i)];
        const struct angles at =
            angles_between(normals[i], directions[row_of(n_directions, i)], to_eye[i]);
        if (at.facing <= 0.0)
            continue;
        const float rough = roughness[row_of(n_roughness, i)][0];
        const double alpha = max_f64(rough * rough, least_alpha);
        const double metal = metalness[row_of(n_metalness, i)][0];
        /* Limits rounding on surfaces seen edge-on. */
        const double toward_eye = max_f64(fabs(at.toward_eye), 1e-4);
        const double length = sqrt(at.squared);
        const double halfway = length > 0.0 ? clamp_f64(at.halfway / length, 0.0, 1.0) : 0.0;
        const double shine = microfacets(halfway, at.facing, toward_eye, alpha);
        /* V·H = |L + V| / 2 for unit vectors. */
        const double off = 1.0 - min_f64(0.5 * length, 1.0);
        const double grazing = off * (off * off * (off * off));
        for (int k = 0; k < 3; k++) {
            const double f0 = dielectric + (color[k] - dielectric) * metal;
            const double fresnel = f0 + (1.0 - f0) * grazing;
            const double diffuse = (1.0 - fresnel) * (1.0 - metal) * color[k];
            out[i][k] = (float)(out[i][k] + light[k] * at.facing * (diffuse + shine * fresnel));
        }
    }
}
