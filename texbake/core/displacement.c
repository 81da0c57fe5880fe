/* Displacement: measuring the edges of a subdivided surface, and moving its vertices.

   Based on: the sources given in texbake/rendering/displaced.py.

   Called from texbake/rendering/displaced.py. */

#include <math.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"

/* Write the mean of the values at both ends of each edge. */
EXPORT void take_middles(
    int64_t n_values, int64_t n, const double values[n_values][3], const int32_t ends[n][2],
    double out[restrict n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const double *a = values[ends[i][0]], *b = values[ends[i][1]];
        for (int k = 0; k < 3; k++)
            out[i][k] = 0.5 * (a[k] + b[k]);
    }
}

/* Write points displaced by the mean of their values: by vectors where there are three channels,
   else along the normal. */
EXPORT int64_t move_vertices(
    int64_t n_places, int64_t n_channels, int64_t n, const int32_t vertices[n_places],
    const double values[n_places][n_channels], const double points[n][3],
    const double normals[n][3], const double linear[3][3], double out[n][3])
{
    OPEN_ARENA(arena);
    int32_t *counts = TAKE_ZEROS(arena, int32_t, n);
    for (int64_t i = 0; i < n; i++)
        out[i][0] = out[i][1] = out[i][2] = 0.0;
    for (int64_t i = 0; i < n_places; i++) {
        counts[vertices[i]]++;
        for (int64_t k = 0; k < n_channels; k++)
            out[vertices[i]][k] += values[i][k];
    }
    for (int64_t i = 0; i < n; i++) {
        const double x = normals[i][0], y = normals[i][1], z = normals[i][2];
        const double length = sqrt(x * x + y * y + z * z);
        double way[3];
        for (int k = 0; k < 3; k++) {
            if (n_channels == 3)
                way[k] = out[i][k] / counts[i];
            else
                way[k] = out[i][0] / counts[i] * (length > 0.0 ? normals[i][k] / length : 0.0);
        }
        for (int k = 0; k < 3; k++) {
            const double *row = linear[k];
            out[i][k] = points[i][k] + (row[0] * way[0] + row[1] * way[1] + row[2] * way[2]);
        }
    }
    close_arena(arena);
    return 0;
}

/* Raise the length of each edge, in texels, to the maximum over triangles not outside. Without
   `corners`, the base triangles on the map, there is no limit to the detail. */
EXPORT void measure_texel_lengths(
    int64_t n, int64_t n_base, int64_t n_points, int64_t n_edges, const int32_t faces[n][3],
    const int32_t face_edges[n][3], const int32_t base_faces[n], const float weights[n][3][2],
    OPTIONAL const double corners[n_base][3][2], const uint8_t outside[n_points],
    double lengths[n_edges])
{
    for (int64_t i = 0; i < n; i++) {
        if (outside[faces[i][0]] & outside[faces[i][1]] & outside[faces[i][2]])
            continue;
        for (int k = 0; k < 3; k++) {
            const int after = (k + 1) % 3;
            double length = INFINITY;
            if (corners) {
                const double *a = corners[base_faces[i]][0], *b = corners[base_faces[i]][1];
                const double *c = corners[base_faces[i]][2];
                const float *from = weights[i][k], *to = weights[i][after];
                const double along = to[0] - from[0], up = to[1] - from[1];
                const double x = along * (b[0] - a[0]) + up * (c[0] - a[0]);
                const double y = along * (b[1] - a[1]) + up * (c[1] - a[1]);
                length = sqrt(x * x + y * y);
            }
            double *longest = &lengths[face_edges[i][k]];
            *longest = max_f64(*longest, length);
        }
    }
}

/* Bits of the sides of the picture beyond whose margins a point lies. */
static uint8_t sides_passed(const double point[3], const double sides[5][4], const double margins[5])
{
    unsigned code = 0;
    for (int side = 0; side < 5; side++) {
        double inside = sides[side][3];
        for (int k = 0; k < 3; k++)
            inside += sides[side][k] * point[k];
        if (inside < -margins[side])
            code |= 1u << side;
    }
    return (uint8_t)code;
}

/* Write on which sides each vertex is outside the picture, its least depth, and its slant: the
   first on the surface only, the others also after displacement. */
EXPORT void view_vertices(
    int64_t n, const double points[n][3], const double positions[n][3], const double eye[3],
    const double back[3], double near, double steepest, const double sides[5][4],
    const double margins[5], uint8_t outside[n], double nearest[n], double slants[n],
    int64_t start, int64_t stop)
{
    for (int64_t i = start; i < stop; i++) {
        outside[i] = sides_passed(points[i], sides, margins);
        nearest[i] = INFINITY;
        slants[i] = 1.0;
        const double *places[2] = {points[i], positions[i]};
        for (int which = 0; which < 2; which++) {
            double depth = 0.0, squared = 0.0;
            for (int k = 0; k < 3; k++) {
                const double offset = eye[k] - places[which][k];
                depth += offset * back[k];
                squared += offset * offset;
            }
            if (depth > near) {
                nearest[i] = min_f64(nearest[i], depth);
                slants[i] = max_f64(slants[i], min_f64(sqrt(squared) / depth, steepest));
            } else {
                nearest[i] = near;
                slants[i] = steepest;
            }
        }
    }
}

/* Write the ratio of each edge's length to the allowed length; 0 for one within a texel. */
EXPORT void measure_excess(
    int64_t n, int64_t n_points, const int32_t ends[n][2], const double points[n_points][3],
    const double positions[n_points][3], const double nearest[n_points],
    const double slants[n_points], const double texels[n], double scale, double out[n],
    int64_t start, int64_t stop)
{
    for (int64_t edge = start; edge < stop; edge++) {
        out[edge] = 0.0;
        if (!(texels[edge] > 1.0))
            continue;
        const int32_t a = ends[edge][0], b = ends[edge][1];
        double along = 0.0, moved = 0.0;
        for (int k = 0; k < 3; k++) {
            const double before = points[a][k] - points[b][k];
            const double after = positions[a][k] - positions[b][k];
            along += before * before;
            moved += after * after;
        }
        const double length = sqrt(max_f64(along, moved));
        out[edge] = scale * length * max_f64(slants[a], slants[b])
                    / min_f64(nearest[a], nearest[b]);
    }
}
