"""Decimal numbers in text to the nearest float64, exactly as Python's `float` reads them.

Based on:
    W. D. Clinger, "How to read floating point numbers accurately", PLDI 1990
        (a short number is one exact float scaled by another);
    D. Lemire, "Number parsing at a gigabyte per second", Software: Practice and Experience 51(8),
        2021 (the Eisel-Lemire algorithm: up to 19 digits times a 128-bit power of five).

Departs from the latter where the result is undecided or not a normal number, or the word is not a
plain decimal: these are rare, and `texbake.mesh.files.decimals` leaves them to Python's `float`.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from texbake.kernels import kernel

_MAX_DIGITS = 19  # 10**19 - 1 still fits 64 bits
_LEAST_POWER, _MOST_POWER = -128, 127  # of ten; beyond them a coordinate is no common case
_EXACT_TENS = np.array([10.0**power for power in range(23)])  # 10**22 is the last exact float64


def _powers_of_five() -> npt.NDArray[np.uint64]:
    """(256, 2) uint64: high and low half of each power, its first bit shifted to bit 127."""
    halves = []
    for power in range(_LEAST_POWER, _MOST_POWER + 1):
        five = 5 ** abs(power)
        if power < 0:  # a reciprocal, rounded up
            five = (1 << (2 * five.bit_length() + 128)) // five + 1
        bits = five.bit_length()
        five = five << (128 - bits) if bits <= 128 else five >> (bits - 128)
        halves.append((five >> 64, five & (2**64 - 1)))
    return np.array(halves, dtype=np.uint64)


_FIVES = _powers_of_five()
_U0, _U1, _U3, _U10 = (np.uint64(number) for number in (0, 1, 3, 10))
_U32, _U48, _U63, _U64 = (np.uint64(number) for number in (32, 48, 63, 64))
_HALF_MASK = np.uint64(2**32 - 1)
_EXACT_INTEGERS = np.uint64(2**53)
_LOW_9_BITS = np.uint64(2**9 - 1)  # below the 53 mantissa bits, the rounding bit and one more
_ALL_BITS = np.uint64(2**64 - 1)
_MANTISSA_SHIFT = np.uint64(64 - 52 - 3)


@njit(nogil=True, inline="always")
def _multiply_kernel(a, b):  # type: ignore[no-untyped-def]
    """High and low half of the 128-bit product of two 64-bit integers."""
    a_high, a_low = a >> _U32, a & _HALF_MASK
    b_high, b_low = b >> _U32, b & _HALF_MASK
    low = a_low * b_low
    middle = a_high * b_low + (low >> _U32)
    other = a_low * b_high + (middle & _HALF_MASK)
    return a_high * b_high + (middle >> _U32) + (other >> _U32), (other << _U32) | (
        low & _HALF_MASK
    )


@kernel
def _scale_kernel(digits, power):  # type: ignore[no-untyped-def]
    """The float64 nearest to digits * 10**power, or NaN where that is not settled here."""
    if digits <= _EXACT_INTEGERS and -22 <= power <= 22:
        if power < 0:
            return np.float64(digits) / _EXACT_TENS[-power]
        return np.float64(digits) * _EXACT_TENS[power]
    if digits == _U0:
        return 0.0
    if power < _LEAST_POWER or power > _MOST_POWER:
        return math.nan
    leading, step = 0, 32
    while step > 0:
        if digits >> np.uint64(64 - step) == _U0:
            digits = digits << np.uint64(step)
            leading += step
        step //= 2
    high, low = _multiply_kernel(digits, _FIVES[power - _LEAST_POWER, 0])
    if high & _LOW_9_BITS == _LOW_9_BITS:  # a carry from further down could change the rounding
        carry, _ = _multiply_kernel(digits, _FIVES[power - _LEAST_POWER, 1])
        low = low + carry
        if low < carry:
            high = high + _U1
    if low == _ALL_BITS:
        return math.nan
    upper = high >> _U63
    shift = upper + _MANTISSA_SHIFT
    mantissa = high >> shift
    if low <= _U1 and mantissa & _U3 == _U1 and mantissa << shift == high:
        return math.nan  # maybe halfway between two floats
    mantissa = (mantissa + (mantissa & _U1)) >> _U1
    # floor(power * log2(10)) + 63, after Lemire, then down by the 52 bits after the first.
    exponent = ((217706 * power) >> 16) + 63 + np.int64(upper) - leading
    return math.ldexp(np.float64(mantissa), exponent - 52)


@kernel
def decimal_kernel(data, at, stop):  # type: ignore[no-untyped-def]
    """Read the word that begins at `at`; it ends at white space, a backslash or `stop`.

    Returns its value and its end. The value is NaN where `resolve` must read the word.
    """
    i = at
    negative = data[i] == 45  # -
    if negative or data[i] == 43:  # +
        i += 1
    digits, n_digits, power = _U0, 0, 0
    seen, cut, fraction = False, False, False
    while i < stop:
        byte = data[i]
        if 48 <= byte <= 57:
            seen = True
            if n_digits < _MAX_DIGITS:
                digits = digits * _U10 + (np.uint64(byte) - _U48)
                n_digits += digits != _U0
                power -= fraction
            else:
                cut = True
                power += not fraction
        elif byte == 46 and not fraction:  # .
            fraction = True
        else:
            break
        i += 1
    plain = seen
    if seen and i < stop and data[i] | 32 == 101:  # e
        i += 1
        down = i < stop and data[i] == 45
        if down or (i < stop and data[i] == 43):
            i += 1
        exponent, plain = 0, False
        while i < stop and 48 <= data[i] <= 57:
            plain = True
            if exponent < 10_000:  # beyond it is 0 or infinite whatever follows
                exponent = exponent * 10 + data[i] - 48
            i += 1
        power += -exponent if down else exponent
    while i < stop and data[i] > 32 and data[i] != 92:
        plain = False
        i += 1
    if not plain:
        return math.nan, i
    value = _scale_kernel(digits, power)
    if cut and _scale_kernel(digits + _U1, power) != value:
        value = math.nan  # the digits beyond the 19th decide
    return (-value if negative else value), i


@kernel
def numbers_kernel(data, start, stop, lead, fill, values, lines, hard, tally):  # type: ignore[no-untyped-def]
    """Count words and lines into `tally`, or with `fill` read them; see `parse_numbers`."""
    n_values, n_lines, n_hard = 0, 0, 0
    at = start
    new_line, wanted = True, True
    while at < stop:
        byte = data[at]
        if byte == 10 or byte == 13:
            new_line = True
            at += 1
        elif byte <= 32 or byte == 92:
            at += 1
        elif byte == 35 or (new_line and lead != 0 and byte | 32 != lead) or not wanted:
            while at < stop and data[at] != 10 and data[at] != 13:
                at += 1
            new_line, wanted = True, True
        else:
            if new_line:
                new_line = False
                if fill:
                    lines[n_lines] = n_values
                n_lines += 1
                if lead != 0:  # the keyword
                    while at < stop and data[at] > 32:
                        at += 1
                    continue
            if fill:
                value, end = decimal_kernel(data, at, stop)
                values[n_values] = value
                if math.isnan(value):
                    if n_hard < len(hard):
                        hard[n_hard, 0] = n_values
                        hard[n_hard, 1] = at
                    n_hard += 1
                at = end
            else:
                while at < stop and data[at] > 32 and data[at] != 92:
                    at += 1
            n_values += 1
    tally[0], tally[1], tally[2] = n_values, n_lines, n_hard
