/* Exact unsigned distances to triangles at the points of a grid that are near them, in sparse blocks,
   and on which side of the surface the points next to it lie.

   A ball around a point that is as large as its distance from the surface holds no surface, so that
   all points in it lie on its side. Points that are seen only so from outside, and have solid behind
   the surface, are outside. Where both sides of a surface are outside, it is a sheet, and all points
   near it become part of the solid, which gives it a thickness.

   Based on: Sean Mauch, "Efficient Algorithms for Solving Static Hamilton-Jacobi Equations", 2003
   (each triangle visits the points near it). Departs from it in that the bounding box of the
   triangle is visited, because triangles are usually smaller than a voxel. Corners of triangles
   bound the distances first. Then a triangle is measured exactly only from points to which a disc
   around it, in float32, is nearer than the bound. So the order of triangles changes no distance.

   Called from texbake/mesh/remeshing/band.py and texbake/mesh/remeshing/solid.py. */

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "closest_on_triangle.h"
#include "core.h"
#include "numbers.h"
#include "voxel_grid.h"

/* Half the diagonal of a block's points. */
static const double BLOCK_RADIUS = 3.5 * 1.7320508075688772;
/* Least square of the sine of a triangle's angle, or else it has no normal. */
static const double SLIVER = 1e-10;
/* More than float32 rounds a distance from a corner, in voxels, and the square of one from a disc, as a
   share of the greatest that is looked at. */
static const float ROUNDING = 1e-4f, SLACK = 1e-4f;

struct patch {
    struct vector a, ab, ac;
    double radius;
    int64_t low[3], high[3]; /* grid points within reach, inclusive */
};

static struct patch patch_of(
    const double (*positions)[3], const int32_t face[3], double width, const int64_t sizes[3])
{
    struct patch patch;
    double least[3], most[3];
    for (int axis = 0; axis < 3; axis++) {
        least[axis] = most[axis] = positions[face[0]][axis];
        for (int corner = 1; corner < 3; corner++) {
            least[axis] = min_f64(least[axis], positions[face[corner]][axis]);
            most[axis] = max_f64(most[axis], positions[face[corner]][axis]);
        }
        patch.low[axis] = max_i64((int64_t)ceil(least[axis] - width), 0);
        patch.high[axis] = min_i64((int64_t)floor(most[axis] + width), sizes[axis] - 1);
    }
    patch.a = vector_at(positions[face[0]]);
    patch.ab = minus(vector_at(positions[face[1]]), patch.a);
    patch.ac = minus(vector_at(positions[face[2]]), patch.a);
    const struct vector size = {most[0] - least[0], most[1] - least[1], most[2] - least[2]};
    patch.radius = 0.5 * sqrt(dot(size, size));
    return patch;
}

/* The distance of a point; infinite where it is clearly greater than `most`. */
static double distance_to(const struct patch *patch, struct vector p, double most)
{
    const struct vector ap = minus(p, patch->a);
    if (is_beyond(patch->ab, patch->ac, ap, most * most))
        return INFINITY;
    return sqrt(closest_on_triangle(patch->ab, patch->ac, ap).squared);
}

/* Whether any point of a block may lie within a distance of the triangle. */
static bool may_reach(const struct patch *patch, const int64_t block[3], double width)
{
    if (patch->radius < BLOCK_SIDE)
        return true;
    const struct vector middle = {
        BLOCK_SIDE * (double)block[0] + 3.5, BLOCK_SIDE * (double)block[1] + 3.5,
        BLOCK_SIDE * (double)block[2] + 3.5};
    return distance_to(patch, middle, width + BLOCK_RADIUS) <= width + BLOCK_RADIUS;
}

/* Mark the blocks of layers start to stop - 1 along the first axis that have points near a triangle.
   The faces near layer i are those from starts[i] to starts[i + 1] of the list. */
