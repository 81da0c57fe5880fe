"""Meshes joined, and moved by affine maps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake.mesh.compose import is_mirroring, join_meshes, transformed
from texbake.mesh.shapes import cube, icosphere, plane, uv_sphere
from texbake.mesh.tangents import corner_tangents


def test_one_mesh_comes_back_as_it_is() -> None:
    mesh = cube()
    assert join_meshes([mesh]) is mesh


def test_faces_keep_their_corners_and_coordinates() -> None:
    meshes = [plane(2, 1), plane(1, 3)]
    joined = join_meshes(meshes)
    corners = np.concatenate([mesh.positions[mesh.faces] for mesh in meshes])
    assert np.array_equal(joined.positions[joined.faces], corners)
    uvs = np.concatenate([mesh.corner_uvs() for mesh in meshes])
    assert np.array_equal(joined.corner_uvs(), uvs)
    assert joined.face_groups is not None
    assert joined.face_groups.tolist() == [0] * 4 + [1] * 6


def test_attributes_that_one_mesh_lacks_are_dropped_from_all() -> None:
    joined = join_meshes([plane(), icosphere(1)])
    assert joined.uvs is None
    assert joined.group_names == ("plane", "icosphere")


SPHERE = uv_sphere(6, 8)
SPHERE = SPHERE.replace(normals=SPHERE.positions, normal_faces=SPHERE.faces)
SPHERE = SPHERE.replace(tangents=corner_tangents(SPHERE))


def matrix(linear, translation=(0, 0, 0)):
    full = np.eye(4)
    full[:3, :3], full[:3, 3] = linear, translation
    return full


def volume(mesh):
    a, b, c = (mesh.positions[mesh.faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6.0


linear_maps = st.lists(
    st.floats(-4, 4, allow_subnormal=False), min_size=9, max_size=9
).map(lambda values: np.array(values).reshape(3, 3)).filter(
    lambda linear: np.linalg.cond(linear) < 1e4
)  # fmt: skip


@settings(max_examples=40)
@given(linear_maps)
def test_the_outside_stays_outside_and_normals_stay_normal(linear):
    moved = transformed(SPHERE, matrix(linear, (5, -3, 2)))
    # Relative to the center, the volume that triangles enclose is positive, and |det| as large.
    about = moved.replace(positions=moved.positions - (5, -3, 2))
    assert volume(about) == pytest.approx(abs(np.linalg.det(linear)) * volume(SPHERE), rel=1e-9)
    # A tangent plane goes to a tangent plane: normals stay perpendicular to moved tangents.
    corners = moved.normals[moved.normal_faces]
    tangents = moved.tangents[:, :, :3].astype(np.float64)
    facing = np.einsum("fci,fci->fc", corners, tangents)
    # 1e-3: float32 tangents, under maps of condition 1e4.
    assert np.abs(facing).max() < 1e-3
    # On a sphere p = n, and the inverse transpose of n and the map of p keep n·p = 1 above 0.
    assert (np.einsum("fci,fci->fc", corners, about.positions[about.faces]) > 0).all()


@pytest.mark.parametrize(
    "linear", [np.diag([-1, 1, 1]), np.diag([-2, -3, -4]), np.eye(3)[[1, 0, 2]]]
)
def test_tangents_of_a_mirror_image_are_those_made_of_it(linear):
    moved = transformed(SPHERE, matrix(linear))
    # What MikkTSpace makes of the mirrored mesh: the same directions with other signs. Corners at
    # the poles, where the map is singular, aside.
    made = corner_tangents(moved.replace(tangents=None))
    away = np.abs(moved.uvs[moved.uv_faces][:, :, 1] - 0.5) < 0.49
    np.testing.assert_array_equal(moved.tangents[away, 3], made[away, 3])
    if abs(np.linalg.det(linear)) == 1:  # without shear, directions agree to float32
        np.testing.assert_allclose(moved.tangents[away, :3], made[away, :3], atol=1e-5)


def test_a_mirror_lists_all_corners_of_a_face_the_other_way_round():
    moved = transformed(SPHERE, matrix(np.diag([1, 1, -1])))
    np.testing.assert_array_equal(moved.faces, SPHERE.faces[:, ::-1])
    np.testing.assert_array_equal(moved.uv_faces, SPHERE.uv_faces[:, ::-1])
    np.testing.assert_array_equal(moved.normal_faces, SPHERE.normal_faces[:, ::-1])
    np.testing.assert_array_equal(moved.tangents[:, :, 3], -SPHERE.tangents[:, ::-1, 3])


def test_a_turn_leaves_everything_but_directions():
    turn = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    moved = transformed(SPHERE, matrix(turn, (1, 2, 3)))
    np.testing.assert_array_equal(moved.positions, SPHERE.positions @ turn.T + (1, 2, 3))
    np.testing.assert_array_equal(moved.faces, SPHERE.faces)
    np.testing.assert_allclose(moved.normals, SPHERE.normals @ turn.T, atol=1e-15)


@pytest.mark.parametrize("size", [1e-150, 1e-9, 1e9, 1e150])
def test_size_does_not_matter(size):
    small = transformed(SPHERE, matrix(size * np.diag([-1, 1, 1])))
    np.testing.assert_allclose(small.normals, SPHERE.normals * (-1, 1, 1), atol=1e-12)
    np.testing.assert_array_equal(small.faces, SPHERE.faces[:, ::-1])


def test_a_map_whose_determinant_vanishes_in_rounding_mirrors_nothing():
    flat = np.array([[0.02, 0.0, 0.0], [0.0, 0.0, -0.02], [0.0, 5e-324, 1.2e-18]])
    assert not is_mirroring(flat)  # and no warning
