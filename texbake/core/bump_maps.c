/* Bump maps: tilting normals by the slope of a height, and embossing light.

   texbake/rendering/effects/bump.py has the formulas and their sources.

   Called from texbake/rendering/effects/bump.py. */

#include <math.h>

#include "core.h"
#include "fragment_values.h"
#include "numbers.h"

/* Write the width of a pixel along the surface, for both axes. */
EXPORT void measure_pixel_steps(
    int64_t n_positions, int64_t n_faces, int64_t n, const double positions[n_positions][3],
    const int32_t faces[n_faces][3], const int32_t of_fragments[n], const float changes[n][4],
    double out[n][2])
{
    for (int64_t i = 0; i < n; i++) {
        const int32_t *corners = faces[of_fragments[i]];
        const double *a = positions[corners[0]], *b = positions[corners[1]];
        const double *c = positions[corners[2]];
        double right = 0.0, down = 0.0;
        for (int k = 0; k < 3; k++) {
            const double along = b[k] - a[k], up = c[k] - a[k];
            const double x = changes[i][0] * along + changes[i][1] * up;
            const double y = changes[i][2] * along + changes[i][3] * up;
            right += x * x;
            down += y * y;
        }
        out[i][0] = out[i][1] = sqrt(max_f64(right, down));
    }
}

/* A surface in its object's space, and the fragments on it. */
struct surface {
    const double (*positions)[3];
    const int32_t (*faces)[3];
    const double (*normals)[3];
    const int32_t (*normal_faces)[3];
    const double (*steps)[4]; /* growth of the weights per unit of u, then of v */
    const double (*to_object)[3];
    const int32_t *of_fragments;
    const double (*weights)[2];
    const float (*shading)[3];
    const bool *back_facing;
};

/* N, P_u, P_v, N_u and N_v at a fragment. */
struct frame {
    double n[3], p_u[3], p_v[3], n_u[3], n_v[3];
};

static inline double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Write a vector transformed by a matrix; return its length. */
static inline double turn(
    const double matrix[3][3], double x, double y, double z, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = matrix[k][0] * x + matrix[k][1] * y + matrix[k][2] * z;
    return sqrt(dot(out, out));
}

/* Keep a vector's part orthogonal to a unit vector, divided by `size`. */
static inline void keep_orthogonal(double vector[3], const double unit[3], double size)
{
    const double off = dot(vector, unit);
    for (int k = 0; k < 3; k++)
        vector[k] = (vector[k] - off * unit[k]) / size;
}

/* Write the frame at a fragment; return (P_u x P_v)·N, or 0 without a frame. */
static double find_frame(const struct surface *surface, int64_t i, struct frame *frame)
{
    const int32_t face = surface->of_fragments[i];
    const double side = surface->back_facing[i] ? -1.0 : 1.0;
    const float *normal = surface->shading[i];
    const double length = turn(surface->to_object, normal[0], normal[1], normal[2], frame->n);
    if (!(length > 0.0))
        return 0.0;
    const double *weights = surface->weights[i], *steps = surface->steps[face];
    const int32_t *corners = surface->faces[face], *others = surface->normal_faces[face];
    double squared = 0.0;
    for (int k = 0; k < 3; k++) {
        frame->n[k] *= side / length;
        const double from = surface->positions[corners[0]][k];
        double along = surface->positions[corners[1]][k] - from;
        double up = surface->positions[corners[2]][k] - from;
        frame->p_u[k] = steps[0] * along + steps[1] * up;
        frame->p_v[k] = steps[2] * along + steps[3] * up;
        const double first = surface->normals[others[0]][k];
        along = surface->normals[others[1]][k] - first;
        up = surface->normals[others[2]][k] - first;
        frame->n_u[k] = steps[0] * along + steps[1] * up;
        frame->n_v[k] = steps[2] * along + steps[3] * up;
        const double here = first + weights[0] * along + weights[1] * up;
        squared += here * here;
    }
    /* Only the derivative's part orthogonal to N turns the unit normal, divided by N's length. */
    const double size = squared > 0.0 ? sqrt(squared) : INFINITY;
    keep_orthogonal(frame->p_u, frame->n, 1.0);
    keep_orthogonal(frame->p_v, frame->n, 1.0);
    keep_orthogonal(frame->n_u, frame->n, size);
    keep_orthogonal(frame->n_v, frame->n, size);
    double across[3];
    cross(frame->p_u, frame->p_v, across);
    return dot(frame->n, across);
}

/* Write normals tilted by heights and their slopes; those without a frame stay. */
EXPORT void tilt_normals(
    int64_t n_positions, int64_t n_faces, int64_t n_normals, int64_t n,
    const double positions[n_positions][3], const int32_t faces[n_faces][3],
    const double normals[n_normals][3], const int32_t normal_faces[n_faces][3],
    const double steps[n_faces][4], const double to_object[3][3], const int32_t of_fragments[n],
    const double weights[n][2], const float shading[n][3], const bool back_facing[n],
    const double to_world[3][3], const double heights[n], const double slopes[n][2],
    const double back[3], float out[n][3])
{
    const struct surface surface = {
        positions, faces, normals, normal_faces, steps, to_object,
        of_fragments, weights, shading, back_facing};
    struct frame frame;
    for (int64_t i = 0; i < n; i++) {
        const double area = find_frame(&surface, i, &frame);
        if (area == 0.0 || !isfinite(area)) {
            for (int k = 0; k < 3; k++)
                out[i][k] = shading[i][k];
            continue;
        }
        for (int k = 0; k < 3; k++) {
            frame.p_u[k] += slopes[i][0] * frame.n[k] + heights[i] * frame.n_u[k];
            frame.p_v[k] += slopes[i][1] * frame.n[k] + heights[i] * frame.n_v[k];
        }
        double across[3], bumped[3];
        cross(frame.p_u, frame.p_v, across);
        turn(to_world, across[0], across[1], across[2], bumped);
        const double side = back_facing[i] != (area < 0.0) ? -1.0 : 1.0;
        write_normal(bumped[0], bumped[1], bumped[2], side, back, out[i]);
    }
}

