/* Merging the samples of each pixel into fragments, one per visible triangle (multisampling).

   Based on: Akeley, "RealityEngine graphics", SIGGRAPH 1993.

   Called from texbake/rendering/fragments.py. */

#include "arena.h"
#include "core.h"
#include "numbers.h"
#include "objects.h"

/* Number of a pixel's triangles that a sample is compared with. A triangle that is seen again after
   more others than this gets a second fragment, which costs time and changes nothing else. */
enum { REMEMBERED = 8 };

struct samples {
    const int32_t *face_ids; /* triangle that each sample sees, -1 for none */
    int64_t n_columns;       /* of samples */
    int64_t side;            /* samples along one side of a pixel */
    bool merges;             /* samples of a pixel that see the same triangle into one fragment */
};

/* The triangles of one pixel. */
struct pixel {
    int64_t n_found;
    int32_t *faces;
    int64_t *slots;
    double (*sums)[3]; /* number of samples, sums of their columns and rows */
};

static struct pixel make_pixel(struct arena *arena, int64_t side)
{
    struct pixel made = {.n_found = 0};
    made.faces = TAKE(arena, int32_t, side * side);
    made.slots = TAKE(arena, int64_t, side * side);
    made.sums = take(arena, side * side, sizeof *made.sums);
    return made;
}

static inline int32_t first_face(const struct samples *samples, int64_t row, int64_t column)
{
    return samples->face_ids[row * samples->side * samples->n_columns + column * samples->side];
}

/* Collect the triangles of a pixel. */
static void collect(
    const struct samples *samples, int64_t row, int64_t column, struct pixel *pixel)
{
    const int64_t side = samples->side;
    int64_t n_found = 0;
    for (int64_t j = row * side; j < (row + 1) * side; j++) {
        for (int64_t i = column * side; i < (column + 1) * side; i++) {
            const int32_t face = samples->face_ids[j * samples->n_columns + i];
            if (face < 0)
                continue;
            const int64_t last = samples->merges ? max_i64(n_found - REMEMBERED, 0) : n_found;
            int64_t k = n_found - 1;
            while (k >= last && pixel->faces[k] != face)
                k--;
            if (k < last) {
                k = n_found++;
                pixel->faces[k] = face;
                pixel->sums[k][0] = pixel->sums[k][1] = pixel->sums[k][2] = 0.0;
            }
            pixel->sums[k][0] += 1.0;
            pixel->sums[k][1] += i + 0.5;
            pixel->sums[k][2] += j + 0.5;
        }
    }
    pixel->n_found = n_found;
}

/* Whether all samples of a pixel see the same triangle, or none does. */
static inline bool is_plain(const struct samples *samples, int64_t row, int64_t column)
{
    const int64_t side = samples->side;
    const int32_t face = first_face(samples, row, column);
    if (side == 1)
        return true;
    for (int64_t j = row * side; j < (row + 1) * side; j++)
        for (int64_t i = column * side; i < (column + 1) * side; i++)
            if (samples->face_ids[j * samples->n_columns + i] != face)
                return false;
    return samples->merges || face < 0;
}

/* Add the number of fragments of each object in some rows of pixels to `counts`. */
EXPORT int64_t count_fragments(
    int64_t height, int64_t width, int64_t n_objects, const int32_t face_ids[height][width],
    const int64_t starts[n_objects + 1], int64_t side, bool merges, int64_t first_row,
    int64_t stop_row, int64_t counts[n_objects])
{
    OPEN_ARENA(arena);
    const struct samples samples = {face_ids[0], width, side, merges};
    struct pixel pixel = make_pixel(arena, side);
    for (int64_t row = first_row; row < stop_row; row++) {
        for (int64_t column = 0; column < width / side; column++) {
            if (is_plain(&samples, row, column)) {
                const int32_t face = first_face(&samples, row, column);
                if (face >= 0)
                    counts[object_of(face, n_objects, starts)]++;
                continue;
            }
            collect(&samples, row, column, &pixel);
            for (int64_t k = 0; k < pixel.n_found; k++)
                counts[object_of(pixel.faces[k], n_objects, starts)]++;
        }
    }
    close_arena(arena);
    return 0;
}

/* Where fragments are written: those of object k go to nexts[k] and after. Places are those in the
   whole picture, which has `fine` x `fine` of these pixels in each of its own. */
struct fragments {
    int64_t left, top; /* of the first pixel, in pixels */
    double fine;
    int64_t n_objects;
    const int64_t *starts;
    int64_t *nexts;
    int32_t *faces, *pixels;
    float (*places)[2], *counts;
    int32_t *of_samples; /* begins at the first row of the call; NULL: not wanted */
};

