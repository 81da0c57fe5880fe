/* Fills points of a grid until the border of the solid is a surface: no edge has four faces of it,
   and no point is where two parts of it touch.

   Based on: Longin Latecki, "3D Well-Composed Pictures", Graphical Models and Image Processing 59,
   1997. A grid is well-composed where no cell has a face with two solid corners across from each
   other, and no cell has just two corners of one kind, across from each other.

   Called from texbake/mesh/remeshing/solid.py. */

#include <math.h>

#include "arena.h"
#include "core.h"
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
