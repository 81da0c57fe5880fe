import numpy as np
import pytest
from hypothesis import given, strategies as st

from texbake import OptionError, distortion, draw_layout, unwrap
from texbake.errors import UvError
from texbake.mapping.corner_uvs import (
    faces_of_group,
    joined_corners,
    measurable_uvs,
    signed_areas,
    surface_areas,
)
from texbake.mapping.layout_svg import layout_svg
from texbake.mapping.unwrap import unwrap_with_report
from texbake.mesh.shapes import cube, plane


def test_corners_come_back_bit_for_bit():
    corners = np.random.default_rng(1).integers(0, 3, (500, 3, 2)) / 3.0
    faces = np.random.default_rng(2).integers(0, 50, (500, 3)).astype(np.int32)
    uvs, uv_faces = joined_corners(faces, corners)
    assert np.array_equal(uvs[uv_faces], corners)
    keys = {
        (v, *uv) for v, uv in zip(faces.ravel(), map(tuple, corners.reshape(-1, 2)), strict=True)
    }
    assert len(uvs) == len(keys)


def test_equal_places_of_different_vertices_stay_apart():
    # Welding them would join charts that merely touch.
    uvs, _ = joined_corners(np.array([[0, 1, 2], [3, 4, 5]], np.int32), np.zeros((2, 3, 2)))
    assert len(uvs) == 6


def test_minus_zero_is_zero():
    corners = np.array(
        [[[0.0, -0.0], [0.0, 1.0], [1.0, 0.0]], [[-0.0, 0.0], [0.0, 1.0], [1.0, -0.0]]]
    )
    uvs, _ = joined_corners(np.array([[0, 1, 2], [0, 1, 2]], np.int32), corners)
    assert len(uvs) == 3
    assert not np.signbit(uvs).any()


def grouped(mesh):
    groups = np.arange(mesh.n_faces) % 3
    return mesh.replace(face_groups=groups, group_names=("a", "b", "a", "none"))


def test_groups_of_one_name_are_one():
    assert faces_of_group(grouped(cube()), "a").tolist() == [True, False, True] * 4


@pytest.mark.parametrize("name", ["c", "none", ""])
def test_a_group_that_is_not_there_names_those_that_are(name):
    with pytest.raises(OptionError, match="it has a, b, a, none"):
        faces_of_group(grouped(cube()), name)
    with pytest.raises(OptionError, match="has no groups"):
        faces_of_group(cube(), name)


@pytest.mark.parametrize("method", ["planar", "atlas"])
def test_only_one_group_is_mapped(method):
    mesh = grouped(plane(3, 3))
    mapped = unwrap(mesh, method=method, only="b", offset=(5.0, 5.0))
    new = faces_of_group(mesh, "b")
    assert np.array_equal(mapped.corner_uvs()[~new], mesh.corner_uvs()[~new])
    assert (mapped.corner_uvs()[new] >= 5.0).all()
    assert np.array_equal(mapped.faces, mesh.faces)


def test_other_groups_without_coordinates_are_counted():
    mapped, report = unwrap_with_report(grouped(cube()), method="planar", only="b")
    assert report.tallies["faces of other groups without coordinates"] == 8
    assert (mapped.corner_uvs()[0] == 0.0).all()


@given(st.integers(0, 2**32 - 1))
def test_area_in_a_coordinate_plane_is_the_flat_one(seed):
    corners = np.random.default_rng(seed).integers(-99, 99, (5, 3, 2)).astype(float)
    lifted = np.concatenate([corners, np.full((5, 3, 1), 7.0)], axis=2)
    assert np.array_equal(surface_areas(lifted), np.abs(signed_areas(corners)))


@pytest.mark.parametrize("far", [1e76, 1e200, 1.7e308])
def test_coordinates_too_far_out_to_be_measured_are_one_clear_error(far):
    mesh = plane(2, 2).replace(uvs=(plane(2, 2).uvs * 2.0 - 1.0) * far)
    for measure in (measurable_uvs, distortion, draw_layout, layout_svg):
        with pytest.raises(UvError, match=r"tiles from the origin"):
            measure(mesh)
