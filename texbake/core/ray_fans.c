/* Fans of rays from points of a surface, cast 16 at a time, one direction after another.

   The queries of Embree are called by their addresses. That for occlusion is fastest ray by ray, since
   most rays either hit at once or hit nothing; that for the first hit, whose rays all continue to
   the far side, is fastest for the packet as a whole.

   Based on: Wald, Woop, Benthin, Johnson, Ernst, "Embree: A Kernel Framework for Efficient CPU Ray
   Tracing", 2014; Duff et al., "Building an Orthonormal Basis, Revisited", 2017, for the frames.

   Called from texbake/raycast/scene.py and texbake/baking/secondary_rays.py. */

#include <string.h>

#include "core.h"
#include "embree.h"
#include "numbers.h"

/* Columns of the results: texbake/raycast/fans.py. */
enum { OPEN, OPEN_DIRECTION, DEPTH = OPEN_DIRECTION + 3, N_COLUMNS };

/* Write two tangents, the axis and the plane of a fan into one of the columns of frames. */
static inline void write_frame(
    const float axis[3], const float plane[3], int64_t n_columns, float *column)
{
    const float x = axis[0], y = axis[1], z = axis[2], sign = z >= 0.0f ? 1.0f : -1.0f;
    const double a = -1.0 / (double)(sign + z), b = (double)(x * y) * a;
    column[0] = (float)(1.0 + (double)(sign * x * x) * a);
    column[n_columns] = (float)(sign * b);
    column[2 * n_columns] = -sign * x;
    column[3 * n_columns] = (float)b;
    column[4 * n_columns] = (float)(sign + (double)(y * y) * a);
    column[5 * n_columns] = -y;
    for (int k = 0; k < 3; k++) {
        column[(6 + k) * n_columns] = axis[k];
        column[(9 + k) * n_columns] = plane[k];
    }
}

/* Write the j-th direction of each fan. Below the plane, a direction is mirrored at it. */
static inline void write_directions(
    int64_t n, int64_t n_rays, const float *frames, const uint32_t *set_ids,
    const float (*sets)[3], int64_t j, float side, float *directions)
{
    for (int64_t i = 0; i < n; i++) {
        const float *direction = sets[set_ids[i] * n_rays + j], *frame = frames + i;
        const float x = direction[0], y = direction[1], z = direction[2];
        const float dx = x * frame[0] + y * frame[3 * n] + z * frame[6 * n];
        const float dy = x * frame[n] + y * frame[4 * n] + z * frame[7 * n];
        const float dz = x * frame[2 * n] + y * frame[5 * n] + z * frame[8 * n];
        const float height = dx * frame[9 * n] + dy * frame[10 * n] + dz * frame[11 * n];
        float below = min_f32(height, 0.0f);
        below += below;
        directions[i] = side * (dx - below * frame[9 * n]);
        directions[n + i] = side * (dy - below * frame[10 * n]);
        directions[2 * n + i] = side * (dz - below * frame[11 * n]);
    }
}

/* Sixteen fans, and the packet of their rays. */
struct fan_packet {
    int32_t valid[PACKET];
    float frames[12 * PACKET], sums[4][PACKET];
    uint32_t set_ids[PACKET];
};

/* Write where the rays start, and what stays the same for all of them. */
static void start_rays(
    struct ray_packet *packet, struct fan_packet *fans, int64_t n, const double (*points)[3],
    const float (*planes)[3], double offset)
{
    for (int64_t lane = 0; lane < n; lane++)
        for (int axis = 0; axis < 3; axis++)
            packet->origin[axis][lane] = (float)(points[lane][axis] + offset * planes[lane][axis]);
    for (int lane = 0; lane < PACKET; lane++) {
        packet->near[lane] = 0.0f;
        packet->time[lane] = 0.0f;
        packet->mask[lane] = INVALID;
        packet->flags[lane] = 0;
    }
    memset(fans->sums, 0, sizeof fans->sums);
}

/* Reset the rays to their full length and to no hit. */
static void set_length(struct ray_packet *packet, double length)
{
    for (int lane = 0; lane < PACKET; lane++) {
        packet->far[lane] = (float)length;
        packet->geometry[lane] = INVALID;
        packet->instance[lane] = INVALID;
    }
}

/* Count the rays that hit nothing, whose length Embree leaves unchanged, and sum them. */
static void add_open(const struct ray_packet *packet, struct fan_packet *fans)
{
    for (int lane = 0; lane < PACKET; lane++) {
        const float is_free = packet->far[lane] > 0.0f ? 1.0f : 0.0f;
        fans->sums[0][lane] += is_free;
        for (int axis = 0; axis < 3; axis++)
            fans->sums[1 + axis][lane] += is_free * packet->direction[axis][lane];
    }
}

/* Cast fans, and write what their rays meet; `sets` are sets of n_rays directions. Rays of length 0
   are not cast. */
