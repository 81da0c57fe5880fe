/* Barycentric interpolation at the points that rays hit: the values of the maps.

   Weights are float32; products of two float32 are rounded to float32.

   Called from texbake/baking/maps/geometry.py, hits.py and channel_images.py. */

#include <math.h>

#include "core.h"

/* A value of three corners at the weights b and c of the second and third. */
static inline double mix_f64(float b, float c, double p, double q, double r)
{
    return (1.0 - b - c) * p + b * q + c * r;
}

static inline double mix_f32(float b, float c, float p, float q, float r)
{
    return (1.0 - b - c) * p + b * q + c * r;
}

/* Write values of corners, interpolated at points of faces. */
EXPORT void interpolate_corners(
    int64_t n, int64_t n_faces, int64_t n_values, int64_t n_channels, const int32_t faces[n],
    const float barycentrics[n][2], const float values[n_values][n_channels],
    const int32_t corners[n_faces][3], float found[n][n_channels])
{
    for (int64_t i = 0; i < n; i++) {
        const float b = barycentrics[i][0], c = barycentrics[i][1];
        const int32_t *corner = corners[faces[i]];
        const float *p = values[corner[0]], *q = values[corner[1]], *r = values[corner[2]];
        for (int64_t channel = 0; channel < n_channels; channel++)
            found[i][channel] = (float)mix_f32(b, c, p[channel], q[channel], r[channel]);
    }
}

/* Write unit normals at points of faces; zero where the normals of the corners cancel. */
EXPORT void interpolate_high_normals(
    int64_t n, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const float barycentrics[n][2], const float normals[n_normals][3],
    const int32_t corners[n_faces][3], float values[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const float b = barycentrics[i][0], c = barycentrics[i][1];
        const int32_t *corner = corners[faces[i]];
        const float *p = normals[corner[0]], *q = normals[corner[1]], *r = normals[corner[2]];
        const double x = mix_f32(b, c, p[0], q[0], r[0]);
        const double y = mix_f32(b, c, p[1], q[1], r[1]);
        const double z = mix_f32(b, c, p[2], q[2], r[2]);
        double length = sqrt(x * x + y * y + z * z);
        if (length == 0.0)
            length = 1.0;
        values[i][0] = (float)(x / length);
        values[i][1] = (float)(y / length);
        values[i][2] = (float)(z / length);
    }
}

struct frame {
    double n[3], t[3], b[3];
};

/* Normal, tangent and bitangent at a point of a face, interpolated without renormalizing. */
static struct frame frame_at(
    float b, float c, const double (*normals)[3], const int32_t *corners, const float (*tangents)[4])
{
    struct frame frame;
    const double *p = normals[corners[0]], *q = normals[corners[1]], *r = normals[corners[2]];
    for (int axis = 0; axis < 3; axis++) {
        frame.n[axis] = mix_f64(b, c, p[axis], q[axis], r[axis]);
        frame.t[axis] = mix_f32(b, c, tangents[0][axis], tangents[1][axis], tangents[2][axis]);
    }
    const double sign = tangents[0][3];
    const double *normal = frame.n, *t = frame.t;
    frame.b[0] = sign * (normal[1] * t[2] - normal[2] * t[1]);
    frame.b[1] = sign * (normal[2] * t[0] - normal[0] * t[2]);
    frame.b[2] = sign * (normal[0] * t[1] - normal[1] * t[0]);
    return frame;
}

/* Turn vectors of the tangent space at points of faces into unit vectors of model space, in place;
   one that has no direction becomes the interpolated normal. */
EXPORT void from_tangent_space(
    int64_t n, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const float barycentrics[n][2], const float normals[n_normals][3],
    const int32_t corners[n_faces][3], const float tangents[n_faces][3][4], float values[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const int32_t *corner = corners[faces[i]];
        double of_corners[3][3];
        for (int k = 0; k < 3; k++)
            for (int axis = 0; axis < 3; axis++)
                of_corners[k][axis] = normals[corner[k]][axis];
        const struct frame frame = frame_at(
            barycentrics[i][0], barycentrics[i][1], (const double (*)[3])of_corners,
            (const int32_t[3]){0, 1, 2}, tangents[faces[i]]);
        const double x = values[i][0], y = values[i][1], z = values[i][2];
        double vector[3], square = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            vector[axis] = x * frame.t[axis] + y * frame.b[axis] + z * frame.n[axis];
            square += vector[axis] * vector[axis];
        }
        if (square == 0.0) {
            for (int axis = 0; axis < 3; axis++) {
                vector[axis] = frame.n[axis];
                square += vector[axis] * vector[axis];
            }
        }
        const double length = square > 0.0 ? sqrt(square) : 1.0;
        for (int axis = 0; axis < 3; axis++)
            values[i][axis] = (float)(vector[axis] / length);
    }
}

