/* Samples of a texture become rays, and what the rays hit becomes offsets from the samples.

   A ray starts outside the low-poly surface, passes through it at the sample, and continues behind
   it.

   Called from texbake/baking/rays.py and texbake/baking/hits.py. */

#include <stdbool.h>

#include "core.h"
#include "numbers.h"

#define BLOCK 64 /* samples handled together */

/* Mean of the rows of a face's corners, with the weights of a sample. */
static inline double mean_of(
    const double (*rows)[3], const int32_t corners[3], const double weights[3], int axis)
{
    return weights[0] * rows[corners[0]][axis] + weights[1] * rows[corners[1]][axis] +
           weights[2] * rows[corners[2]][axis];
}

/* Write the normal of a face, as long as twice its area, and return that length. */
static double face_normal(const double (*positions)[3], const int32_t corners[3], double normal[3])
{
    const double *a = positions[corners[0]], *b = positions[corners[1]], *c = positions[corners[2]];
    for (int axis = 0; axis < 3; axis++) {
        const int y = (axis + 1) % 3, z = (axis + 2) % 3;
        normal[axis] = (b[y] - a[y]) * (c[z] - a[z]) - (b[z] - a[z]) * (c[y] - a[y]);
    }
    return sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
}

/* Weights of the three corners of a face at samples. */
static void weigh(int n, const double (*barycentrics)[2], double weights[3][BLOCK])
{
    double *restrict a = weights[0], *restrict b = weights[1], *restrict c = weights[2];
    for (int k = 0; k < n; k++) {
        b[k] = barycentrics[k][0];
        c[k] = barycentrics[k][1];
        a[k] = 1.0 - b[k] - c[k];
    }
}

/* End of the samples that are on the same face as the first. */
static inline int end_of_run(const int32_t *faces, int first, int n)
{
    int end = first + 1;
    while (end < n && faces[end] == faces[first])
        end++;
    return end;
}

/* Samples that become rays together, by coordinate. */
struct block {
    double weights[3][BLOCK];
    double points[3][BLOCK], outward[3][BLOCK]; /* on the surface, and where a ray comes from */
    double lengths[BLOCK], fronts[BLOCK], backs[BLOCK];
};

/* Rows of a face's corners, and those of what its rays come from. */
struct corner_rows {
    const double *points[3], *outer[3];
};

/* Write the points and the outward vectors of samples from `first` up to `end`, which are on one face. */
static void mean_corners(
    struct block *block, int first, int end, const struct corner_rows *rows, bool from_starts)
{
    const double *restrict a = block->weights[0], *restrict b = block->weights[1];
    const double *restrict c = block->weights[2];
    for (int axis = 0; axis < 3; axis++) {
        const double p = rows->points[0][axis], q = rows->points[1][axis], r = rows->points[2][axis];
        const double o = rows->outer[0][axis], s = rows->outer[1][axis], t = rows->outer[2][axis];
        double *restrict point = block->points[axis], *restrict outward = block->outward[axis];
        for (int k = first; k < end; k++) {
            point[k] = a[k] * p + b[k] * q + c[k] * r;
            const double outer = a[k] * o + b[k] * s + c[k] * t;
            outward[k] = from_starts ? outer - point[k] : outer;
        }
    }
}

/* Write how long the outward vectors are, and how far in front of the surface the rays start. */
static void measure_outward(int n, struct block *block, bool from_starts, double front)
{
    const double *restrict x = block->outward[0], *restrict y = block->outward[1];
    const double *restrict z = block->outward[2];
    double *restrict lengths = block->lengths, *restrict fronts = block->fronts;
    for (int k = 0; k < n; k++) {
        lengths[k] = sqrt(x[k] * x[k] + y[k] * y[k] + z[k] * z[k]);
        fronts[k] = from_starts ? lengths[k] : front;
    }
}

/* Write how far behind the surface the rays end; with distances of each corner, also how far in front
   of it they start. */
