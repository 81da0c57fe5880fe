"""Welding: the first equal row, bit for bit."""

import os

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp

from texbake.core import core
from texbake.mesh.weld import weld_rows


def firsts_by_dictionary(rows):
    seen = {}
    return [seen.setdefault(tuple(row), index) for index, row in enumerate(rows.tolist())]


@given(
    hnp.arrays(
        np.float64,
        st.tuples(st.integers(1, 60), st.just(3)),
        elements=st.sampled_from([0.0, -0.0, 1.0, 1e-300, 0.1]),
    )
)
def test_first_equal_row_as_a_dictionary_finds_it(rows):
    assert weld_rows(rows).tolist() == firsts_by_dictionary(rows)


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int32])
def test_many_rows_with_any_number_of_threads(dtype):
    rows = np.random.default_rng(1).integers(-30, 30, (50_000, 3)).astype(dtype)
    firsts = weld_rows(rows, threads=1)
    assert firsts.tolist() == firsts_by_dictionary(rows)
    assert weld_rows(rows, threads=3).tobytes() == firsts.tobytes()


def test_neighboring_floats_stay_apart():
    rows = np.array([[1.0], [np.nextafter(1.0, 2.0)], [1.0]])
    assert weld_rows(rows).tolist() == [0, 1, 0]


def test_rows_are_left_as_they_are():
    rows = np.array([[-0.0, 1.0], [0.0, 1.0]])
    rows.flags.writeable = False
    assert weld_rows(rows).tolist() == [0, 0]
    assert np.signbit(rows[0, 0])


def test_all_rows_equal():
    assert not weld_rows(np.zeros((20_000, 3))).any()


def test_rows_that_collide_for_known_keys_do_not_for_random_ones():
    """Known keys would make the table a list, in which each row is looked for."""
    candidates = np.random.default_rng(3).random((1 << 22, 1))
    words, hashes = candidates.view(np.uint32), np.empty(len(candidates), np.uint32)
    known = bytes(range(1, 25))
    core.hash_rows(words, np.frombuffer(known, np.uint64), 0, len(words), hashes)
    rows = candidates[hashes % 8192 < 4][:2000]  # a table of 4,096
    assert len(rows) == 2000
    assert weld_rows(rows).tolist() == list(range(len(rows)))

    def most_in_a_place(keys):
        found = np.empty(len(rows), np.uint32)
        words = rows.view(np.uint32)
        core.hash_rows(words, np.frombuffer(keys, np.uint64), 0, len(words), found)
        return np.bincount(found % 8192).max()

    assert most_in_a_place(known) > 400
    assert most_in_a_place(os.urandom(24)) < 20