/* Express model-space vectors in the tangent space at points of faces, in place. */
EXPORT void to_tangent_space(
    int64_t n, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const float barycentrics[n][2], const double normals[n_normals][3],
    const int32_t corners[n_faces][3], const float tangents[n_faces][3][4], bool normalize,
    float values[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const int32_t face = faces[i];
        const struct frame frame = frame_at(
            barycentrics[i][0], barycentrics[i][1], normals, corners[face], tangents[face]);
        const double nx = frame.n[0], ny = frame.n[1], nz = frame.n[2];
        const double tx = frame.t[0], ty = frame.t[1], tz = frame.t[2];
        const double bx = frame.b[0], by = frame.b[1], bz = frame.b[2];
        /* Rows of the inverse, times the determinant: B x N, N x T, T x B. */
        const double determinant =
            (by * nz - bz * ny) * tx + (bz * nx - bx * nz) * ty + (bx * ny - by * nx) * tz;
        if (determinant == 0.0) {
            values[i][0] = values[i][1] = 0.0F;
            values[i][2] = normalize ? 1.0F : 0.0F;
            continue;
        }
        const double vx = values[i][0], vy = values[i][1], vz = values[i][2];
        const double x =
            (by * nz - bz * ny) * vx + (bz * nx - bx * nz) * vy + (bx * ny - by * nx) * vz;
        const double y =
            (ny * tz - nz * ty) * vx + (nz * tx - nx * tz) * vy + (nx * ty - ny * tx) * vz;
        const double z =
            (ty * bz - tz * by) * vx + (tz * bx - tx * bz) * vy + (tx * by - ty * bx) * vz;
        double length = normalize ? sqrt(x * x + y * y + z * z) : fabs(determinant);
        if (length == 0.0)
            length = 1.0;
        length = determinant > 0.0 ? length : -length;
        values[i][0] = (float)(x / length);
        values[i][1] = (float)(y / length);
        values[i][2] = (float)(z / length);
    }
}

/* Write the lengths of offsets along the normals at points of faces. */
EXPORT void measure_displacements(
    int64_t n, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const float barycentrics[n][2], const float offsets[n][3], const double normals[n_normals][3],
    const int32_t corners[n_faces][3], float values[n][1])
{
    for (int64_t i = 0; i < n; i++) {
        const float b = barycentrics[i][0], c = barycentrics[i][1];
        const int32_t *corner = corners[faces[i]];
        const double *p = normals[corner[0]], *q = normals[corner[1]], *r = normals[corner[2]];
        double height = 0.0, square = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            const double normal = mix_f64(b, c, p[axis], q[axis], r[axis]);
            height += normal * offsets[i][axis];
            square += normal * normal;
        }
        values[i][0] = square > 0.0 ? (float)(height / sqrt(square)) : 0.0F;
    }
}

/* Write points of faces, moved by offsets. */
EXPORT void move_points(
    int64_t n, int64_t n_faces, int64_t n_vertices, const int32_t faces[n],
    const float barycentrics[n][2], const float offsets[n][3],
    const double positions[n_vertices][3], const int32_t corners[n_faces][3], float values[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const float b = barycentrics[i][0], c = barycentrics[i][1];
        const int32_t *corner = corners[faces[i]];
        const double *p = positions[corner[0]];
        const double *q = positions[corner[1]], *r = positions[corner[2]];
        for (int axis = 0; axis < 3; axis++) {
            /* From one corner, so that a coordinate that all three share stays exact. */
            const double along = b * (q[axis] - p[axis]) + c * (r[axis] - p[axis]);
            values[i][axis] = (float)(p[axis] + along + offsets[i][axis]);
        }
    }
}

/* Write texture coordinates at points of faces, after an affine transform. */
EXPORT void place_in_image(
    int64_t n, int64_t n_faces, int64_t n_uvs, const int32_t faces[n],
    const float barycentrics[n][2], const double uvs[n_uvs][2], const int32_t corners[n_faces][3],
    const double placing[2][3], double places[n][2])
{
    for (int64_t i = 0; i < n; i++) {
        const float b = barycentrics[i][0], c = barycentrics[i][1];
        const int32_t *corner = corners[faces[i]];
        const double *p = uvs[corner[0]], *q = uvs[corner[1]], *r = uvs[corner[2]];
        const double u = mix_f64(b, c, p[0], q[0], r[0]);
        const double v = mix_f64(b, c, p[1], q[1], r[1]);
        for (int row = 0; row < 2; row++)
            places[i][row] = placing[row][0] * u + placing[row][1] * v + placing[row][2];
    }
}
