/* Rays from one point against a tree of triangles: which of them hit nothing.

   Each box is tested against all of these rays at once, until so few are left below a node that each
   walks on alone. In a leaf, the planes through the start and the edges of the triangles are computed
   once. Then a ray takes one product per edge to leave out what it misses for certain, and the exact
   test of ray_walk.h decides about the others. Boxes and products are in float32, with bounds for
   its error, so that the results are the same on any processor.

   Based on: Wald, Slusallek, Benthin, Wagner, "Interactive Rendering with Coherent Ray Tracing",
   Computer Graphics Forum 20(3), 2001, for rays that share a start. */

#pragma once

#include "ray_walk.h"

#define FAN 64 /* rays of a hemisphere that are cast together: the bits of a mask */
#define FEW 6  /* rays that walk on alone */
/* A product of an edge's plane with a direction in float32 is off by less than this share of the
   product of its corners' distances (sums of coordinates): 8 roundings of 2^-24, with a margin. */
#define EDGE_ERROR 0x1p-20f

/* Rays from one point. */
struct fan {
    int n;
    uint64_t open; /* a bit for each ray that has hit nothing so far */
    double origin[3], length, directions[3][FAN];
    float start[3], slack; /* of the tests of boxes */
    float along[3][FAN], inverses[3][FAN];
};

/* The ray of a fan on one side (1 or -1) of the plane of its hemisphere. */
static inline struct single_ray ray_of(const struct fan *fan, int j, double side)
{
    struct single_ray ray = {.length = fan->length};
    for (int k = 0; k < 3; k++) {
        ray.origin[k] = fan->origin[k];
        ray.direction[k] = side * fan->directions[k][j];
    }
    return ray;
}

/* Let a fan start at an offset from a point, above a plane or, if negative, below it. */
static inline void place_fan(
    struct fan *fan, const struct ray_tree *tree, const double point[3], const double plane[3],
    double offset, double length)
{
    double reach = tree->size;
    for (int k = 0; k < 3; k++) {
        fan->origin[k] = point[k] + offset * plane[k];
        fan->start[k] = (float)fan->origin[k];
        reach = max_f64(reach, fabs(fan->origin[k]));
    }
    fan->slack = (float)(2.0 * SLACK * reach);
    fan->length = length;
}

/* Prepare the rays of a fan for the tests. */
static inline void open_fan(struct fan *fan)
{
    fan->open = ~(uint64_t)0 >> (FAN - fan->n);
    for (int k = 0; k < 3; k++)
        for (int j = 0; j < FAN; j++) {
            const float along = j < fan->n ? (float)fan->directions[k][j] : 0.0f;
            const float inverse = min_f32(1.0f / fabsf(along), (float)MOST_INVERSE);
            fan->along[k][j] = along;
            fan->inverses[k][j] = along < 0.0f ? -inverse : inverse;
        }
}

/* The rays of a mask that meet box `k` of a node, as bits. */
static inline uint64_t rays_in_box(
    const struct fan *restrict fan, const node boxes, int k, uint64_t mask)
{
    float low[3], high[3];
    for (int axis = 0; axis < 3; axis++) {
        low[axis] = boxes[axis][k] - fan->slack - fan->start[axis];
        high[axis] = boxes[3 + axis][k] + fan->slack - fan->start[axis];
    }
    const float *x = fan->inverses[0], *y = fan->inverses[1], *z = fan->inverses[2];
    uint64_t in_box = 0;
    for (int first = 0; first < FAN; first += WIDTH) {
        if (!(mask >> first & 0xff))
            continue;
        int32_t met[WIDTH];
        for (int lane = 0; lane < WIDTH; lane++) {
            const int j = first + lane;
            const float low_x = low[0] * x[j], low_y = low[1] * y[j], low_z = low[2] * z[j];
            const float high_x = high[0] * x[j], high_y = high[1] * y[j], high_z = high[2] * z[j];
            const float near = max_f32(
                max_f32(min_f32(low_x, high_x), min_f32(low_y, high_y)),
                max_f32(min_f32(low_z, high_z), 0.0f));
            const float far = min_f32(
                min_f32(max_f32(low_x, high_x), max_f32(low_y, high_y)), max_f32(low_z, high_z));
            met[lane] = near <= far ? -1 : 0;
        }
        in_box |= (uint64_t)mask_of(met) << first;
    }
    return in_box & mask;
}

/* Normals of the planes through the start of a fan and each edge of the triangles of a leaf. A ray meets
   a triangle ahead of its start only if its products with the three normals are at least `least`. */
struct edges {
    float normals[3][3][WIDTH], least[3][WIDTH];
};

