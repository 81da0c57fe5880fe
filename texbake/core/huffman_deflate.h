/* Deflate blocks with Huffman codes of their own, and run lengths as the only repeats. */

#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "arena.h"

/* Bytes being written, from the lowest bit of each up. */
struct bit_stream {
    uint8_t *next;
    uint64_t bits;
    int n_bits; /* below 8 between calls */
};

/* Bytes that `deflate_block` may write for `n` bytes, at most. */
int64_t deflate_bound(int64_t n);

/* Append a block for `n` bytes, or several stored ones where codes would take more room. */
void deflate_block(
    struct arena *arena, struct bit_stream *stream, int64_t n, const uint8_t bytes[], bool is_last);

/* Fill up the last byte: at the end, or with an empty block that more blocks may follow. */
void end_deflate(struct bit_stream *stream, bool is_last);
