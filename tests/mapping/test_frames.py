"""Frames about axes, and points seen from a center."""

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from texbake.mapping.classical.frames import center_of, frame_about, points_about, upright_frame
from texbake.mesh.mesh import Mesh

X, Y, Z = np.eye(3)
numbers = st.floats(-1.0, 1.0, allow_subnormal=False)
vectors = st.tuples(numbers, numbers, numbers)
AXES = (("x", (Y, Z, X)), ("y", (Z, X, Y)), ("z", (X, Y, Z)))
OPPOSITES = ((-X, (Y, -Z, -X)), (-Y, (Z, -X, -Y)), (-Z, (X, -Y, -Z)))


@pytest.mark.parametrize(("axis", "rows"), AXES + OPPOSITES)
def test_frames_about_the_axes_are_exact(axis, rows):
    frame = frame_about(axis if isinstance(axis, str) else tuple(axis))
    assert np.array_equal(frame, np.array(rows))


@given(vectors)
def test_a_frame_is_the_nearest_one_turned_by_the_least_rotation(vector):
    length = np.linalg.norm(vector)
    assume(length > 1e-3)
    axis = np.array(vector) / length
    frame = frame_about(vector)
    # 1e-15: a handful of roundings of numbers of at most 1.
    assert np.abs(frame @ frame.T - np.eye(3)).max() < 2e-15
    assert np.linalg.det(frame) > 0.999
    assert np.abs(frame[2] - axis).max() < 1e-15
    # The least rotation from b to a is the reflection in b's plane and then in that of a + b.
    nearest = int(np.abs(axis).argmax())
    start = np.roll(np.eye(3), -1 - nearest, axis=0) * np.sign(axis[nearest])
    start[0] = np.abs(start[0])
    half = start[2] + axis
    rows = start - 2.0 * np.outer(start @ start[2], start[2])
    rows -= 2.0 * np.outer(rows @ half, half) / (half @ half)
    assert np.abs(frame - rows).max() < 4e-15


@pytest.mark.parametrize("factor", [1e-300, 1.0, 1e300])
def test_the_length_of_an_axis_is_of_no_matter(factor):
    vector = (0.25 * factor, -0.5 * factor, 1.0 * factor)
    assert np.allclose(frame_about(vector), frame_about((1, -2, 4)), rtol=0, atol=1e-15)
    assert np.allclose(upright_frame(vector), upright_frame((1, -2, 4)), rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("normal", "right", "up"),
    [(X, -Z, Y), (-X, Z, Y), (Y, X, -Z), (-Y, X, Z), (Z, X, Y), (-Z, -X, Y)],
)
def test_pictures_from_the_six_sides_stand_upright(normal, right, up):
    assert np.array_equal(upright_frame(normal), np.array([right, up, normal]))


@given(vectors)
def test_a_picture_from_anywhere_is_upright_and_not_mirrored(vector):
    assume(np.hypot(vector[0], vector[2]) > 1e-3)
    right, up, normal = upright_frame(vector)
    assert abs(np.linalg.det(np.array([right, up, normal])) - 1.0) < 1e-14
    assert right[1] == 0.0
    assert up[1] > 0.0
    assert normal @ vector > 0.999 * np.linalg.norm(vector)


def test_points_are_the_closed_form():
    rng = np.random.default_rng(1)
    for axis in (*"xyz", (1.0, -2.0, 0.5), (-0.3, -0.2, -0.1)):
        mesh = Mesh(positions=rng.normal(size=(30, 3)), faces=np.arange(30).reshape(-1, 3))
        center = tuple(rng.normal(size=3).tolist())
        frame = frame_about(axis)
        local = points_about(mesh, center, frame)
        expected = (mesh.positions - center) @ frame.T
        assert np.abs(local.points / local.scale - expected).max() < 1e-14


def test_a_vertex_that_no_face_uses_changes_nothing():
    positions = np.array([[0.3, 0, 0], [1, 0, 0], [0, 1.7, 0], [1e308, -1e308, 1e308]])
    with_stray = Mesh(positions=positions, faces=[[0, 1, 2]])
    without = Mesh(positions=positions[:3], faces=[[0, 1, 2]])
    assert np.array_equal(center_of(with_stray, None), center_of(without, None))
    frame = frame_about((1, 2, 3))
    stray = points_about(with_stray, center_of(with_stray, None), frame)
    assert np.array_equal(stray.points[:3], points_about(without, (0.5, 0.85, 0), frame).points)


@pytest.mark.parametrize("factor", [2.0**-1000, 2.0**-20, 2.0**20, 2.0**1000])
def test_points_keep_every_bit_at_any_scale(factor):
    positions = np.random.default_rng(2).normal(size=(30, 3))
    faces = np.arange(30).reshape(-1, 3)
    center = np.array([0.3, -0.4, 0.5])
    frame = frame_about((1, 2, -3))
    here = points_about(Mesh(positions=positions, faces=faces), center, frame)
    there = points_about(Mesh(positions=positions * factor, faces=faces), center * factor, frame)
    assert np.array_equal(here.points, there.points)
    assert there.rounding == here.rounding
    assert there.scale * factor == here.scale


def test_the_center_of_huge_bounds_does_not_overflow():
    mesh = Mesh(positions=[[1.5e308] * 3, [1.7e308] * 3, [1.6e308] * 3], faces=[[0, 1, 2]])
    assert np.allclose(center_of(mesh, None), 1.6e308, rtol=1e-15)
    assert np.isfinite(points_about(mesh, (-1.7e308,) * 3, frame_about((1, 1, 1))).points).all()