void cast_fans(
    int64_t n, int64_t n_directions, const double points[n][3], const float axes[n][3],
    const float planes[n][3], const uint32_t set_ids[n], const float sets[n_directions][3],
    int64_t n_rays, double offset, double outer, double inner, uintptr_t scene,
    uintptr_t occluded, uintptr_t intersect, float results[n][5])
{
    _Alignas(64) struct ray_packet packet;
    _Alignas(64) struct fan_packet fans;
    memset(&packet, 0, sizeof packet);
    memset(&fans, 0, sizeof fans);
    struct query_arguments apart = {.feature_mask = ALL_FEATURES};
    struct query_arguments together = {.flags = COHERENT, .feature_mask = ALL_FEATURES};
    const packet_query is_occluded = (packet_query)occluded, first_hit = (packet_query)intersect;
    for (int64_t first = 0; first < n; first += PACKET) {
        const int64_t n_lanes = min_i64(n - first, PACKET);
        for (int64_t lane = 0; lane < PACKET; lane++) {
            fans.valid[lane] = lane < n_lanes ? -1 : 0;
            if (lane < n_lanes) {
                write_frame(axes[first + lane], planes[first + lane], PACKET, fans.frames + lane);
                fans.set_ids[lane] = set_ids[first + lane];
            }
        }
        if (outer > 0.0) {
            start_rays(&packet, &fans, n_lanes, points + first, planes + first, offset);
            for (int64_t j = 0; j < n_rays; j++) {
                write_directions(
                    PACKET, n_rays, fans.frames, fans.set_ids, sets, j, 1.0f,
                    packet.direction[0]);
                set_length(&packet, outer);
                is_occluded(fans.valid, (void *)scene, &packet, &apart);
                add_open(&packet, &fans);
            }
            for (int64_t lane = 0; lane < n_lanes; lane++) {
                float *result = results[first + lane];
                result[OPEN] = (float)(fans.sums[0][lane] / (double)n_rays);
                for (int axis = 0; axis < 3; axis++)
                    result[OPEN_DIRECTION + axis] =
                        fans.sums[0][lane] > 0.0f
                            ? (float)(fans.sums[1 + axis][lane] / (double)n_rays)
                            : axes[first + lane][axis];
            }
        }
        if (inner > 0.0) {
            start_rays(&packet, &fans, n_lanes, points + first, planes + first, -offset);
            for (int64_t j = 0; j < n_rays; j++) {
                write_directions(
                    PACKET, n_rays, fans.frames, fans.set_ids, sets, j, -1.0f,
                    packet.direction[0]);
                set_length(&packet, inner);
                first_hit(fans.valid, (void *)scene, &packet, &together);
                for (int lane = 0; lane < PACKET; lane++)
                    fans.sums[0][lane] += packet.far[lane];
            }
            for (int64_t lane = 0; lane < n_lanes; lane++)
                results[first + lane][DEPTH] = (float)(fans.sums[0][lane] / (double)n_rays);
        }
    }
}

/* One over the length of a vector, 0 for a zero vector. */
static double inverse_length(const double vector[3])
{
    const double square = vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2];
    return square > 0.0 ? 1.0 / sqrt(square) : 0.0;
}

/* Write the point, the shading normal and the face normal of each hit, in the local frame. */
void place_fans(
    int64_t n, int64_t n_vertices, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const float barycentrics[n][2], const double positions[n_vertices][3],
    const int32_t corners[n_faces][3], const double center[3], double scale,
    const float normals[n_normals][3], const int32_t normal_corners[n_faces][3],
    double points[n][3], float axes[n][3], float planes[n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const double b = barycentrics[i][0], c = barycentrics[i][1], a = 1.0 - b - c;
        const int32_t *corner = corners[faces[i]], *normal = normal_corners[faces[i]];
        const double *p = positions[corner[0]], *q = positions[corner[1]], *r = positions[corner[2]];
        double axis[3], plane[3];
        for (int x = 0; x < 3; x++) {
            const int y = (x + 1) % 3, z = (x + 2) % 3;
            points[i][x] = (a * p[x] + b * q[x] + c * r[x] - center[x]) * scale;
            axis[x] = a * normals[normal[0]][x] +
                      (double)(barycentrics[i][0] * normals[normal[1]][x]) +
                      (double)(barycentrics[i][1] * normals[normal[2]][x]);
            plane[x] = ((q[y] - p[y]) * scale) * ((r[z] - p[z]) * scale) -
                       ((q[z] - p[z]) * scale) * ((r[y] - p[y]) * scale);
        }
        const double to_axis = inverse_length(axis);
        double to_plane = inverse_length(plane);
        if (axis[0] * plane[0] + axis[1] * plane[1] + axis[2] * plane[2] < 0.0)
            to_plane = -to_plane;
        for (int x = 0; x < 3; x++) {
            axes[i][x] = (float)(axis[x] * to_axis);
            planes[i][x] = to_plane != 0.0 ? (float)(plane[x] * to_plane) : axes[i][x];
        }
    }
}