/* Write the step (L_u, L_v) along the light, and its length; 0 where there is none. */
EXPORT void find_light_steps(
    int64_t n_positions, int64_t n_faces, int64_t n_normals, int64_t n, int64_t n_directions,
    const double positions[n_positions][3], const int32_t faces[n_faces][3],
    const double normals[n_normals][3], const int32_t normal_faces[n_faces][3],
    const double surface_steps[n_faces][4], const double to_object[3][3],
    const int32_t of_fragments[n], const double weights[n][2], const float shading[n][3],
    const bool back_facing[n], const float directions[n_directions][3],
    const double directions_to_object[3][3], const double steps[n][2], double shifts[n][2],
    double lengths[n])
{
    const struct surface surface = {
        positions, faces, normals, normal_faces, surface_steps, to_object,
        of_fragments, weights, shading, back_facing};
    struct frame frame;
    for (int64_t i = 0; i < n; i++) {
        shifts[i][0] = shifts[i][1] = lengths[i] = 0.0;
        const float *toward = directions[row_of(n_directions, i)];
        double light[3];
        const double size = turn(directions_to_object, toward[0], toward[1], toward[2], light);
        if (find_frame(&surface, i, &frame) == 0.0 || !(size > 0.0))
            continue;
        const double *u = frame.p_u, *v = frame.p_v;
        const double uu = dot(u, u), uv = dot(u, v), vv = dot(v, v);
        const double side = back_facing[i] ? -size : size;
        const double along = dot(light, u) / side, up = dot(light, v) / side;
        const double x = -(along * vv - up * uv) / (uu * vv - uv * uv);
        const double y = -(up * uu - along * uv) / (uu * vv - uv * uv);
        const double longest = max_f64(fabs(x) / steps[i][0], fabs(y) / steps[i][1]);
        if (0.0 < longest && longest < INFINITY) {
            lengths[i] = 0.5 / longest;
            shifts[i][0] = x * lengths[i];
            shifts[i][1] = y * lengths[i];
        }
    }
}

/* Convert slopes along the light, in the object's space, to what they add to N·L in the light's
   space; if `normalized`, divided by the length of the bent normal. Slopes without a frame are
   unchanged. */
EXPORT void bend_embossed(
    int64_t n_positions, int64_t n_faces, int64_t n_normals, int64_t n, int64_t n_directions,
    const double positions[n_positions][3], const int32_t faces[n_faces][3],
    const double normals[n_normals][3], const int32_t normal_faces[n_faces][3],
    const double surface_steps[n_faces][4], const double to_object[3][3],
    const int32_t of_fragments[n], const double weights[n][2], const float shading[n][3],
    const bool back_facing[n], const float directions[n_directions][3],
    const double directions_to_object[3][3], const double to_world[3][3],
    const double slopes[n][2], bool in_object, bool normalized, double lifts[n])
{
    const struct surface surface = {
        positions, faces, normals, normal_faces, surface_steps, to_object,
        of_fragments, weights, shading, back_facing};
    struct frame frame;
    for (int64_t i = 0; i < n; i++) {
        const float *toward = directions[row_of(n_directions, i)];
        double light[3], bent[3], turned[3];
        const double size = turn(directions_to_object, toward[0], toward[1], toward[2], light);
        const double area = find_frame(&surface, i, &frame);
        if (area == 0.0 || !isfinite(area) || !(size > 0.0))
            continue;
        const double *u = frame.p_u, *v = frame.p_v;
        const double uu = dot(u, u), uv = dot(u, v), vv = dot(v, v);
        const double along = (slopes[i][0] * vv - slopes[i][1] * uv) / (uu * vv - uv * uv);
        const double up = (slopes[i][1] * uu - slopes[i][0] * uv) / (uu * vv - uv * uv);
        for (int k = 0; k < 3; k++)
            bent[k] = frame.n[k] - along * u[k] - up * v[k];
        const double facing = dot_f32(shading[i], toward);
        const double side = back_facing[i] ? -1.0 : 1.0;
        double shift = 0.0, length;
        if (in_object) {
            shift = side * dot(frame.n, light) / size - facing;
            length = sqrt(dot(bent, bent));
        } else {
            const double stretch = turn(to_world, frame.n[0], frame.n[1], frame.n[2], turned);
            lifts[i] *= size / stretch;
            length = turn(to_world, bent[0], bent[1], bent[2], turned) / stretch;
        }
        lifts[i] += shift;
        if (normalized)
            lifts[i] = (facing + lifts[i]) / length - facing;
    }
}

/* Add the slope of a height along the light to diffuse light. */
EXPORT void add_embossed(
    int64_t n, int64_t n_directions, int64_t n_radiance, int64_t n_base, int64_t n_metalness,
    const float normals[n][3], const float directions[n_directions][3],
    const float radiance[n_radiance][3], const float base[n_base][3],
    const float metalness[n_metalness][1], const double lifts[n], float out[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const float *light = radiance[row_of(n_radiance, i)], *color = base[row_of(n_base, i)];
        const float facing = dot_f32(normals[i], directions[row_of(n_directions, i)]);
        if (facing > 0.0f) {
            const float metal = metalness[row_of(n_metalness, i)][0];
            const double added = max_f64(lifts[i], -facing) * (1.0 - metal);
            for (int k = 0; k < 3; k++)
                out[i][k] = (float)(out[i][k] + light[k] * color[k] * added);
        }
    }
}
