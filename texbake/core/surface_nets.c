/* The surface between the solid points of a grid and the others: a vertex in each cell that it
   passes, at the mean of where it crosses the cell's edges, and a quad around each such edge.

   Points are filled before until that border is a surface: no edge has four faces of it, and no point
   is where two parts of it touch. That is so where no cell has a face with two solid corners across
   from each other, and no cell has just two corners of one kind, across from each other.

   Based on: Sarah Gibson, "Constrained Elastic Surface Nets", MICCAI 1998, and S. F. F. Gibson,
   "Using Distance Maps for Accurate Surface Representation in Sampled Volumes", 1998; Longin Latecki,
   "3D Well-Composed Pictures", Graphical Models and Image Processing 59, 1997.

   Called from texbake/mesh/remeshing/solid.py. */

#include <math.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"
#include "voxel_grid.h"

static const float JUST_SOLID = -0.05f; /* field of a point that is filled */

/* Corners of the faces of a cell, in turn around each. */
static const uint8_t FACES[6][4] = {
    {0, 1, 3, 2}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 3, 7, 5}};

/* The corners of which one must be filled, 0 where the cell is as it should be. */
static unsigned corners_to_fill(unsigned corners)
{
    for (int face = 0; face < 6; face++) {
        const uint8_t *ids = FACES[face];
        const unsigned even = 1u << ids[0] | 1u << ids[2], odd = 1u << ids[1] | 1u << ids[3];
        if ((corners & (even | odd)) == even)
            return odd;
        if ((corners & (even | odd)) == odd)
            return even;
    }
    for (unsigned corner = 0; corner < 4; corner++) {
        const unsigned pair = 1u << corner | 1u << (7 - corner);
        if (corners == pair || corners == (ALL_SOLID & ~pair))
            return ALL_SOLID & ~corners;
    }
    return 0;
}

struct cells {
    struct arena *arena;
    int64_t *places, count, room;
};

static void add_cell(struct cells *cells, int64_t place)
{
    if (cells->count == cells->room) {
        int64_t *more = TAKE(cells->arena, int64_t, 2 * cells->room);
        memcpy(more, cells->places, (size_t)cells->count * sizeof *more);
        cells->places = more;
        cells->room *= 2;
    }
    cells->places[cells->count++] = place;
}

static void add_bad_cells(struct cells *cells, const struct solid_grid *grid)
{
    for (int64_t x = 0; x < grid->nx - 1; x++)
        for (int64_t y = 0; y < grid->ny - 1; y++)
            for (int64_t z = 0; z < grid->nz; z += 8) {
                if (are_uniform(grid, x, y, z))
                    continue;
                for (int64_t k = z; k < z + 8 && k < grid->nz - 1; k++)
                    if (corners_to_fill(cell_corners(grid, x, y, k)) != 0)
                        add_cell(cells, grid_place(grid, x, y, k));
            }
}

/* Fill points, those nearest to the solid first; return how many. */
EXPORT int64_t compose_well(
    int64_t n_slots, int64_t nx, int64_t ny, int64_t nz, int64_t width, int64_t height,
    int64_t depth, const int32_t slots[nx][ny][nz], bool solid[width][height][depth],
    float field[n_slots][512])
{
    OPEN_ARENA(arena);
    const struct solid_grid grid = {width, height, depth, &solid[0][0][0]};
    const struct blocks blocks = {ny, nz, &slots[0][0][0]};
    float *values = &field[0][0];
    struct cells cells = {arena, TAKE(arena, int64_t, 1 << 12), 0, 1 << 12};
    int64_t n_filled = 0;
    add_bad_cells(&cells, &grid);
    while (cells.count > 0) {
        const int64_t place = cells.places[--cells.count];
        const int64_t z = place % depth, y = place / depth % height, x = place / depth / height;
        const unsigned choices = corners_to_fill(cell_corners(&grid, x, y, z));
        if (choices == 0)
            continue;
        int64_t best = -1, best_place = -1;
        float least = INFINITY;
        for (unsigned corner = 0; corner < 8; corner++) {
            const int64_t in_blocks = place_in_blocks(
                &blocks, x + (corner >> 2), y + (corner >> 1 & 1), z + (corner & 1));
            const float value = in_blocks < 0 ? 1.0f : values[in_blocks];
            if ((choices >> corner & 1) && value < least) {
                least = value;
                best = corner;
                best_place = in_blocks;
            }
        }
        const int64_t fx = x + (best >> 2), fy = y + (best >> 1 & 1), fz = z + (best & 1);
        solid[fx][fy][fz] = true;
        if (best_place >= 0)
            values[best_place] = JUST_SOLID;
        n_filled++;
        for (int64_t corner = 0; corner < 8; corner++)
            add_cell(&cells, grid_place(&grid, fx - (corner >> 2), fy - (corner >> 1 & 1), fz - (corner & 1)));
    }
    close_arena(arena);
    return n_filled;
}

