/* Cells of texels: how they are divided, where their samples lie, and what is kept of them.

   A cell of level k is a square of which 4^k make up a texel; its spot is FINE times its row plus
   its column within the texel, both counted in cells of its level.

   Called from texel_sampler.py, texel_error.py and coverage.py of texbake/baking/adaptive_texels. */

#include "quadtree.h"

#include "core.h"
#include "edge_functions.h"
#include "numbers.h"

/* Texels along one side of the squares whose cells lie together, so that their rays do. */
enum { TILE = 8 };

/* Write the face that each cell's sample lies on, and where on it; see `cell_samples`. */
EXPORT void write_cell_samples(
    int64_t n_faces, int64_t n_bins, int64_t n_listed, int64_t n_texels, int64_t n,
    const int64_t corners[n_faces][3][2], const int64_t firsts[n_bins + 1],
    const int32_t faces[n_listed], int64_t n_columns, const uint8_t counts[n_texels],
    const int64_t masks[n_texels], int64_t level, int64_t width, const int32_t centers[n_texels],
    const int32_t texels[n], const uint8_t spots[n], int32_t owners[n], double weights[n][2])
{
    const struct face_bins bins = {corners, firsts, faces, n_columns};
    const struct coverage coverage = {counts, masks};
    const int64_t unit = TEXEL / PER_TEXEL;
    for (int64_t i = 0; i < n; i++) {
        const uint32_t texel = (uint32_t)texels[i];
        const struct sample_spot spot = sample_spot_of(&coverage, texel, level, spots[i]);
        owners[i] = NO_FACE;
        if (spot.x < 0)
            continue;
        const uint32_t row = texel / (uint32_t)width, column = texel - row * (uint32_t)width;
        int64_t x = column * (int64_t)TEXEL + spot.x * unit;
        int64_t y = row * (int64_t)TEXEL + spot.y * unit;
        /* Where faces overlap, all samples of a texel take the one that owns its center. */
        int32_t owner = centers[texel];
        if (owner == NO_FACE || !covers(corners[owner], x, y))
            owner = owner_at(&bins, x, y);
        if (owner == NO_FACE) {
            /* A gap narrower than a sub-square runs through the very center of the cell. */
            x -= unit;
            y -= unit;
            owner = owner_at(&bins, x, y);
        }
        owners[i] = owner;
        if (owner != NO_FACE)
            write_point_weights(corners[owner], x, y, weights[i]);
    }
}

/* Write four children of the level for each parent, from the place `first` on, and how many
   sub-squares of each are covered. */
EXPORT void write_children(
    int64_t n, int64_t n_texels, int64_t n_room, int64_t level, int64_t first,
    const int32_t places[n], const int32_t parent_texels[n], const uint8_t parent_spots[n],
    const uint8_t counts[n_texels], const int64_t masks[n_texels], int32_t children[n_room],
    int32_t texels[4 * n], uint8_t spots[4 * n], uint8_t weights[4 * n])
{
    const uint8_t whole = (uint8_t)(FULL >> (2 * level));
    for (int64_t i = 0; i < n; i++) {
        const int32_t texel = parent_texels[i];
        const int row = parent_spots[i] / FINE, column = parent_spots[i] % FINE;
        children[places[i]] = (int32_t)(first + 4 * i);
        for (int child = 0; child < 4; child++) {
            const int spot = (2 * row + child / 2) * FINE + 2 * column + child % 2;
            const int64_t at = 4 * i + child;
            texels[at] = texel;
            spots[at] = (uint8_t)spot;
            weights[at] = whole;
            if (counts[texel] != FULL)
                weights[at] = (uint8_t)submask_of(masks[texel], square_of(level, spot)).n;
        }
    }
}

/* Every other bit of a place along a Z-order curve. */
static int64_t every_other_bit(int64_t place)
{
    int64_t packed = 0;
    for (int bit = 0; 1 << bit < TILE; bit++)
        packed |= place >> bit & 1 << bit;
    return packed;
}

/* Write the ids of the chosen texels, tile by tile, and along a Z-order curve in each: so the cells of
   every level that are cast in one bundle follow each other. */
EXPORT void list_in_tiles(
    int64_t height, int64_t width, int64_t n, const bool chosen[height][width], int32_t ids[n])
{
    int64_t n_written = 0;
    for (int64_t top = 0; top < height; top += TILE)
        for (int64_t left = 0; left < width; left += TILE)
            for (int64_t place = 0; place < TILE * TILE; place++) {
                const int64_t row = top + every_other_bit(place >> 1);
                const int64_t column = left + every_other_bit(place);
                if (row < height && column < width && chosen[row][column])
                    ids[n_written++] = (int32_t)(row * width + column);
            }
}

/* Write the charts and values of samples to the places of their cells. */
EXPORT void keep_values(
    int64_t n, int64_t n_channels, int64_t n_room, int64_t n_kept, const int32_t places[n],
    const int32_t charts[n], const float values[n][n_channels], int64_t first_channel,
    int32_t kept_charts[n_room], float kept[n_room][n_kept])
{
    for (int64_t i = 0; i < n; i++) {
        kept_charts[places[i]] = charts[i];
        float *to = kept[places[i]] + first_channel;
        for (int64_t channel = 0; channel < n_channels; channel++)
            to[channel] = values[i][channel];
    }
}

/* Take over the samples of some cells of a level, whose places begin at `first`, from where they
   were cast before. Leaves the cells without any in `cells`; returns how many they are. */
EXPORT int64_t take_over_samples(
    int64_t n_level, int64_t n, int64_t n_room, int64_t n_channels,
    const int32_t origins[n_level], int64_t first, int32_t cells[n], bool is_cast[n_room],
    int32_t charts[n_room], float values[n_room][n_channels])
{
    int64_t n_left = 0;
    for (int64_t i = 0; i < n; i++) {
        const int64_t from = origins[cells[i]], to = first + cells[i];
        if (from == NO_CHILD || !is_cast[from]) {
            cells[n_left++] = cells[i];
            continue;
        }
        is_cast[to] = true;
        charts[to] = charts[from];
        for (int64_t channel = 0; channel < n_channels; channel++)
            values[to][channel] = values[from][channel];
    }
    return n_left;
}

/* Add the undivided cells of a level to their texels, each by how much of it is covered. */
EXPORT void add_leaves(
    int64_t n, int64_t n_room, int64_t n_channels, int64_t n_texels, int64_t first,
    const int32_t texels[n], const uint8_t weights[n], const int32_t children[n_room],
    const int32_t charts[n_room], const float values[n_room][n_channels],
    float sums[n_texels][n_channels], float areas[n_texels])
{
    for (int64_t i = 0; i < n; i++) {
        const int64_t place = first + i;
        if (children[place] != NO_CHILD || charts[place] == NO_CHART)
            continue;
        const float area = (float)weights[i];
        areas[texels[i]] += area;
        for (int64_t channel = 0; channel < n_channels; channel++)
            sums[texels[i]][channel] += area * values[place][channel];
    }
}
