"""Rows that are dropped in place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, strategies as st

from texbake.raycast.rays import Rows


@dataclass(frozen=True, eq=False)
class Pairs(Rows):
    """Two columns, and one that is not there."""

    numbers: np.ndarray
    squares: np.ndarray
    nothing: None = None


@given(st.integers(0, 40), st.data())
def test_all_other_rows_are_kept(n: int, data: st.DataObject) -> None:
    dropped = np.array(
        sorted(data.draw(st.sets(st.integers(0, n - 1)))) if n else [], dtype=np.intp
    )
    kept = Pairs(np.arange(n), np.arange(n) ** 2).without(dropped)
    assert sorted(kept.numbers) == sorted(set(range(n)) - set(dropped.tolist()))
    np.testing.assert_array_equal(kept.squares, kept.numbers**2)
    assert kept.nothing is None


@pytest.mark.parametrize("dropped", [[], [9], [0], [0, 9]])
def test_rows_that_can_stay_do(dropped: list[int]) -> None:
    kept = Pairs(np.arange(10), np.arange(10)).without(np.array(dropped, dtype=np.intp))
    stays = [i for i in range(len(kept)) if i not in dropped]
    np.testing.assert_array_equal(kept.numbers[stays], stays)