static void set_reaches(
    int n, struct block *block, const int32_t *faces, const double (*reaches)[3][2], double back)
{
    for (int k = 0; k < n; k++)
        block->backs[k] = back;
    if (!reaches)
        return;
    for (int k = 0; k < n; k++) {
        const double (*of_corners)[2] = reaches[faces[k]];
        double reach[2];
        for (int side = 0; side < 2; side++)
            reach[side] = block->weights[0][k] * of_corners[0][side] +
                          block->weights[1][k] * of_corners[1][side] +
                          block->weights[2][k] * of_corners[2][side];
        block->fronts[k] = reach[0];
        block->backs[k] = reach[1];
    }
}

/* Make the outward vectors unit vectors, or zero where there is none, and move the points to where the
   rays start. */
static void start_outside(int n, struct block *block)
{
    const double *restrict lengths = block->lengths, *restrict fronts = block->fronts;
    for (int axis = 0; axis < 3; axis++) {
        double *restrict point = block->points[axis], *restrict outward = block->outward[axis];
        for (int k = 0; k < n; k++) {
            const double unit = outward[k] / lengths[k];
            outward[k] = lengths[k] > 0.0 ? unit : 0.0;
            point[k] += fronts[k] * outward[k];
        }
    }
}

/* Write the rays of samples. With `starts`, those of a cage, a ray starts at the point of the cage; else
   at the front distance along the normals, or at that of `reaches`, front and back at each corner. */
EXPORT void cast_from_samples(
    int64_t n, int64_t n_vertices, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const double barycentrics[n][2], const double positions[n_vertices][3],
    OPTIONAL const double starts[n_vertices][3], const int32_t corners[n_faces][3],
    const double normals[n_normals][3], const int32_t normal_corners[n_faces][3],
    OPTIONAL const double reaches[n_faces][3][2], double front, double back, double origins[n][3],
    double directions[n][3], double lengths[n], double fronts[n])
{
    struct block block;
    for (int64_t start = 0; start < n; start += BLOCK) {
        const int n_here = (int)min_i64(n - start, BLOCK);
        const int32_t *some = faces + start;
        weigh(n_here, barycentrics + start, block.weights);
        for (int first = 0, end; first < n_here; first = end) {
            end = end_of_run(some, first, n_here);
            struct corner_rows rows;
            for (int corner = 0; corner < 3; corner++) {
                const int32_t vertex = corners[some[first]][corner];
                rows.points[corner] = positions[vertex];
                rows.outer[corner] =
                    starts ? starts[vertex] : normals[normal_corners[some[first]][corner]];
            }
            mean_corners(&block, first, end, &rows, starts);
        }
        measure_outward(n_here, &block, starts, front);
        set_reaches(n_here, &block, some, reaches, back);
        for (int k = 0; k < n_here; k++) {
            /* A cage that touches the surface, or unit normals that cancel: there is no direction. */
            if (block.lengths[k] < 1e-12) {
                double normal[3];
                block.lengths[k] = face_normal(positions, corners[some[k]], normal);
                if (starts || !reaches)
                    block.fronts[k] = starts ? 0.0 : front;
                for (int axis = 0; axis < 3; axis++)
                    block.outward[axis][k] = normal[axis];
            }
        }
        start_outside(n_here, &block);
        for (int k = 0; k < n_here; k++) {
            for (int axis = 0; axis < 3; axis++) {
                origins[start + k][axis] = block.points[axis][k];
                directions[start + k][axis] = -block.outward[axis][k];
            }
            fronts[start + k] = block.fronts[k];
            lengths[start + k] = block.lengths[k] > 0.0 ? block.fronts[k] + block.backs[k] : 0.0;
        }
    }
}

/* Blend the directions of rays with the face normals and move their origins, in place. A ray that is
   neither turned nor moved keeps its numbers bit for bit, because its origin is computed in the same
   way as before. */