EXPORT void mark_band_blocks(
    int64_t n_vertices, int64_t n_faces, int64_t n_listed, int64_t nx, int64_t ny, int64_t nz,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int32_t listed[n_listed], const int64_t starts[nx + 1], bool active[nx][ny][nz],
    double width, int64_t start, int64_t stop)
{
    const int64_t sizes[3] = {nx * BLOCK_SIDE, ny * BLOCK_SIDE, nz * BLOCK_SIDE};
    for (int64_t x = start; x < stop; x++)
        for (int64_t k = starts[x]; k < starts[x + 1]; k++) {
            const struct patch patch = patch_of(positions, faces[listed[k]], width, sizes);
            for (int64_t y = patch.low[1] >> 3; y <= patch.high[1] >> 3; y++)
                for (int64_t z = patch.low[2] >> 3; z <= patch.high[2] >> 3; z++)
                    if (!active[x][y][z])
                        active[x][y][z] = may_reach(&patch, (int64_t[3]){x, y, z}, width);
        }
}

/* A layer of blocks along the first axis. */
struct layer {
    int64_t x, nz, sizes[3];
    const int32_t *slots;
    float (*distances)[BLOCK_POINTS];
    double width;
};

static inline void lower_row(float row[BLOCK_SIDE], float across, float from_z)
{
#pragma GCC unroll 1 /* or else it is no loop any more when it comes to be vectorized */
    for (int k = 0; k < BLOCK_SIDE; k++) {
        const float dz = (float)k - from_z;
        row[k] = min_f32(row[k], across + dz * dz);
    }
}

/* Lower the squares of distances of a layer's points to those from a corner of a triangle. */
static void bound_points(const struct layer *layer, const double corner[3])
{
    int64_t low[3], high[3];
    for (int axis = 0; axis < 3; axis++) {
        const int64_t first = axis == 0 ? BLOCK_SIDE * layer->x : 0;
        const int64_t last = axis == 0 ? first + BLOCK_SIDE - 1 : layer->sizes[axis] - 1;
        low[axis] = max_i64((int64_t)ceil(corner[axis] - layer->width), first);
        high[axis] = min_i64((int64_t)floor(corner[axis] + layer->width), last);
    }
    for (int64_t z = low[2] >> 3; z <= high[2] >> 3; z++) {
        const float from_z = (float)(corner[2] - (double)(BLOCK_SIDE * z));
        for (int64_t y = low[1]; y <= high[1]; y++) {
            const int64_t slot = layer->slots[(y >> 3) * layer->nz + z];
            const float dy = (float)((double)y - corner[1]);
            for (int64_t x = low[0]; slot >= 0 && x <= high[0]; x++) {
                const float dx = (float)((double)x - corner[0]);
                float *row = layer->distances[slot] + ((x & 7) << 6 | (y & 7) << 3);
                lower_row(row, dx * dx + dy * dy, from_z);
            }
        }
    }
}

/* Bound the distances of a layer's points by those from the first corners of triangles and the width. */
static void bound_layer(
    const struct layer *layer, const double (*positions)[3], const int32_t (*faces)[3],
    const int32_t *listed, int64_t n_listed)
{
    const int64_t n_blocks = layer->sizes[1] / BLOCK_SIDE * layer->nz;
    const float width = (float)layer->width;
    for (int64_t block = 0; block < n_blocks; block++)
        for (int64_t k = 0; layer->slots[block] >= 0 && k < BLOCK_POINTS; k++)
            layer->distances[layer->slots[block]][k] = width * width;
    for (int64_t k = 0; k < n_listed; k++) {
        const int32_t vertex = faces[listed[k]][0];
        if (k == 0 || vertex != faces[listed[k - 1]][0])
            bound_points(layer, positions[vertex]);
    }
    for (int64_t block = 0; block < n_blocks; block++)
        for (int64_t k = 0; layer->slots[block] >= 0 && k < BLOCK_POINTS; k++) {
            float *distance = layer->distances[layer->slots[block]] + k;
            *distance = min_f32(width, sqrtf(*distance) + ROUNDING);
        }
}

