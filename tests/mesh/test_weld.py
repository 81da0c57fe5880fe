"""Welding: the first equal row, bit for bit."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp

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
