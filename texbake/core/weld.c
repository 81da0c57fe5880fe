/* Rows that are equal, bit for bit, found by hashing.

   The rows are dealt into parts by the upper bits of their hash, and each part is welded by itself
   in a table that fits a processor's cache. So parts can run side by side, and the result is the
   same for any number of threads.

   The hash has random keys, so that no file can be made whose rows all fall into one place of the
   table. The result depends on the rows alone.

   Based on: Daniel Lemire, Owen Kaser, "Strongly Universal String Hashing is Fast", 2014 (sum of
   products with keys); Sebastiano Vigna, splitmix64, 2015 (its end mixes the sum).

   Called from texbake/mesh/weld.py. */

#include <string.h>

#include "arena.h"
#include "core.h"

/* Hash rows start to stop - 1. The last key stands alone, the others are factors of the columns. */
EXPORT void hash_rows(
    int64_t n, int64_t k, const uint32_t words[n][k], const uint64_t keys[k + 1], int64_t start,
    int64_t stop, uint32_t hashes[n])
{
    for (int64_t row = start; row < stop; row++) {
        uint64_t mixed = keys[k];
        for (int64_t column = 0; column < k; column++)
            mixed += words[row][column] * keys[column];
        mixed = (mixed ^ mixed >> 30) * 0xBF58476D1CE4E5B9u;
        mixed = (mixed ^ mixed >> 27) * 0x94D049BB133111EBu;
        hashes[row] = (uint32_t)(mixed >> 32);
    }
}

/* Weld the rows whose hash begins with the bits `part`, with open addressing and linear probing. */
EXPORT int64_t weld_part(
    int64_t n, int64_t k, const uint32_t words[n][k], const uint32_t hashes[n], int64_t part_bits,
    int64_t part, int32_t firsts[n])
{
    OPEN_ARENA(arena);
    const int64_t shift = 32 - part_bits;
    int64_t n_rows = 0, size = 2;
    for (int64_t row = 0; row < n; row++)
        n_rows += (int64_t)((uint64_t)hashes[row] >> shift) == part;
    while (size < 2 * n_rows)
        size *= 2;
    int32_t *table = TAKE(arena, int32_t, size);
    memset(table, 0xFF, (size_t)size * sizeof *table); /* -1 */
    for (int64_t row = 0; row < n; row++) {
        if ((int64_t)((uint64_t)hashes[row] >> shift) != part)
            continue;
        int64_t slot = hashes[row] & (size - 1);
        while (true) {
            const int32_t first = table[slot];
            if (first < 0) {
                table[slot] = firsts[row] = (int32_t)row;
                break;
            }
            if (hashes[first] == hashes[row]
                && memcmp(words[first], words[row], (size_t)k * sizeof(uint32_t)) == 0) {
                firsts[row] = first;
                break;
            }
            slot = (slot + 1) & (size - 1);
        }
    }
    close_arena(arena);
    return 0;
}