/* A disc that holds a triangle, relative to the first point of a block. */
struct disc {
    float center[3], normal[3], radius;
};

/* The disc around the mean of a triangle's corners; the normal of a sliver is 0, for a ball. */
static struct disc disc_around(const struct patch *patch, const int64_t block[3])
{
    const struct vector middle = weighted(patch->ab, patch->ac, 1.0 / 3.0, 1.0 / 3.0);
    const struct vector to_b = minus(middle, patch->ab), to_c = minus(middle, patch->ac);
    const struct vector normal = cross(patch->ab, patch->ac);
    const double square = dot(normal, normal);
    const bool is_sliver =
        !(square > SLIVER * dot(patch->ab, patch->ab) * dot(patch->ac, patch->ac));
    const double scale = is_sliver ? 0.0 : 1.0 / sqrt(square);
    const double radius =
        sqrt(max_f64(dot(middle, middle), max_f64(dot(to_b, to_b), dot(to_c, to_c))));
    return (struct disc){
        {(float)(patch->a.x + middle.x - (double)(BLOCK_SIDE * block[0])),
         (float)(patch->a.y + middle.y - (double)(BLOCK_SIDE * block[1])),
         (float)(patch->a.z + middle.z - (double)(BLOCK_SIDE * block[2]))},
        {(float)(normal.x * scale), (float)(normal.y * scale), (float)(normal.z * scale)},
        (float)radius};
}

/* Find which points of a row may be nearer to a disc than their distances say. `across` is the square
   of the row's distance from the center, `rise` the part of the height above the disc that all share. */
static inline bool find_near(
    const struct disc *disc, float across, float rise, float slack, const float row[BLOCK_SIDE],
    int32_t near[BLOCK_SIDE])
{
    const float nz = disc->normal[2], cz = disc->center[2], radius = disc->radius;
    int32_t any = 0;
#pragma GCC unroll 1
    for (int k = 0; k < BLOCK_SIDE; k++) {
        const float dz = (float)k - cz, height = rise + dz * nz, level = height * height;
        const float aside = sqrtf(max_f32(across + dz * dz - level, 0.0f));
        const float apart = max_f32(aside - radius, 0.0f);
        near[k] = level + apart * apart < row[k] * row[k] + slack;
        any |= near[k];
    }
    return any;
}

/* Lower the distances of a block's points to those from one triangle. */
static void measure_block(
    const struct patch *patch, const int64_t block[3], double width, float *distances)
{
    int64_t low[3], high[3];
    for (int axis = 0; axis < 3; axis++) {
        low[axis] = max_i64(patch->low[axis] - BLOCK_SIDE * block[axis], 0);
        high[axis] = min_i64(patch->high[axis] - BLOCK_SIDE * block[axis], BLOCK_SIDE - 1);
    }
    const struct disc disc = disc_around(patch, block);
    const float reach = (float)width + disc.radius, slack = SLACK * (1.0f + reach) * (1.0f + reach);
    for (int64_t x = low[0]; x <= high[0]; x++)
        for (int64_t y = low[1]; y <= high[1]; y++) {
            float *row = distances + (x << 6 | y << 3);
            const float dx = (float)x - disc.center[0], dy = (float)y - disc.center[1];
            const float across = dx * dx + dy * dy;
            const float rise = dx * disc.normal[0] + dy * disc.normal[1];
            int32_t near[BLOCK_SIDE];
            if (across > reach * reach + slack || !find_near(&disc, across, rise, slack, row, near))
                continue;
            for (int64_t k = low[2]; k <= high[2]; k++) {
                const struct vector p = {
                    (double)(BLOCK_SIDE * block[0] + x), (double)(BLOCK_SIDE * block[1] + y),
                    (double)(BLOCK_SIDE * block[2] + k)};
                if (near[k])
                    row[k] = min_f32(row[k], (float)distance_to(patch, p, row[k]));
            }
        }
}

