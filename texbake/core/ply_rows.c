/* Rows of a PLY element with lists in them.

   Called from texbake/mesh/files/ply_tables.py and texbake/mesh/streamed/source.py. */

#include <stddef.h>
#include <string.h>

#include "core.h"

/* The body of a file: bytes, or the numbers of a text. Its units are these. */
struct body {
    int64_t n;
    const uint8_t *bytes;  /* NULL for a text */
    const double *numbers; /* NULL for bytes */
    bool big_endian;
};

/* A number as an integer, and the least of all where it does not fit one. */
static int64_t to_integer(double number)
{
    return number >= -0x1p63 && number < 0x1p63 ? (int64_t)number : INT64_MIN;
}

/* Length of a list: an unsigned number of some units, less than eight. */
static int64_t read_count(const struct body *body, int64_t at, int64_t n_units)
{
    if (!body->bytes)
        return to_integer(body->numbers[at]);
    int64_t count = 0;
    for (int64_t i = 0; i < n_units; i++)
        count = count * 256 + body->bytes[at + (body->big_endian ? i : n_units - 1 - i)];
    return count;
}

/* Find the units and number of values of each property of each row. `layout` holds, for each
   property, the units of its count (0: no list), whether the count has a sign, and the units of a
   value. Returns the row that does not fit, or -1; writes where it or the last one ends. */
static int64_t walk_rows(
    const struct body *body, int64_t at, int64_t n_columns, int64_t n_rows,
    const int64_t (*layout)[3], int64_t *offsets, int64_t *sizes, int64_t *end)
{
    for (int64_t row = 0; row < n_rows; row++) {
        for (int64_t column = 0; column < n_columns; column++) {
            const int64_t count_size = layout[column][0], value_size = layout[column][2];
            int64_t n_values = 1;
            *end = at;
            if (count_size > 0) {
                if (count_size > body->n - at)
                    return row;
                n_values = read_count(body, at, count_size);
                if (layout[column][1] && n_values >> (8 * count_size - 1))
                    return row;
                at += count_size;
            }
            *end = at;
            if (n_values < 0 || n_values > (body->n - at) / value_size)
                return row;
            offsets[column * n_rows + row] = at;
            sizes[column * n_rows + row] = n_values;
            at += n_values * value_size;
        }
    }
    *end = at;
    return -1;
}

EXPORT int64_t walk_binary_rows(
    int64_t n, int64_t n_columns, int64_t n_rows, const uint8_t bytes[n], int64_t start,
    const int64_t layout[n_columns][3], bool big_endian, int64_t offsets[n_columns][n_rows],
    int64_t sizes[n_columns][n_rows], int64_t end[1])
{
    const struct body body = {n, bytes, NULL, big_endian};
    return walk_rows(&body, start, n_columns, n_rows, layout, *offsets, *sizes, end);
}

EXPORT int64_t walk_text_rows(
    int64_t n, int64_t n_columns, int64_t n_rows, const double numbers[n], int64_t start,
    const int64_t layout[n_columns][3], int64_t offsets[n_columns][n_rows],
    int64_t sizes[n_columns][n_rows], int64_t end[1])
{
    const struct body body = {n, NULL, numbers, false};
    return walk_rows(&body, start, n_columns, n_rows, layout, *offsets, *sizes, end);
}

/* Copy pieces of a body, whose units have a size in bytes, one after another. */
EXPORT void gather_pieces(
    int64_t n, int64_t n_pieces, int64_t n_gathered, const uint8_t bytes[n], int64_t unit_size,
    const int64_t offsets[n_pieces], const int64_t lengths[n_pieces], uint8_t gathered[n_gathered])
{
    for (int64_t piece = 0; piece < n_pieces; piece++) {
        const size_t size = (size_t)(lengths[piece] * unit_size);
        memcpy(gathered, bytes + offsets[piece] * unit_size, size);
        gathered += size;
    }
}

static int64_t read_integer(const uint8_t *at, int64_t size, bool big_endian)
{
    int64_t value = 0;
    for (int64_t i = 0; i < size; i++)
        value = value * 256 + at[big_endian ? i : size - 1 - i];
    return value;
}

/* Read rows of triangles of one size: the count of each is `count_size` bytes after `skipped` ones, and
   is followed by three indices of four bytes. False where a row is no triangle, or an index is out of
   range. */
EXPORT bool read_triangle_rows(
    int64_t n_bytes, int64_t n, const uint8_t rows[n_bytes], int64_t row_size, int64_t skipped,
    int64_t count_size, bool big_endian, int64_t n_vertices, int32_t faces[n][3])
{
    bool fits = true;
    for (int64_t row = 0; row < n; row++) {
        const uint8_t *at = rows + row * row_size + skipped;
        fits &= read_integer(at, count_size, big_endian) == 3;
        uint32_t indices[3];
        memcpy(indices, at + count_size, sizeof indices);
        for (int corner = 0; corner < 3; corner++) {
            if (big_endian)
                indices[corner] = (uint32_t)read_integer(at + count_size + 4 * corner, 4, true);
            fits &= indices[corner] < n_vertices;
            faces[row][corner] = (int32_t)indices[corner];
        }
    }
    return fits;
}
