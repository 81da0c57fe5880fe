/* The rows of a PNG file: predicted from their neighbors, and compressed.

   Each byte is stored as its difference from the one that Paeth predicts from the texels to the left,
   above and above left. On smooth maps this gives smaller files than the other filters of the format,
   and flat regions become zeros.

   Based on: Portable Network Graphics (PNG) Specification, third edition, W3C, 2025, section 9 (filter
   4, of Alan Paeth, "Image File Compression Made Easy", Graphics Gems II, 1991); RFC 1950, section
   8.2, for the checksum.

   Called from texbake/texture/png_files.py. */

#include <stdlib.h>
#include <string.h>

#include "arena.h"
#include "core.h"
#include "huffman_deflate.h"
#include "numbers.h"

enum {
    PAETH = 4,
    ADLER_MODULUS = 65521,
    ADLER_RUN = 5552, /* the most bytes whose sums fit into 32 bits */
    BLOCK_BYTES = 1 << 17,
};

/* Copy a row of samples, the high byte of each first. */
static void copy_big_endian(
    int64_t n, const uint8_t *restrict row, int64_t sample_bytes, uint8_t *restrict out)
{
    if (sample_bytes == 1) {
        memcpy(out, row, (size_t)n);
        return;
    }
    for (int64_t i = 0; i < n; i += 2) {
        out[i] = row[i + 1];
        out[i + 1] = row[i];
    }
}

/* Write differences from the bytes predicted. `row` and `above` have `step` zeros before them, the
   bytes of a texel. */
static void filter_paeth(
    int64_t n, int64_t step, const uint8_t *restrict row, const uint8_t *restrict above,
    uint8_t *restrict out)
{
    const uint8_t *restrict left = row - step, *restrict above_left = above - step;
    for (int64_t i = 0; i < n; i++) {
        const int16_t a = left[i], b = above[i], c = above_left[i];
        /* Distances of the three from a + b - c. */
        const int16_t to_a = (int16_t)abs(b - c), to_b = (int16_t)abs(a - c);
        const int16_t to_c = (int16_t)abs(a + b - 2 * c);
        const int16_t other = to_b <= to_c ? b : c;
        const int16_t predicted = to_a <= to_b && to_a <= to_c ? a : other;
        out[i] = (uint8_t)(row[i] - predicted);
    }
}

/* The two sums of Adler-32, continued over more bytes. */
static void add_to_adler(int64_t n, const uint8_t bytes[], uint32_t sums[2])
{
    for (int64_t start = 0; start < n; start += ADLER_RUN) {
        const int64_t size = min_i64(ADLER_RUN, n - start);
        const uint8_t *run = bytes + start;
        uint32_t low = 0, high = 0;
        for (int64_t i = 0; i < size; i++) {
            low += run[i];
            high += (uint32_t)(size - i) * run[i];
        }
        sums[1] = (sums[1] + (uint32_t)size * sums[0] + high) % ADLER_MODULUS;
        sums[0] = (sums[0] + low) % ADLER_MODULUS;
    }
}

static int64_t rows_of_block(int64_t row_bytes) { return max_i64(BLOCK_BYTES / (row_bytes + 1), 1); }

/* Bytes that `compress_png_rows` may write for so many rows, at most. */
EXPORT int64_t bound_png_rows(int64_t n_rows, int64_t row_bytes)
{
    const int64_t n_blocks = n_rows / rows_of_block(row_bytes) + 1;
    return deflate_bound(n_rows * (row_bytes + 1)) + n_blocks * deflate_bound(0);
}

/* Write whole deflate blocks for the rows `start` to `stop` into `out`; return their bytes. `checksum`
   gets the two sums of Adler-32 over these filtered rows alone. The processor's samples have their
   low byte first. */
EXPORT int64_t compress_png_rows(
    int64_t height, int64_t row_bytes, int64_t capacity, const uint8_t pixels[height][row_bytes],
    uint8_t out[capacity], uint32_t checksum[2], int64_t sample_bytes, int64_t texel_bytes,
    int64_t start, int64_t stop, bool is_last)
{
    OPEN_ARENA(arena);
    const int64_t step = texel_bytes, n_rows = rows_of_block(row_bytes);
    uint8_t *above = TAKE_ZEROS(arena, uint8_t, step + row_bytes) + step;
    uint8_t *row = TAKE_ZEROS(arena, uint8_t, step + row_bytes) + step;
    uint8_t *filtered = TAKE(arena, uint8_t, n_rows * (row_bytes + 1));
    struct bit_stream stream = {out, 0, 0};
    checksum[0] = 1;
    checksum[1] = 0;
    if (start > 0)
        copy_big_endian(row_bytes, pixels[start - 1], sample_bytes, above);
    for (int64_t first = start; first < stop; first += n_rows) {
        const int64_t last = min_i64(first + n_rows, stop);
        uint8_t *next = filtered;
        for (int64_t y = first; y < last; y++, next += row_bytes + 1) {
            copy_big_endian(row_bytes, pixels[y], sample_bytes, row);
            next[0] = PAETH;
            filter_paeth(row_bytes, step, row, above, next + 1);
            uint8_t *const other = above;
            above = row;
            row = other;
        }
        add_to_adler(next - filtered, filtered, checksum);
        deflate_block(
            arena, &stream, next - filtered, filtered, is_last && last == stop);
    }
    end_deflate(&stream, is_last);
    const int64_t n_bytes = stream.next - out;
    close_arena(arena);
    return n_bytes;
}