/* Measure the distances in the blocks of layers start to stop - 1, as far as `width`. */
EXPORT void measure_band(
    int64_t n_vertices, int64_t n_faces, int64_t n_listed, int64_t nx, int64_t ny, int64_t nz,
    int64_t n_slots, const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int32_t listed[n_listed], const int64_t starts[nx + 1],
    const int32_t slots[nx][ny][nz], float distances[n_slots][512], double width, int64_t start,
    int64_t stop)
{
    const int64_t sizes[3] = {nx * BLOCK_SIDE, ny * BLOCK_SIDE, nz * BLOCK_SIDE};
    for (int64_t x = start; x < stop; x++) {
        const struct layer layer = {
            x, nz, {sizes[0], sizes[1], sizes[2]}, &slots[x][0][0], distances, width};
        bound_layer(&layer, positions, faces, listed + starts[x], starts[x + 1] - starts[x]);
        for (int64_t k = starts[x]; k < starts[x + 1]; k++) {
            const struct patch patch = patch_of(positions, faces[listed[k]], width, sizes);
            for (int64_t y = patch.low[1] >> 3; y <= patch.high[1] >> 3; y++)
                for (int64_t z = patch.low[2] >> 3; z <= patch.high[2] >> 3; z++) {
                    const int64_t block[3] = {x, y, z};
                    if (slots[x][y][z] >= 0 && may_reach(&patch, block, width))
                        measure_block(&patch, block, width, distances[slots[x][y][z]]);
                }
        }
    }
}

/* Label the points within `depth` of the surface SHELL, in layers start to stop - 1. */
EXPORT void label_shell(
    int64_t nx, int64_t ny, int64_t nz, int64_t n_slots, int64_t width, int64_t height,
    int64_t depth, const int32_t slots[nx][ny][nz], const float distances[n_slots][512],
    uint8_t labels[width][height][depth], double greatest, int64_t start, int64_t stop)
{
    const struct blocks blocks = {ny, nz, &slots[0][0][0]};
    const float *values = &distances[0][0];
    for (int64_t x = BLOCK_SIDE * start; x < BLOCK_SIDE * stop; x++)
        for (int64_t y = 0; y < height; y++)
            for (int64_t z = 0; z < depth; z += BLOCK_SIDE) {
                const int64_t place = place_in_blocks(&blocks, x, y, z);
                for (int64_t k = 0; place >= 0 && k < BLOCK_SIDE; k++)
                    labels[x][y][z + k] = values[place + k] <= greatest ? SHELL : CORE;
            }
}

enum { REACH = 2 }; /* points whose balls are looked at, along each axis */
enum { SEEN_FROM_OUTSIDE = 1, SEEN_FROM_CORE = 2 };

struct shell {
    struct blocks blocks;
    int64_t sizes[3];
    const uint8_t *labels;
    const float *distances;
};

static uint8_t label_at(const struct shell *shell, int64_t x, int64_t y, int64_t z)
{
    return shell->labels[(x * shell->sizes[1] + y) * shell->sizes[2] + z];
}

/* From which sides a point of the shell is seen. */
static uint8_t sides_that_see(const struct shell *shell, int64_t x, int64_t y, int64_t z)
{
    uint8_t seen = 0;
    for (int64_t dx = -REACH; dx <= REACH; dx++)
        for (int64_t dy = -REACH; dy <= REACH; dy++)
            for (int64_t dz = -REACH; dz <= REACH; dz++) {
                const uint8_t label = label_at(shell, x + dx, y + dy, z + dz);
                const uint8_t side = label == OUTSIDE ? SEEN_FROM_OUTSIDE : SEEN_FROM_CORE;
                if (label == SHELL || (seen & side))
                    continue;
                const int64_t place =
                    place_in_blocks(&shell->blocks, x + dx, y + dy, z + dz);
                if (place < 0)
                    continue;
                const float distance = shell->distances[place];
                if ((float)(dx * dx + dy * dy + dz * dz) < distance * distance)
                    seen |= side;
            }
    return seen;
}

