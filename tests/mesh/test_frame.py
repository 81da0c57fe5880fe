"""The local frame: exact scaling, unit size, defined for every box."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from texbake.errors import MeshError
from texbake.mesh.frame import LocalFrame, unit_scale
from texbake.mesh.mesh import Mesh

CORNERS = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 2.0]])
FACES = [[0, 1, 2], [1, 2, 3]]


def mesh_of(positions):
    return Mesh(positions=positions, faces=FACES)


def test_box_of_all_faces_is_centered_and_scaled_by_a_power_of_two():
    frame = LocalFrame.around(mesh_of(CORNERS))
    assert (frame.center.tolist(), frame.scale) == ([1.5, 0.5, 1.0], 0.25)
    local = frame.to_local(CORNERS)
    assert local.min(axis=0).tolist() == [-0.375, -0.125, -0.25]
    assert local.max(axis=0).tolist() == [0.375, 0.125, 0.25]
    frame = LocalFrame.around(mesh_of(CORNERS), mesh_of(CORNERS + np.array([0.0, 0.0, 4.0])))
    assert (frame.center.tolist(), frame.scale) == ([1.5, 0.5, 3.0], 0.125)
    stray = np.concatenate([CORNERS, [[1e30, 0.0, 0.0]]])
    assert LocalFrame.around(mesh_of(stray)).scale == 0.25


@given(
    st.lists(
        st.floats(-1e6, 1e6, allow_subnormal=False), min_size=12, max_size=12, unique=True
    ).filter(lambda numbers: np.ptp(np.reshape(numbers, (4, 3)), axis=0).max() > 1e-9)
)
def test_longest_side_is_between_half_and_one(numbers):
    positions = np.reshape(numbers, (4, 3))
    frame = LocalFrame.around(mesh_of(positions))
    local = frame.to_local(positions)
    # Moving to the center rounds each end by half a unit of the largest coordinate.
    rounding = np.abs(positions).max() * 2.0**-52 * frame.scale
    assert 0.5 - rounding <= np.ptp(local, axis=0).max() <= 1.0 + rounding
    assert np.abs(local).max() <= 0.5 + rounding
    back = frame.to_model(local)
    assert np.abs(back - positions).max() <= np.abs(positions).max() * 2.0**-52


@pytest.mark.parametrize("exponent", [-900, -40, -1, 1, 20, 900])
def test_power_of_two_changes_no_local_coordinate(exponent):
    positions = CORNERS / 3.0 + 0.1
    scaled = np.ldexp(positions, exponent)
    local = LocalFrame.around(mesh_of(positions)).to_local(positions)
    assert np.array_equal(LocalFrame.around(mesh_of(scaled)).to_local(scaled), local)


@given(st.floats(1e-290, 1e290))
def test_lengths_convert_exactly_both_ways(length):
    frame = LocalFrame.around(mesh_of(CORNERS / 7.0))
    assert frame.length_to_model(frame.length_to_local(length)) == length
    assert frame.length_to_local(length) == length * frame.scale


@pytest.mark.parametrize("size", [1.7e308, 1e300, 1e-300, 1e-320])
def test_extreme_sizes_stay_finite(size):
    positions = np.array([[-1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) * size
    frame = LocalFrame.around(mesh_of(positions))
    local = frame.to_local(positions)
    assert 0.0 < np.ptp(local, axis=0).max() <= 1.0
    assert np.array_equal(frame.to_model(local), positions)


def test_box_without_size_has_scale_one_and_no_mesh_is_an_error():
    frame = LocalFrame.around(mesh_of(np.full((4, 3), 7.5)))
    assert frame.scale == 1.0
    assert not frame.to_local([7.5, 7.5, 7.5]).any()
    with pytest.raises(MeshError, match="no mesh"):
        LocalFrame.around()


@given(st.floats(1e-300, 1.7e308))
def test_unit_scale_is_the_greatest_power_of_two_that_fits(size):
    scale = unit_scale(size)
    assert 0.5 < size * scale <= 1.0
    assert math.frexp(scale)[0] == 0.5