/* A vertex keeps this share of an edge's length from its ends, so that no two of them meet. */
static const double END_SHARE = 0.05;

/* Mark the solid points of planes start to stop - 1: by the field where there is one. */
EXPORT void mark_solid(
    int64_t n_slots, int64_t nx, int64_t ny, int64_t nz, int64_t width, int64_t height,
    int64_t depth, const int32_t slots[nx][ny][nz], const float field[n_slots][512],
    const uint8_t labels[width][height][depth], bool solid[width][height][depth], int64_t start,
    int64_t stop)
{
    const struct blocks blocks = {ny, nz, &slots[0][0][0]};
    const float *values = &field[0][0];
    for (int64_t x = start; x < stop; x++)
        for (int64_t y = 0; y < height; y++)
            for (int64_t z = 0; z < depth; z += BLOCK_SIDE) {
                const int64_t place = place_in_blocks(&blocks, x, y, z);
                for (int64_t k = 0; k < BLOCK_SIDE; k++)
                    solid[x][y][z + k] =
                        place < 0 ? labels[x][y][z + k] != OUTSIDE : values[place + k] <= 0.0f;
            }
}

/* Count the vertices and the quads of layers start to stop - 1. */
EXPORT void count_nets(
    int64_t width, int64_t height, int64_t depth, const bool solid[width][height][depth],
    int64_t n_vertices[width], int64_t n_quads[width], int64_t start, int64_t stop)
{
    const struct solid_grid grid = {width, height, depth, &solid[0][0][0]};
    for (int64_t x = start; x < stop; x++) {
        n_vertices[x] = n_quads[x] = 0;
        for (int64_t y = 0; x < width - 1 && y < height - 1; y++)
            for (int64_t z = 0; z < depth; z += 8) {
                if (are_uniform(&grid, x, y, z))
                    continue;
                for (int64_t k = z; k < z + 8 && k < depth - 1; k++) {
                    const unsigned corners = cell_corners(&grid, x, y, k), first = corners & 1;
                    n_vertices[x] += corners != 0 && corners != ALL_SOLID;
                    for (unsigned axis = 1; axis <= 4; axis *= 2)
                        n_quads[x] += (corners >> axis & 1) != first;
                }
            }
    }
}

struct net {
    struct solid_grid grid;
    struct blocks blocks;
    const float *field;
    const bool *thin;
};

/* The vertex of a cell; whether any of its solid corners belongs to a sheet. */
static bool place_vertex(
    const struct net *net, int64_t x, int64_t y, int64_t z, unsigned corners, double vertex[3])
{
    double values[8], sums[3] = {0.0, 0.0, 0.0}, count = 0.0;
    bool is_thin = false;
    for (int64_t corner = 0; corner < 8; corner++) {
        const int64_t place = place_in_blocks(
            &net->blocks, x + (corner >> 2), y + (corner >> 1 & 1), z + (corner & 1));
        const bool is_solid = corners >> corner & 1;
        values[corner] = place >= 0 ? net->field[place] : is_solid ? -1.0 : 1.0;
        is_thin = is_thin || (place >= 0 && is_solid && net->thin[place]);
    }
    for (int corner = 0; corner < 8; corner++)
        for (int axis = 0; axis < 3; axis++) {
            const int step = 4 >> axis, other = corner | step;
            if ((corner & step) || (corners >> corner & 1) == (corners >> other & 1))
                continue;
            const double along = values[corner] / (values[corner] - values[other]);
            const double share = clamp_f64(along, END_SHARE, 1.0 - END_SHARE);
            for (int k = 0; k < 3; k++)
                sums[k] += k == axis ? share : (corner >> (2 - k) & 1);
            count += 1.0;
        }
    vertex[0] = (double)x + sums[0] / count;
    vertex[1] = (double)y + sums[1] / count;
    vertex[2] = (double)z + sums[2] / count;
    return is_thin;
}

