/* Decimal numbers in text to the nearest float64, exactly as Python's `float` reads them.

   Based on:
       W. D. Clinger, "How to read floating point numbers accurately", PLDI 1990
           (a short number is one exact float scaled by another);
       D. Lemire, "Number parsing at a gigabyte per second", Software: Practice and Experience 51(8),
           2021 (the Eisel-Lemire algorithm: up to 19 digits times a 128-bit power of five).

   Departs from the latter where the result is undecided or not a normal number, or the word is not a
   plain decimal: these are rare, and texbake/mesh/files/source.py leaves them to Python's `float`.

   Called from texbake/mesh/files/source.py and obj_rows.c. */

#include "decimals.h"

#include <math.h>

#include "core.h"

enum { MAX_DIGITS = 19 }; /* 10^19 - 1 still fits 64 bits */

static const double EXACT_TENS[] = { /* 10^22 is the last exact float64 */
    1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
    1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
enum { MOST_EXACT_TEN = sizeof EXACT_TENS / sizeof *EXACT_TENS - 1 };
static const uint64_t MOST_EXACT_INTEGER = 1ull << 53;

/* Below the 53 bits of the mantissa, the rounding bit and one more. */
static const uint64_t LOW_9_BITS = (1u << 9) - 1;

/* The float64 nearest to digits 10^power, by a power of five of 128 bits, or NaN where that is not
   settled. The digits are not 0. */
static double scale_long(uint64_t digits, int64_t power, const uint64_t five[2])
{
    int64_t leading = 0;
    for (int step = 32; step > 0; step /= 2) {
        if (digits >> (64 - step) == 0) {
            digits <<= step;
            leading += step;
        }
    }
    const unsigned __int128 product = (unsigned __int128)digits * five[0];
    uint64_t high = (uint64_t)(product >> 64), low = (uint64_t)product;
    if ((high & LOW_9_BITS) == LOW_9_BITS) { /* a carry from further down could change the rounding */
        const uint64_t carry = (uint64_t)((unsigned __int128)digits * five[1] >> 64);
        low += carry;
        high += low < carry;
    }
    if (low == UINT64_MAX)
        return NAN;
    const uint64_t upper = high >> 63, shift = upper + 64 - 52 - 3;
    uint64_t mantissa = high >> shift;
    if (low <= 1 && (mantissa & 3) == 1 && mantissa << shift == high)
        return NAN; /* maybe halfway between two floats */
    mantissa = (mantissa + (mantissa & 1)) >> 1;
    /* floor(power log2(10)) + 63, after Lemire, then down by the 52 bits after the first. */
    const int64_t exponent = (217706 * power >> 16) + 63 + (int64_t)upper - leading;
    return ldexp((double)mantissa, (int)(exponent - 52));
}

/* The float64 nearest to digits 10^power, or NaN where that is not settled here. */
static double scale_by_ten(uint64_t digits, int64_t power, const uint64_t (*fives)[2])
{
    if (digits <= MOST_EXACT_INTEGER && -MOST_EXACT_TEN <= power && power <= MOST_EXACT_TEN)
        return power < 0 ? (double)digits / EXACT_TENS[-power] : (double)digits * EXACT_TENS[power];
    if (digits == 0)
        return 0.0;
    if (power < LEAST_POWER || power > MOST_POWER)
        return NAN;
    return scale_long(digits, power, fives[power - LEAST_POWER]);
}

struct decimal {
    uint64_t digits; /* the first 19 */
    int64_t power;
    bool plain; /* there is a digit */
    bool cut;   /* there are more digits */
};

static inline bool is_digit(uint8_t byte)
{
    return 48 <= byte && byte <= 57;
}

/* Read digits and at most one point. */
static struct decimal read_digits(const uint8_t *text, int64_t stop, int64_t *at)
{
    struct decimal read = {0, 0, false, false};
    int n_digits = 0;
    bool fraction = false;
    int64_t i = *at;
    for (; i < stop; i++) {
        const uint8_t byte = text[i];
        if (is_digit(byte)) {
            read.plain = true;
            if (n_digits < MAX_DIGITS) {
                read.digits = read.digits * 10 + (byte - 48);
                n_digits += read.digits != 0;
                read.power -= fraction;
            } else {
                read.cut = true;
                read.power += !fraction;
            }
        } else if (byte == '.' && !fraction) {
            fraction = true;
        } else {
            break;
        }
    }
    *at = i;
    return read;
}

/* Read the exponent whose `e` is at `*at`. */
static void read_exponent(const uint8_t *text, int64_t stop, int64_t *at, struct decimal *read)
{
    int64_t i = *at + 1, exponent = 0;
    const bool down = i < stop && text[i] == '-';
    if (down || (i < stop && text[i] == '+'))
        i++;
    read->plain = false;
    for (; i < stop && is_digit(text[i]); i++) {
        read->plain = true;
        if (exponent < 10000) /* beyond it is 0 or infinite whatever follows */
            exponent = exponent * 10 + text[i] - 48;
    }
    read->power += down ? -exponent : exponent;
    *at = i;
}

double read_decimal(const uint8_t *text, int64_t stop, const uint64_t (*fives)[2], int64_t *at)
{
    const bool negative = text[*at] == '-';
    if (negative || text[*at] == '+')
        ++*at;
    struct decimal read = read_digits(text, stop, at);
    if (read.plain && *at < stop && (text[*at] | 32) == 'e')
        read_exponent(text, stop, at, &read);
    for (; *at < stop && is_in_word(text[*at]); ++*at)
        read.plain = false;
    if (!read.plain)
        return NAN;
    double value = scale_by_ten(read.digits, read.power, fives);
    if (read.cut && scale_by_ten(read.digits + 1, read.power, fives) != value)
        value = NAN; /* the digits beyond the 19th decide */
    return negative ? -value : value;
}

/* Count the words and lines from `start` to `stop` into `tally`, or with `fill` read them: the
   values, where each line begins in them, and the value and place of each word that is not settled
   here, as many as there is room for. `tally` counts all of these. A line whose first word does not
   begin with the letter `lead` is skipped, and so is that word; 0 for lines without a keyword. */
EXPORT void read_numbers(
    int64_t n, int64_t n_values, int64_t n_lines, int64_t n_hard,
    const uint8_t text[n], int64_t start, int64_t stop, int64_t lead, bool fill,
    const uint64_t fives[256][2], double values[n_values], int64_t lines[n_lines],
    int64_t hard[n_hard][2], int64_t tally[3])
{
    int64_t value = 0, line = 0, n_hard_found = 0, at = start;
    bool new_line = true;
    while (at < stop) {
        const uint8_t byte = text[at];
        if (byte == '\n' || byte == '\r') {
            new_line = true;
            at++;
        } else if (!is_in_word(byte)) {
            at++;
        } else if (byte == '#' || (new_line && lead != 0 && (byte | 32) != lead)) {
            while (at < stop && text[at] != '\n' && text[at] != '\r')
                at++;
            new_line = true;
        } else if (new_line) {
            new_line = false;
            if (fill)
                lines[line] = value;
            line++;
            while (lead != 0 && at < stop && text[at] > 32) /* the keyword */
                at++;
        } else if (fill) {
            const int64_t word = at;
            values[value] = read_decimal(text, stop, fives, &at);
            if (isnan(values[value])) {
                if (n_hard_found < n_hard) {
                    hard[n_hard_found][0] = value;
                    hard[n_hard_found][1] = word;
                }
                n_hard_found++;
            }
            value++;
        } else {
            while (at < stop && is_in_word(text[at]))
                at++;
            value++;
        }
    }
    tally[0] = value;
    tally[1] = line;
    tally[2] = n_hard_found;
}
