import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from texbake.mapping.areas import signed_areas, surface_areas


def test_right_triangle_with_legs_3_and_4() -> None:
    corners = np.array([[[1.0, 1.0], [4.0, 1.0], [1.0, 5.0]]])
    assert signed_areas(corners) == [6.0]
    assert signed_areas(corners[:, ::-1]) == [-6.0]


@given(st.integers(0, 2**32 - 1))
def test_area_in_a_coordinate_plane_is_the_flat_one(seed: int) -> None:
    corners = np.random.default_rng(seed).integers(-99, 99, (5, 3, 2)).astype(float)
    lifted = np.concatenate([corners, np.full((5, 3, 1), 7.0)], axis=2)
    assert np.array_equal(surface_areas(lifted), np.abs(signed_areas(corners)))


def test_triangles_without_area() -> None:
    line = np.array([[[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [2.0, 4.0, 6.0]], np.zeros((3, 3))])
    assert np.array_equal(surface_areas(line), [0.0, 0.0])