/* Number the cells of a layer that the surface passes, from `id` on. */
static void number_cells(
    const struct solid_grid *grid, int64_t x, int64_t id, int32_t *ids)
{
    for (int64_t y = 0; y < grid->ny - 1; y++)
        for (int64_t z = 0; z < grid->nz; z += 8) {
            if (are_uniform(grid, x, y, z))
                continue;
            for (int64_t k = z; k < z + 8 && k < grid->nz - 1; k++) {
                const unsigned corners = cell_corners(grid, x, y, k);
                if (corners != 0 && corners != ALL_SOLID)
                    ids[y * grid->nz + k] = (int32_t)id++;
            }
        }
}

/* The quad around the edge from a grid point along an axis, seen from outside. `above` and `below`
   are the vertices of the cells of the point's layer and of the one before. */
static void quad_around(
    const struct solid_grid *grid, int64_t y, int64_t z, int axis, bool is_solid,
    const int32_t *above, const int32_t *below, int32_t quad[4])
{
    const int64_t here = y * grid->nz + z, left = here - grid->nz;
    const int32_t rings[3][4] = {
        {above[left - 1], above[here - 1], above[here], above[left]},
        {below[here - 1], below[here], above[here], above[here - 1]},
        {below[left], above[left], above[here], below[here]}};
    for (int corner = 0; corner < 4; corner++)
        quad[corner] = rings[axis][is_solid ? corner : 3 - corner];
}

/* Write the vertices and quads of layers start to stop - 1. */
EXPORT int64_t build_nets(
    int64_t n_slots, int64_t nx, int64_t ny, int64_t nz, int64_t width, int64_t height,
    int64_t depth, int64_t n_vertices, int64_t n_quads, const int32_t slots[nx][ny][nz],
    const float field[n_slots][512], const bool thin[n_slots][512],
    const bool solid[width][height][depth], const int64_t vertex_starts[width + 1],
    const int64_t quad_starts[width + 1], double positions[n_vertices][3],
    bool is_thin[n_vertices], int32_t quads[n_quads][4], int64_t start, int64_t stop)
{
    OPEN_ARENA(arena);
    const struct net net = {
        {width, height, depth, &solid[0][0][0]}, {ny, nz, &slots[0][0][0]}, &field[0][0],
        &thin[0][0]};
    int32_t *above = TAKE(arena, int32_t, height * depth);
    int32_t *below = TAKE(arena, int32_t, height * depth);
    if (start > 0)
        number_cells(&net.grid, start - 1, vertex_starts[start - 1], above);
    for (int64_t x = start; x < min_i64(stop, width - 1); x++) {
        int32_t *swapped = below;
        below = above;
        above = swapped;
        number_cells(&net.grid, x, vertex_starts[x], above);
        int64_t vertex = vertex_starts[x], quad = quad_starts[x];
        for (int64_t y = 0; y < height - 1; y++)
            for (int64_t z = 0; z < depth; z += 8) {
                if (are_uniform(&net.grid, x, y, z))
                    continue;
                for (int64_t k = z; k < z + 8 && k < depth - 1; k++) {
                    const unsigned corners = cell_corners(&net.grid, x, y, k);
                    if (corners == 0 || corners == ALL_SOLID)
                        continue;
                    is_thin[vertex] = place_vertex(&net, x, y, k, corners, positions[vertex]);
                    vertex++;
                    for (int axis = 0; axis < 3; axis++)
                        if ((corners >> (4 >> axis) & 1) != (corners & 1))
                            quad_around(
                                &net.grid, y, k, axis, corners & 1, above, below, quads[quad++]);
                }
            }
    }
    close_arena(arena);
    return 0;
}
