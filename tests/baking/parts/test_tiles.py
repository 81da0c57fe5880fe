"""Tiles are counted as Mari counts them."""

import numpy as np
import pytest

from texbake.baking.parts.low_parts import Tiles, corner_of_tile

UNIT = np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[1.0, 1.0], [0.0, 1.0], [1.0, 0.0]]])


@pytest.mark.parametrize(
    ("shift", "number"),
    [((0, 0), 1001), ((9, 0), 1010), ((0, 1), 1011), ((3, 12), 1124), ((8, 899), 9999)],
)
def test_a_full_square_lies_in_one_tile(shift, number):
    tiles = Tiles.of(UNIT + np.array(shift))
    assert tiles.numbers == [number]
    assert tiles.n_crossing == tiles.n_outside == 0 and tiles.faces_in(number).all()
    assert not tiles.faces_in(number + 1).any()
    assert corner_of_tile(number).tolist() == list(shift)


def test_float32_on_a_border_crosses_nothing():
    assert Tiles.of(np.float32(UNIT * np.nextafter(np.float32(1), 2)).astype(float)).n_crossing == 0


def test_a_face_that_crosses_is_in_each_tile_that_is_baked():
    crossing = np.array([[[0.8, 0.2], [1.3, 0.2], [0.8, 0.4]]])
    tiles = Tiles.of(np.concatenate([UNIT + np.array([1.0, 0.0]), crossing]))
    assert tiles.n_crossing == 1
    assert tiles.numbers == [1001, 1002]  # its middle lies in the first
    assert tiles.faces_in(1001).tolist() == [False, False, True]
    assert tiles.faces_in(1002).tolist() == [True, True, True]


@pytest.mark.parametrize("shift", [(-1, 0), (0, -1), (10, 0), (0, 900), (9, 899)])
def test_faces_in_no_tile_are_counted(shift):
    tiles = Tiles.of(np.concatenate([UNIT, UNIT + np.array(shift)]))
    assert (tiles.numbers, tiles.n_outside) == ([1001], 2)


def test_a_face_over_everything_needs_one_tile():
    wide = np.array([[[-1e6, -1e6], [1e6, -1e6], [2.5, 2e6 + 1.0]]])
    assert len(Tiles.of(wide).numbers) <= 1


def test_faces_without_area_need_no_tile():
    assert Tiles.of(np.concatenate([UNIT + np.array([2.0, 0.0]), np.zeros((1, 3, 2))])).numbers == [
        1003
    ]
