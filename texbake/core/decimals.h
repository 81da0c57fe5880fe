/* Decimal numbers in text; see decimals.c. */

#pragma once

#include <stdbool.h>
#include <stdint.h>

/* Powers of ten that the table of powers of five is for. */
enum { LEAST_POWER = -128, MOST_POWER = 127, N_POWERS = MOST_POWER - LEAST_POWER + 1 };

/* Whether a byte is part of a word: no white space or control character, and no backslash. */
static inline bool is_in_word(uint8_t byte)
{
    return byte > 32 && byte != 92;
}

/* Read the word that begins at `*at`, and move `*at` to its end: white space, a backslash or `stop`.
   The value is NaN where `read_word` in texbake/mesh/files/source.py must read the word. */
double read_decimal(
    const uint8_t *text, int64_t stop, const uint64_t (*fives)[2], int64_t *at);
