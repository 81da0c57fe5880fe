/* Barycentric interpolation at the points that rays hit: the values of the maps.

   Weights are float32; products of two float32 are rounded to float32.

   Called from texbake/baking/maps/of_hits.py, hits.py and channel_images.py. */

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "core.h"
#include "numbers.h"

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

#define BLOCK 64 /* points handled together, for vector instructions */

/* Points of faces, by coordinate: the weights of the corners, and the frames there. */
struct block {
    double a[BLOCK];
    float b[BLOCK], c[BLOCK];
    double normals[3][BLOCK], tangents[3][BLOCK], bitangents[3][BLOCK];
};

static void weigh(int n, const float (*barycentrics)[2], struct block *block)
{
    for (int k = 0; k < n; k++) {
        block->b[k] = barycentrics[k][0];
        block->c[k] = barycentrics[k][1];
        block->a[k] = 1.0 - block->b[k] - block->c[k];
    }
}

/* Write vectors divided by their lengths. */
static void write_rows(
    int n, const double *restrict x, const double *restrict y, const double *restrict z,
    const double *restrict lengths, float values[][3])
{
    float rows[3][BLOCK];
    for (int k = 0; k < n; k++) {
        rows[0][k] = (float)(x[k] / lengths[k]);
        rows[1][k] = (float)(y[k] / lengths[k]);
        rows[2][k] = (float)(z[k] / lengths[k]);
    }
    for (int k = 0; k < n; k++)
        for (int axis = 0; axis < 3; axis++)
            values[k][axis] = rows[axis][k];
}

/* Write unit normals at points of faces; zero where the normals of the corners cancel. */
EXPORT void interpolate_high_normals(
    int64_t n, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const float barycentrics[n][2], const float normals[n_normals][3],
    const int32_t corners[n_faces][3], float values[n][3])
{
    struct block block;
    for (int64_t start = 0; start < n; start += BLOCK) {
        const int n_here = (int)min_i64(n - start, BLOCK);
        float of_corners[3][3][BLOCK];
        weigh(n_here, barycentrics + start, &block);
        for (int k = 0; k < n_here; k++) {
            const int32_t *corner = corners[faces[start + k]];
            for (int each = 0; each < 3; each++)
                for (int axis = 0; axis < 3; axis++)
                    of_corners[axis][each][k] = normals[corner[each]][axis];
        }
        for (int axis = 0; axis < 3; axis++) {
            const float *restrict p = of_corners[axis][0], *restrict q = of_corners[axis][1];
            const float *restrict r = of_corners[axis][2];
            for (int k = 0; k < n_here; k++)
                block.normals[axis][k] =
                    block.a[k] * p[k] + block.b[k] * q[k] + block.c[k] * r[k];
        }
        const double *x = block.normals[0], *y = block.normals[1], *z = block.normals[2];
        double lengths[BLOCK];
        for (int k = 0; k < n_here; k++) {
            const double length = sqrt(x[k] * x[k] + y[k] * y[k] + z[k] * z[k]);
            lengths[k] = length == 0.0 ? 1.0 : length;
        }
        write_rows(n_here, x, y, z, lengths, values + start);
    }
}

/* Write normals, tangents and bitangents at points of one face, interpolated without renormalizing. */
static void frame_points(
    struct block *block, int first, int end, const double normals[3][3], const float tangents[3][4])
{
    const double sign = tangents[0][3], *restrict a = block->a;
    const float *restrict b = block->b, *restrict c = block->c;
    for (int axis = 0; axis < 3; axis++) {
        const double p = normals[0][axis], q = normals[1][axis], r = normals[2][axis];
        const float s = tangents[0][axis], t = tangents[1][axis], u = tangents[2][axis];
        double *restrict normal = block->normals[axis], *restrict tangent = block->tangents[axis];
        for (int k = first; k < end; k++) {
            normal[k] = a[k] * p + b[k] * q + c[k] * r;
            tangent[k] = a[k] * s + b[k] * t + c[k] * u;
        }
    }
    for (int axis = 0; axis < 3; axis++) {
        const int y = (axis + 1) % 3, z = (axis + 2) % 3;
        const double *restrict ny = block->normals[y], *restrict nz = block->normals[z];
        const double *restrict ty = block->tangents[y], *restrict tz = block->tangents[z];
        for (int k = first; k < end; k++)
            block->bitangents[axis][k] = sign * (ny[k] * tz[k] - nz[k] * ty[k]);
    }
}

/* End of the points that are on the same face as the first. */
static inline int end_of_run(const int32_t *faces, int first, int n)
{
    int end = first + 1;
    while (end < n && faces[end] == faces[first])
        end++;
    return end;
}

/* Turn vectors of the tangent space at points of faces into unit vectors of model space, in place;
   one that has no direction becomes the interpolated normal. */