EXPORT void reshape_rays(
    int64_t n, int64_t n_vertices, int64_t n_faces, const int32_t faces[n],
    const double barycentrics[n][2], const double positions[n_vertices][3],
    const int32_t corners[n_faces][3], const float skew[n], const float offset[n],
    const double straight[n][3], double back, double origins[n][3], double directions[n][3],
    double lengths[n], double fronts[n])
{
    for (int64_t i = 0; i < n; i++) {
        const double weight = skew[i];
        if (weight > 0.0) {
            double blend[3], square = 0.0;
            for (int axis = 0; axis < 3; axis++) {
                blend[axis] = (1.0 - weight) * directions[i][axis] + weight * straight[i][axis];
                square += blend[axis] * blend[axis];
            }
            /* Where the blend cancels, and at full weight, the direction is that of the face. */
            const double length = weight < 1.0 ? sqrt(square) : 0.0;
            for (int axis = 0; axis < 3; axis++)
                directions[i][axis] = length > 0.0 ? blend[axis] / length : straight[i][axis];
        }
        fronts[i] *= (double)offset[i];
        if (lengths[i] > 0.0)
            lengths[i] = fronts[i] + back;
        const double b = barycentrics[i][0], c = barycentrics[i][1];
        const double weights[3] = {1.0 - b - c, b, c};
        for (int axis = 0; axis < 3; axis++)
            origins[i][axis] =
                mean_of(positions, corners[faces[i]], weights, axis) - fronts[i] * directions[i][axis];
    }
}

/* Write the places of samples that are on one face. */
static void place_on_face(
    int n, const double *restrict a, const double *restrict b, const double *restrict c,
    const double uvs[3][2], double n_columns, double n_rows, int32_t (*restrict places)[2])
{
    const double p = uvs[0][0], q = uvs[1][0], r = uvs[2][0];
    const double s = uvs[0][1], t = uvs[1][1], w = uvs[2][1];
    for (int k = 0; k < n; k++) {
        const double u = a[k] * p + b[k] * q + c[k] * r, v = a[k] * s + b[k] * t + c[k] * w;
        /* Samples lie in the unit square, except for rounding. */
        places[k][0] = (int32_t)clamp_f64(u * n_columns, 0.0, n_columns - 1.0);
        places[k][1] = (int32_t)clamp_f64((1.0 - v) * n_rows, 0.0, n_rows - 1.0);
    }
}

/* Write the column and row of each sample in a grid over the texture, row 0 at the top, and its chart, as
   the place of its ray. */
EXPORT void place_samples(
    int64_t n, int64_t n_faces, const int32_t faces[n], const double barycentrics[n][2],
    const double corner_uvs[n_faces][3][2], const int32_t charts[n_faces], int64_t n_columns,
    int64_t n_rows, int32_t places[n][2], int32_t place_charts[n])
{
    double weights[3][BLOCK];
    for (int64_t start = 0; start < n; start += BLOCK) {
        const int n_here = (int)min_i64(n - start, BLOCK);
        const int32_t *some = faces + start;
        weigh(n_here, barycentrics + start, weights);
        for (int first = 0, end; first < n_here; first = end) {
            end = end_of_run(some, first, n_here);
            place_on_face(
                end - first, weights[0] + first, weights[1] + first, weights[2] + first,
                corner_uvs[some[first]], (double)n_columns, (double)n_rows, places + start + first);
            for (int k = first; k < end; k++)
                place_charts[start + k] = charts[some[first]];
        }
    }
}

/* Write weights in float32, and the offset from each sample to its hit in model units. */
EXPORT void offsets_of_hits(
    int64_t n, const double sample_barycentrics[n][2], const double directions[n][3],
    const double fronts[n], const int32_t faces[n], const double barycentrics[n][2],
    const double distances[n], double scale, float low_barycentrics[n][2],
    float high_barycentrics[n][2], float offsets[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        for (int k = 0; k < 2; k++) {
            low_barycentrics[i][k] = (float)sample_barycentrics[i][k];
            high_barycentrics[i][k] = (float)barycentrics[i][k];
        }
        const double depth = faces[i] >= 0 ? (distances[i] - fronts[i]) / scale : 0.0;
        for (int axis = 0; axis < 3; axis++)
            offsets[i][axis] = (float)(directions[i][axis] * depth);
    }
}