static inline int64_t put_fragment(
    const struct fragments *made, int32_t face, int64_t pixel, double count, double x, double y)
{
    const int64_t slot = made->nexts[object_of(face, made->n_objects, made->starts)]++;
    made->faces[slot] = face;
    made->pixels[slot] = (int32_t)pixel;
    made->counts[slot] = (float)count;
    made->places[slot][0] = (float)(x / made->fine);
    made->places[slot][1] = (float)(y / made->fine);
    return slot;
}

/* The one fragment of a pixel whose samples all see the same triangle. */
static inline void list_plain(
    const struct samples *samples, int64_t row, int64_t column, int64_t first_row, int32_t face,
    const struct fragments *made)
{
    const int64_t side = samples->side, n_columns = samples->n_columns;
    const int64_t pixel = row * (n_columns / side) + column;
    const int64_t slot = put_fragment(
        made, face, pixel, side * side, made->left + column + 0.5, made->top + row + 0.5);
    if (!made->of_samples)
        return;
    int32_t *square = made->of_samples + (row - first_row) * side * n_columns + column * side;
    for (int64_t j = 0; j < side; j++)
        for (int64_t i = 0; i < side; i++)
            square[j * n_columns + i] = (int32_t)slot;
}

/* Write the fragment of each sample of a pixel. */
static void note_samples(
    const struct samples *samples, int64_t row, int64_t column, int64_t first_row,
    const struct pixel *pixel, int32_t *of_samples)
{
    const int64_t side = samples->side, n_columns = samples->n_columns;
    int64_t first = 0;
    for (int64_t j = row * side; j < (row + 1) * side; j++) {
        for (int64_t i = column * side; i < (column + 1) * side; i++) {
            const int32_t face = samples->face_ids[j * n_columns + i];
            if (face < 0)
                continue;
            int64_t k = first;
            while (pixel->faces[k] != face)
                k++;
            of_samples[(j - first_row * side) * n_columns + i] = (int32_t)pixel->slots[k];
            if (!samples->merges) /* the next sample is the next fragment */
                first = k + 1;
        }
    }
}

/* The fragments of a pixel that sees several triangles, at mean positions of their samples. */
static void list_mixed(
    const struct samples *samples, int64_t row, int64_t column, int64_t first_row,
    struct pixel *pixel, const struct fragments *made)
{
    const int64_t side = samples->side;
    const int64_t id = row * (samples->n_columns / side) + column;
    collect(samples, row, column, pixel);
    for (int64_t k = 0; k < pixel->n_found; k++) {
        const double *sum = pixel->sums[k];
        /* Sums of halves are exact, so that the means do not depend on where the part begins. */
        const double left = sum[0] * (double)(made->left * side);
        const double top = sum[0] * (double)(made->top * side);
        const double x = (sum[1] + left) / (sum[0] * side), y = (sum[2] + top) / (sum[0] * side);
        pixel->slots[k] = put_fragment(made, pixel->faces[k], id, sum[0], x, y);
    }
    if (made->of_samples)
        note_samples(samples, row, column, first_row, pixel, made->of_samples);
}

/* List the fragments of some rows of pixels: those of object k go to nexts[k] and after. The pixels
   may be cells, fine x fine of each pixel of a picture, and a part of it that begins at a column and
   a row. */
EXPORT int64_t list_fragments(
    int64_t height, int64_t width, int64_t n_objects, int64_t n, int64_t n_rows,
    const int32_t face_ids[height][width], const int64_t starts[n_objects + 1], int64_t side,
    bool merges, int64_t first_row, int64_t stop_row, int64_t left, int64_t top, int64_t fine,
    int64_t nexts[n_objects], int32_t faces[n], float places[n][2], int32_t pixels[n],
    float counts[n],
    OPTIONAL int32_t of_samples[n_rows][width])
{
    OPEN_ARENA(arena);
    const struct samples samples = {face_ids[0], width, side, merges};
    const struct fragments made = {
        left, top, (double)fine, n_objects, starts, nexts, faces, pixels, places, counts,
        (int32_t *)of_samples};
    struct pixel pixel = make_pixel(arena, side);
    for (int64_t row = first_row; row < stop_row; row++) {
        for (int64_t column = 0; column < width / side; column++) {
            if (!is_plain(&samples, row, column)) {
                list_mixed(&samples, row, column, first_row, &pixel, &made);
                continue;
            }
            const int32_t face = first_face(&samples, row, column);
            if (face >= 0)
                list_plain(&samples, row, column, first_row, face, &made);
        }
    }
    close_arena(arena);
    return 0;
}