EXPORT void from_tangent_space(
    int64_t n, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const float barycentrics[n][2], const float normals[n_normals][3],
    const int32_t corners[n_faces][3], const float tangents[n_faces][3][4], float values[n][3])
{
    struct block block;
    for (int64_t i = 0; i < n; i++) {
        const int32_t *corner = corners[faces[i]];
        double of_corners[3][3];
        for (int k = 0; k < 3; k++)
            for (int axis = 0; axis < 3; axis++)
                of_corners[k][axis] = normals[corner[k]][axis];
        weigh(1, barycentrics + i, &block);
        frame_points(&block, 0, 1, of_corners, tangents[faces[i]]);
        const double x = values[i][0], y = values[i][1], z = values[i][2];
        double vector[3], square = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            vector[axis] = x * block.tangents[axis][0] + y * block.bitangents[axis][0] +
                           z * block.normals[axis][0];
            square += vector[axis] * vector[axis];
        }
        if (square == 0.0) {
            for (int axis = 0; axis < 3; axis++) {
                vector[axis] = block.normals[axis][0];
                square += vector[axis] * vector[axis];
            }
        }
        const double length = square > 0.0 ? sqrt(square) : 1.0;
        for (int axis = 0; axis < 3; axis++)
            values[i][axis] = (float)(vector[axis] / length);
    }
}

/* Replace model-space vectors by those in the frames of a block, up to their lengths, and write what
   to divide them by. A singular frame gives (0, 0, 0), normalized (0, 0, 1). */
static void invert_frames(
    int n, const struct block *block, bool normalize, double vectors[3][BLOCK],
    double *restrict lengths)
{
    const double *restrict at_nx = block->normals[0], *restrict at_tx = block->tangents[0];
    const double *restrict at_bx = block->bitangents[0], *restrict at_ny = block->normals[1];
    const double *restrict at_ty = block->tangents[1], *restrict at_by = block->bitangents[1];
    const double *restrict at_nz = block->normals[2], *restrict at_tz = block->tangents[2];
    const double *restrict at_bz = block->bitangents[2];
    double *restrict to_x = vectors[0], *restrict to_y = vectors[1], *restrict to_z = vectors[2];
    const double up = normalize ? 1.0 : 0.0;
    double determinants[BLOCK];
    for (int k = 0; k < n; k++) {
        const double nx = at_nx[k], ny = at_ny[k], nz = at_nz[k], tx = at_tx[k], ty = at_ty[k];
        const double tz = at_tz[k], bx = at_bx[k], by = at_by[k], bz = at_bz[k];
        const double vx = to_x[k], vy = to_y[k], vz = to_z[k];
        /* Rows of the inverse, times the determinant: B x N, N x T, T x B. */
        const double determinant =
            (by * nz - bz * ny) * tx + (bz * nx - bx * nz) * ty + (bx * ny - by * nx) * tz;
        const double x =
            (by * nz - bz * ny) * vx + (bz * nx - bx * nz) * vy + (bx * ny - by * nx) * vz;
        const double y =
            (ny * tz - nz * ty) * vx + (nz * tx - nx * tz) * vy + (nx * ty - ny * tx) * vz;
        const double z =
            (ty * bz - tz * by) * vx + (tz * bx - tx * bz) * vy + (tx * by - ty * bx) * vz;
        to_x[k] = determinant == 0.0 ? 0.0 : x;
        to_y[k] = determinant == 0.0 ? 0.0 : y;
        to_z[k] = determinant == 0.0 ? up : z;
        determinants[k] = determinant == 0.0 ? up : determinant;
        lengths[k] = fabs(determinants[k]);
    }
    for (int k = 0; k < (normalize ? n : 0); k++)
        lengths[k] = sqrt(to_x[k] * to_x[k] + to_y[k] * to_y[k] + to_z[k] * to_z[k]);
    for (int k = 0; k < n; k++) {
        const double length = lengths[k] == 0.0 ? 1.0 : lengths[k];
        lengths[k] = determinants[k] < 0.0 ? -length : length;
    }
}

/* Express model-space vectors in the tangent space at points of faces, in place. */
EXPORT void to_tangent_space(
    int64_t n, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const float barycentrics[n][2], const double normals[n_normals][3],
    const int32_t corners[n_faces][3], const float tangents[n_faces][3][4], bool normalize,
    float values[n][3])
{
    struct block block;
    for (int64_t start = 0; start < n; start += BLOCK) {
        const int n_here = (int)min_i64(n - start, BLOCK);
        const int32_t *some = faces + start;
        weigh(n_here, barycentrics + start, &block);
        for (int first = 0, end; first < n_here; first = end) {
            end = end_of_run(some, first, n_here);
            double of_corners[3][3];
            for (int k = 0; k < 3; k++)
                memcpy(of_corners[k], normals[corners[some[first]][k]], sizeof of_corners[k]);
            frame_points(&block, first, end, of_corners, tangents[some[first]]);
        }
        double vectors[3][BLOCK], lengths[BLOCK];
        for (int k = 0; k < n_here; k++)
            for (int axis = 0; axis < 3; axis++)
                vectors[axis][k] = values[start + k][axis];
        invert_frames(n_here, &block, normalize, vectors, lengths);
        write_rows(n_here, vectors[0], vectors[1], vectors[2], lengths, values + start);
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
