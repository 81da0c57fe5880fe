/* Samples of a texture become rays, and what the rays hit becomes offsets from the samples.

   A ray starts outside the low-poly surface, goes through it at the sample, and on behind it.

   Called from texbake/baking/rays.py and texbake/baking/hits.py. */

#include "core.h"
#include "numbers.h"

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

/* Write the rays of samples. With `starts`, those of a cage, a ray starts at the point of the cage; else
   at the front distance along the normals. */
void cast_from_samples(
    int64_t n, int64_t n_vertices, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const double barycentrics[n][2], const double positions[n_vertices][3],
    OPTIONAL const double starts[n_vertices][3], const int32_t corners[n_faces][3],
    const double normals[n_normals][3], const int32_t normal_corners[n_faces][3], double front,
    double back, double origins[n][3], double directions[n][3], double lengths[n],
    double fronts[n])
{
    for (int64_t i = 0; i < n; i++) {
        const int32_t *face = corners[faces[i]], *at_face = normal_corners[faces[i]];
        const double b = barycentrics[i][0], c = barycentrics[i][1];
        const double weights[3] = {1.0 - b - c, b, c};
        double point[3], outward[3], square = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            point[axis] = mean_of(positions, face, weights, axis);
            outward[axis] = starts ? mean_of(starts, face, weights, axis) - point[axis]
                                   : mean_of(normals, at_face, weights, axis);
            square += outward[axis] * outward[axis];
        }
        double length = sqrt(square);
        /* A cage that touches the surface, or unit normals that cancel: there is no direction. */
        if (length < 1e-12) {
            length = face_normal(positions, face, outward);
            fronts[i] = starts ? 0.0 : front;
        } else {
            fronts[i] = starts ? length : front;
        }
        lengths[i] = length > 0.0 ? fronts[i] + back : 0.0;
        for (int axis = 0; axis < 3; axis++) {
            const double unit = length > 0.0 ? outward[axis] / length : 0.0;
            origins[i][axis] = point[axis] + fronts[i] * unit;
            directions[i][axis] = -unit;
        }
    }
}

/* Blend the directions of rays with the face normals and move their origins, in place. A ray that is
   neither turned nor moved keeps its numbers bit for bit, because its origin is computed in the same
   way as before. */
void reshape_rays(
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

/* Column and row of each sample in a grid over the texture, row 0 at the top, as a place of its ray. */
void place_samples(
    int64_t n, int64_t n_faces, const int32_t faces[n], const double barycentrics[n][2],
    const double corner_uvs[n_faces][3][2], int64_t n_columns, int64_t n_rows,
    int32_t places[n][2])
{
    for (int64_t i = 0; i < n; i++) {
        const double (*uvs)[2] = corner_uvs[faces[i]];
        const double b = barycentrics[i][0], c = barycentrics[i][1], a = 1.0 - b - c;
        const double u = a * uvs[0][0] + b * uvs[1][0] + c * uvs[2][0];
        const double v = a * uvs[0][1] + b * uvs[1][1] + c * uvs[2][1];
        /* Samples lie in the unit square, except for rounding. */
        places[i][0] = (int32_t)clamp_f64(u * n_columns, 0.0, n_columns - 1.0);
        places[i][1] = (int32_t)clamp_f64((1.0 - v) * n_rows, 0.0, n_rows - 1.0);
    }
}

/* Write weights in float32, and the offset from each sample to its hit in model units. */
void offsets_of_hits(
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