/* Find from which sides the points of blocks start to stop - 1 are seen. */
EXPORT void see_shell(
    int64_t n_slots, int64_t nx, int64_t ny, int64_t nz, int64_t width, int64_t height,
    int64_t depth, const int32_t slots[nx][ny][nz], const int32_t corners[n_slots][3],
    const float distances[n_slots][512], const uint8_t labels[width][height][depth],
    uint8_t seen[n_slots][512], int64_t start, int64_t stop)
{
    const struct shell shell = {
        {ny, nz, &slots[0][0][0]}, {width, height, depth}, &labels[0][0][0], &distances[0][0]};
    for (int64_t slot = start; slot < stop; slot++)
        for (int64_t k = 0; k < BLOCK_POINTS; k++) {
            const int64_t x = corners[slot][0] + (k >> 6), y = corners[slot][1] + (k >> 3 & 7);
            const int64_t z = corners[slot][2] + (k & 7);
            const uint8_t label = label_at(&shell, x, y, z);
            seen[slot][k] = label == OUTSIDE ? SEEN_FROM_OUTSIDE
                            : label == CORE  ? SEEN_FROM_CORE
                                             : sides_that_see(&shell, x, y, z);
        }
}

static bool has_core_near(
    const struct shell *shell, const uint8_t *seen, int64_t x, int64_t y, int64_t z)
{
    for (int64_t dx = -REACH; dx <= REACH; dx++)
        for (int64_t dy = -REACH; dy <= REACH; dy++)
            for (int64_t dz = -REACH; dz <= REACH; dz++) {
                const int64_t place =
                    place_in_blocks(&shell->blocks, x + dx, y + dy, z + dz);
                if (place >= 0 && seen[place] == SEEN_FROM_CORE)
                    return true;
            }
    return false;
}

/* The signed field at the points of blocks start to stop - 1, negative in the solid, and which of
   the points belong to a sheet. */
EXPORT void sign_shell(
    int64_t n_slots, int64_t nx, int64_t ny, int64_t nz, int64_t width, int64_t height,
    int64_t depth, const int32_t slots[nx][ny][nz], const int32_t corners[n_slots][3],
    const float distances[n_slots][512], const uint8_t labels[width][height][depth],
    const uint8_t seen[n_slots][512], float field[n_slots][512], bool thin[n_slots][512],
    double thickness, int64_t start, int64_t stop)
{
    const struct shell shell = {
        {ny, nz, &slots[0][0][0]}, {width, height, depth}, &labels[0][0][0], &distances[0][0]};
    for (int64_t slot = start; slot < stop; slot++)
        for (int64_t k = 0; k < BLOCK_POINTS; k++) {
            const int64_t x = corners[slot][0] + (k >> 6), y = corners[slot][1] + (k >> 3 & 7);
            const int64_t z = corners[slot][2] + (k & 7);
            const uint8_t label = label_at(&shell, x, y, z), sides = seen[slot][k];
            const float distance = distances[slot][k];
            thin[slot][k] = false;
            if (label == OUTSIDE || label == CORE) {
                field[slot][k] = label == OUTSIDE ? distance : -distance;
            } else if (sides == SEEN_FROM_CORE) {
                field[slot][k] = -distance;
            } else if (
                sides != (SEEN_FROM_OUTSIDE | SEEN_FROM_CORE)
                && has_core_near(&shell, &seen[0][0], x, y, z)) {
                field[slot][k] = sides == SEEN_FROM_OUTSIDE ? distance : -distance;
            } else {
                field[slot][k] = distance - (float)thickness;
                thin[slot][k] = true;
            }
        }
}