static inline void find_edges(const double o[3], const leaf p, struct edges *edges)
{
    float(*n)[3][WIDTH] = edges->normals;
    for (int k = 0; k < WIDTH; k++) {
        const float ax = (float)(p[0][k] - o[0]), ay = (float)(p[1][k] - o[1]);
        const float az = (float)(p[2][k] - o[2]), bx = (float)(p[3][k] - o[0]);
        const float by = (float)(p[4][k] - o[1]), bz = (float)(p[5][k] - o[2]);
        const float cx = (float)(p[6][k] - o[0]), cy = (float)(p[7][k] - o[1]);
        const float cz = (float)(p[8][k] - o[2]);
        const float ux = by * cz - bz * cy, uy = bz * cx - bx * cz, uz = bx * cy - by * cx;
        const float a = fabsf(ax) + fabsf(ay) + fabsf(az), b = fabsf(bx) + fabsf(by) + fabsf(bz);
        const float c = fabsf(cx) + fabsf(cy) + fabsf(cz);
        /* Six times the volume between start and triangle: its sign tells which products are positive
           for a triangle ahead. If the sign is uncertain, the exact test decides. */
        const float volume = ax * ux + ay * uy + az * uz, side = volume < 0.0f ? -1.0f : 1.0f;
        const float more = fabsf(volume) > EDGE_ERROR * a * b * c ? 0.0f : INFINITY;
        n[0][0][k] = side * ux, n[0][1][k] = side * uy, n[0][2][k] = side * uz;
        n[1][0][k] = side * (cy * az - cz * ay), n[1][1][k] = side * (cz * ax - cx * az);
        n[1][2][k] = side * (cx * ay - cy * ax), n[2][0][k] = side * (ay * bz - az * by);
        n[2][1][k] = side * (az * bx - ax * bz), n[2][2][k] = side * (ax * by - ay * bx);
        edges->least[0][k] = -(EDGE_ERROR * (b * c) + more);
        edges->least[1][k] = -(EDGE_ERROR * (c * a) + more);
        edges->least[2][k] = -(EDGE_ERROR * (a * b) + more);
    }
}

/* Write -1 for each triangle that a ray may meet, and 0 for those that it misses for certain. */
static inline void find_met(
    const float n[restrict 3][3][WIDTH], const float least[restrict 3][WIDTH], float x, float y,
    float z, int32_t met[restrict WIDTH])
{
    for (int k = 0; k < WIDTH; k++) {
        const float u = x * n[0][0][k] + y * n[0][1][k] + z * n[0][2][k] - least[0][k];
        const float v = x * n[1][0][k] + y * n[1][1][k] + z * n[1][2][k] - least[1][k];
        const float w = x * n[2][0][k] + y * n[2][1][k] + z * n[2][2][k] - least[2][k];
        met[k] = min_f32(min_f32(u, v), w) >= 0.0f ? -1 : 0;
    }
}

/* Close the rays of a mask that hit a triangle of a leaf. */
static void test_leaf(struct fan *fan, const struct ray_tree *tree, int64_t at, uint64_t mask)
{
    struct edges edges;
    find_edges(fan->origin, tree->leaves[at], &edges);
    for (; mask; mask &= mask - 1) {
        const int j = __builtin_ctzll(mask);
        const float x = fan->along[0][j], y = fan->along[1][j], z = fan->along[2][j];
        int32_t met[WIDTH];
        find_met(edges.normals, edges.least, x, y, z, met);
        unsigned bits = mask_of(met);
        if (!bits)
            continue;
        struct walk walk;
        const struct single_ray ray = ray_of(fan, j, 1.0);
        start_walk(&walk, tree, &ray);
        for (; bits; bits &= bits - 1) {
            const double distance = distance_of(&walk, tree->leaves[at], __builtin_ctz(bits));
            if (distance >= 0.0 && distance <= fan->length) {
                fan->open &= ~((uint64_t)1 << j);
                break;
            }
        }
    }
}

/* Cast one ray of a fan into the triangles below a node. */
static inline void cast_below(struct fan *fan, const struct ray_tree *tree, struct place place, int j)
{
    struct walk walk;
    for (int axis = 0; axis < 3; axis++) {
        const bool descends = fan->inverses[axis][j] < 0.0f;
        const float slack = descends ? -fan->slack : fan->slack;
        walk.near[axis] = descends ? 3 + axis : axis;
        walk.far[axis] = descends ? axis : 3 + axis;
        walk.enters[axis] = fan->start[axis] + slack;
        walk.leaves[axis] = fan->start[axis] - slack;
        walk.inverse[axis] = fan->inverses[axis][j];
    }
    const float length = lengthened(fan->length);
    struct place stack[STACK] = {place};
    for (int depth = 1; depth > 0 && fan->open >> j & 1;) {
        place = stack[--depth];
        if (place.level < 0) {
            test_leaf(fan, tree, place.at, (uint64_t)1 << j);
            continue;
        }
        float nears[WIDTH];
        unsigned bits = meets(&walk, tree->levels[place.level][place.at], length, nears);
        for (; bits; bits &= bits - 1)
            stack[depth++] = (struct place){
                place.level - 1, place.at * WIDTH + __builtin_ctz(bits), 0.0f};
    }
}

/* Close the rays of a fan that hit a triangle within its length. */
static void cast_fan(struct fan *fan, const struct ray_tree *tree)
{
    struct {
        struct place place;
        uint64_t mask;
    } stack[STACK];
    open_fan(fan);
    stack[0].place = (struct place){tree->n_levels - 1, 0, 0.0f};
    stack[0].mask = fan->open;
    for (int depth = tree->n_levels > 0; depth > 0;) {
        const struct place place = stack[--depth].place;
        uint64_t mask = stack[depth].mask & fan->open;
        if (place.level < 0) {
            test_leaf(fan, tree, place.at, mask);
        } else if (__builtin_popcountll(mask) <= FEW) {
            for (; mask; mask &= mask - 1)
                cast_below(fan, tree, place, __builtin_ctzll(mask));
        } else {
            const float(*boxes)[WIDTH] = tree->levels[place.level][place.at];
            for (int k = 0; k < WIDTH; k++) {
                /* Where there is no child, the least coordinates are infinite. */
                const uint64_t met = boxes[0][k] < INFINITY ? rays_in_box(fan, boxes, k, mask) : 0;
                stack[depth].place = (struct place){place.level - 1, place.at * WIDTH + k, 0.0f};
                stack[depth].mask = met;
                depth += met != 0;
            }
        }
    }
}
