/* What a camera asks of a mesh: which vertices its faces use, how far these reach along directions,
   and which side of a face is seen.

   Called from texbake/mesh/mesh.py, texbake/rendering/camera.py and texbake/jobs/preview_scene.py. */

#include <math.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"

/* Mark the vertices that faces use. */
EXPORT void mark_used_vertices(
    int64_t n_faces, int64_t n_vertices, const int32_t faces[n_faces][3], bool used[n_vertices])
{
    for (int64_t face = 0; face < n_faces; face++)
        for (int corner = 0; corner < 3; corner++)
            used[faces[face][corner]] = true;
}

/* Write the greatest dot product of any marked point of a band with each direction; not finite where
   one of them is not. */
EXPORT int64_t find_extremes(
    int64_t n, int64_t n_directions, int64_t n_bands, const double points[n][3],
    const bool marked[n], const double directions[3][n_directions], int64_t band,
    double extremes[n_bands][n_directions], int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    double *found = TAKE(arena, double, n_directions);
    double *nothing = TAKE_ZEROS(arena, double, n_directions);
    const double *x = directions[0], *y = directions[1], *z = directions[2];
    for (int64_t k = 0; k < n_directions; k++)
        found[k] = -INFINITY;
    for (int64_t i = start; i < stop; i++) {
        if (!marked[i])
            continue;
        for (int64_t k = 0; k < n_directions; k++) {
            const double height = points[i][0] * x[k] + points[i][1] * y[k] + points[i][2] * z[k];
            found[k] = max_f64(found[k], height);
            nothing[k] += height - height;
        }
    }
    for (int64_t k = 0; k < n_directions; k++)
        extremes[band][k] = found[k] + nothing[k];
    close_arena(arena);
    return 0;
}

/* Write a number for each of some faces: above 0 if its front is seen from the eye, below 0 if its
   back is, and 0 if it is seen edge-on. */
EXPORT void measure_facing(
    int64_t n_vertices, int64_t n_faces, int64_t n, const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], const int32_t ids[n], const double eye[3], double facing[n])
{
    for (int64_t i = 0; i < n; i++) {
        double from[3], along[3], up[3];
        for (int k = 0; k < 3; k++) {
            from[k] = positions[faces[ids[i]][0]][k] - eye[k];
            along[k] = positions[faces[ids[i]][1]][k] - eye[k] - from[k];
            up[k] = positions[faces[ids[i]][2]][k] - eye[k] - from[k];
        }
        const double x = along[1] * up[2] - along[2] * up[1];
        const double y = along[2] * up[0] - along[0] * up[2];
        const double z = along[0] * up[1] - along[1] * up[0];
        facing[i] = -(x * from[0] + y * from[1] + z * from[2]);
    }
}
