import numpy as np
import pytest
from hypothesis import given, strategies as st

from texbake.errors import UvError
from texbake.mapping.corner_uvs import measurable_uvs, signed_areas, surface_areas
from texbake.mapping.distortion import distortion
from texbake.mapping.layout import draw_layout
from texbake.mapping.layout_svg import layout_svg
from texbake.mesh.shapes import plane


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


@pytest.mark.parametrize("far", [1e76, 1e200, 1.7e308])
def test_coordinates_too_far_out_to_be_measured_are_one_clear_error(far: float) -> None:
    mesh = plane(2, 2).replace(uvs=(plane(2, 2).uvs * 2.0 - 1.0) * far)
    for measure in (measurable_uvs, distortion, draw_layout, layout_svg):
        with pytest.raises(UvError, match=r"tiles from the origin"):
            measure(mesh)


def test_coordinates_that_can_be_measured_come_back_as_they_are() -> None:
    mesh = plane(2, 2).replace(uvs=plane(2, 2).uvs * 1e75)
    assert np.array_equal(measurable_uvs(mesh), mesh.corner_uvs())
    assert np.isfinite(signed_areas(mesh.corner_uvs()) ** 2).all()
