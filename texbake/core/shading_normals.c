/* Shading normals of fragments: interpolated from those of the mesh, or taken from a normal map.

   texbake/rendering/effects/normals.py says how, and names the source.

   Called from texbake/rendering/effects/normals.py. */

#include <math.h>

#include "core.h"
#include "fragment_values.h"

/* Write the unit normal of each fragment, on the visible side. */
EXPORT void interpolate_normals(
    int64_t n_normals, int64_t n_faces, int64_t n, const double normals[n_normals][3],
    const int32_t corners[n_faces][3], const int32_t faces[n], const double weights[n][2],
    const bool back_facing[n], const double back[3], float out[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const int32_t *corner = corners[faces[i]];
        const double *a = normals[corner[0]], *b = normals[corner[1]], *c = normals[corner[2]];
        const double weight1 = weights[i][0], weight2 = weights[i][1];
        const double weight0 = 1.0 - weight1 - weight2;
        const double x = weight0 * a[0] + weight1 * b[0] + weight2 * c[0];
        const double y = weight0 * a[1] + weight1 * b[1] + weight2 * c[1];
        const double z = weight0 * a[2] + weight1 * b[2] + weight2 * c[2];
        write_normal(x, y, z, back_facing[i] ? -1.0 : 1.0, back, out[i]);
    }
}

/* Write the normals of a tangent-space map in world space. */
EXPORT void bend_normals(
    int64_t n_normals, int64_t n_faces, int64_t n, const double normals[n_normals][3],
    const int32_t corners[n_faces][3], const float tangents[n_faces][3][4], const int32_t faces[n],
    const double weights[n][2], const float texels[n][3], double strength,
    const bool back_facing[n], const double back[3], float out[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const int32_t *corner = corners[faces[i]];
        const float (*tangent)[4] = tangents[faces[i]];
        const double w1 = weights[i][0], w2 = weights[i][1], w0 = 1.0 - w1 - w2;
        double normal[3], along[3];
        for (int k = 0; k < 3; k++) {
            normal[k] = w0 * normals[corner[0]][k] + w1 * normals[corner[1]][k]
                        + w2 * normals[corner[2]][k];
            along[k] = w0 * tangent[0][k] + w1 * tangent[1][k] + w2 * tangent[2][k];
        }
        double x = strength * texels[i][0], y = strength * texels[i][1], z = texels[i][2];
        y *= tangent[0][3];
        const double squared = x * x + y * y + z * z;
        if (!(0.0 < squared && squared < INFINITY)) { /* no direction: use the surface normal */
            x = y = 0.0;
            z = 1.0;
        }
        const double nx = normal[0], ny = normal[1], nz = normal[2];
        const double tx = along[0], ty = along[1], tz = along[2];
        write_normal(
            x * tx + y * (ny * tz - nz * ty) + z * nx,
            x * ty + y * (nz * tx - nx * tz) + z * ny,
            x * tz + y * (nx * ty - ny * tx) + z * nz,
            back_facing[i] ? -1.0 : 1.0, back, out[i]);
    }
}

/* Write the normals of a map in another space, transformed by a matrix. */
EXPORT void turn_normals(
    int64_t n, const float texels[n][3], const double matrix[3][3], const bool back_facing[n],
    const double back[3], float out[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const double x = texels[i][0], y = texels[i][1], z = texels[i][2];
        write_normal(
            matrix[0][0] * x + matrix[0][1] * y + matrix[0][2] * z,
            matrix[1][0] * x + matrix[1][1] * y + matrix[1][2] * z,
            matrix[2][0] * x + matrix[2][1] * y + matrix[2][2] * z,
            back_facing[i] ? -1.0 : 1.0, back, out[i]);
    }
}
