"""Python's own `float` is the oracle: every value must have its bits."""

import math
import struct

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from texbake.errors import FileFormatError
from texbake.mesh.files.source import parse_numbers, read_word


def as_bytes(text):
    return np.frombuffer(text.encode(), dtype=np.uint8)


def parse(words):
    return parse_numbers("text", as_bytes(" ".join(words))).values


def assert_same_bits(words):
    expected = np.array([float(word) for word in words])
    np.testing.assert_array_equal(parse(words).view(np.int64), expected.view(np.int64))


DIGITS = st.text("0123456789", min_size=1, max_size=40)


@settings(max_examples=300)
@given(
    st.sampled_from(["", "-", "+"]), DIGITS, st.sampled_from(["", "."]), DIGITS,
    st.integers(-400, 400),
)  # fmt: skip
@example("", "9007199254740993", "", "0", 0)
def test_any_number_of_digits_and_powers(sign, whole, point, fraction, power):
    plain = f"{sign}{whole}{point}{fraction if point else ''}"
    assert_same_bits([plain, f"{plain}e{power}", f"{plain}E{power:+d}"])


def test_edges_of_the_range_of_floats():
    words = ["0", "-0", "-0.0", "1.", ".5", "-.5e1", "00012.500", "0e999", "1e400", "-1e400"]
    words += ["1e-400", "4.9e-324", "2.4703282292062328e-324", "2.2250738585072011e-308"]
    words += ["2.2250738585072014e-308", "1.7976931348623157e308", "1.7976931348623159e308"]
    words += ["1e22", "1e23", "9007199254740992", "9007199254740993", "18446744073709551616"]
    words += ["0." + 400 * "0" + "1", 400 * "9", "1" + 30 * "0" + "e-30"]
    assert_same_bits(words)


def test_random_bits():
    rng = np.random.default_rng(1)
    values = rng.integers(0, 2**63, 20_000).view(np.float64)
    values = values[np.isfinite(values)].tolist()
    assert_same_bits([repr(value) for value in values])
    assert_same_bits([f"{math.fmod(value, 1e6):.6f}" for value in values])
    assert_same_bits([f"{value:.25e}" for value in values])
    packed = [struct.unpack("<f", struct.pack("<I", i))[0] for i in range(2**23, 2**23 + 500)]
    assert_same_bits([repr(value) for value in packed])


def test_words_for_not_a_number_are_nan():
    words = ["nan", "-NaN", "inf", "-Infinity", "1.#IND", "-1.#QNAN", "-nan(ind)"]
    assert np.isnan(parse(words)).all()


@pytest.mark.parametrize(
    "word", ["1,5", "1.2.3", "1e", "1e+", "--1", "abc", "1_0", "0x10", ".", "+"]
)
def test_invalid_numbers_are_errors_with_their_line(word):
    with pytest.raises(FileFormatError, match=r"file: line 3: .* is not a number"):
        parse_numbers("file", as_bytes(f"1 2\n3\n4 {word} 5"))


def test_lines_comments_and_keywords():
    text = "# 9 9\n\n1 2 # 9\r\n\r\n3\rvertex 4 5\n  Vertex 6\nnormal 7\n"
    with pytest.raises(FileFormatError):
        parse_numbers("text", as_bytes(text))
    numbers = parse_numbers("text", as_bytes(text), lead="v")
    assert (numbers.values.tolist(), numbers.lines.tolist()) == ([4, 5, 6], [0, 2])
    numbers = parse_numbers("text", as_bytes(text), 0, text.index("vertex"))
    assert (numbers.values.tolist(), numbers.lines.tolist()) == ([1, 2, 3], [0, 2])


def test_more_hard_words_than_there_is_room_for_at_first():
    words = ["9007199254740993"] * 3000  # halfway, so that the kernel settles none
    assert (parse(words) == 9007199254740992.0).all()


def test_read_word_stops_at_blanks_and_backslash():
    assert read_word("text", as_bytes("1 2.5\\\n3"), 2) == 2.5
