"""Frames about axes, and points seen from a center."""

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from texbake.core import portable_math
from texbake.mapping.classical.frames import (
    center_of,
    frame_about,
    points_about,
    upright_frame,
    wrap_angles,
)
from texbake.mesh.mesh import Mesh

X, Y, Z = np.eye(3)


numbers = st.floats(-1.0, 1.0, allow_subnormal=False)


vectors = st.tuples(numbers, numbers, numbers)


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


@given(vectors)
def test_a_picture_from_anywhere_is_upright_and_not_mirrored(vector):
    assume(np.hypot(vector[0], vector[2]) > 1e-3)
    right, up, normal = upright_frame(vector)
    assert abs(np.linalg.det(np.array([right, up, normal])) - 1.0) < 1e-14
    assert right[1] == 0.0
    assert up[1] > 0.0
    assert normal @ vector > 0.999 * np.linalg.norm(vector)


def test_a_vertex_that_no_face_uses_changes_nothing():
    positions = np.array([[0.3, 0, 0], [1, 0, 0], [0, 1.7, 0], [1e308, -1e308, 1e308]])
    with_stray = Mesh(positions=positions, faces=[[0, 1, 2]])
    without = Mesh(positions=positions[:3], faces=[[0, 1, 2]])
    assert np.array_equal(center_of(with_stray, None), center_of(without, None))
    frame = frame_about((1, 2, 3))
    stray = points_about(with_stray, center_of(with_stray, None), frame)
    assert np.array_equal(stray.points[:3], points_about(without, (0.5, 0.85, 0), frame).points)


def test_the_center_of_huge_bounds_does_not_overflow():
    mesh = Mesh(positions=[[1.5e308] * 3, [1.7e308] * 3, [1.6e308] * 3], faces=[[0, 1, 2]])
    assert np.allclose(center_of(mesh, None), 1.6e308, rtol=1e-15)
    assert np.isfinite(points_about(mesh, (-1.7e308,) * 3, frame_about((1, 1, 1))).points).all()


WHOLE = (-180.0, 180.0)


ARCS = [WHOLE, (0.0, 360.0), (30.0, 120.0), (180.0, -180.0), (-90.0, 630.0)]


integers = st.integers(-6, 6)


triangles = st.lists(st.tuples(integers, integers), min_size=3, max_size=3)


def wrapped(corners, theta=WHOLE, rounding=0.0):
    points = np.column_stack([np.asarray(corners, dtype=float), np.zeros(len(corners))])
    faces = np.arange(len(points), dtype=np.int32).reshape(-1, 3)
    return wrap_angles(points, faces, theta=theta, rounding=rounding)


def holds_origin(corners):
    """Whether a triangle with integer corners holds the origin, or an edge does; exactly."""
    crosses = [
        (ax * by - ay * bx, ax * bx + ay * by)
        for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True)
    ]
    on_edge = any(cross == 0 and dot < 0 for cross, dot in crosses)
    signs = {np.sign(cross) for cross, _ in crosses}
    return on_edge or (len(signs) == 1 and 0 not in signs)


@pytest.mark.parametrize("theta", ARCS)
@pytest.mark.parametrize("seed", range(5))
def test_every_corner_has_its_angle_and_faces_run_on(theta, seed):
    corners = np.random.default_rng(seed).normal(size=(400, 3, 2))
    s = wrapped(corners.reshape(-1, 2), theta).s
    arc = theta[1] - theta[0]
    angles = s * arc + theta[0]
    expected = np.degrees(np.arctan2(corners[..., 1], corners[..., 0]))
    off = (angles - expected + 180.0) % 360.0 - 180.0
    assert np.abs(off).max() < 1e-9
    # From corner to corner: the angle between them, which needs no seam. For faces around the
    # axis those are more than half a turn in sum, and one of the three is not walked.
    ahead = np.roll(corners, -1, axis=1)
    cross = corners[..., 0] * ahead[..., 1] - corners[..., 1] * ahead[..., 0]
    between = np.degrees(np.arctan2(cross, (corners * ahead).sum(axis=2)))
    around = np.abs(between.sum(axis=1)) > 180.0
    assert 0 < around.sum() < 200
    steps = np.roll(angles, -1, axis=1) - angles
    assert np.abs(steps - between)[~around].max() < 1e-9
    assert np.array_equal(wrapped(corners.reshape(-1, 2), theta).around, around)


@given(triangles)
def test_faces_around_the_axis_are_found_exactly(corners):
    if (0, 0) in corners:
        return
    found = wrapped(corners)
    assert found.around[0] == holds_origin(corners)
    span = float(found.s.max() - found.s.min())
    assert found.around[0] or span < 0.5


def test_a_corner_on_the_axis_takes_the_angle_of_its_face():
    found = wrapped([(0, 0), (2, 0), (0, 2)])
    assert found.s[0] == pytest.approx([0.625, 0.5, 0.75], abs=1e-15)
    assert found.tallies() == {"faces touching the axis": 1}


def test_a_face_along_the_axis_has_the_middle_of_the_arc():
    found = wrapped([(0, 0)] * 3, theta=(10.0, 50.0))
    assert found.s[0] == pytest.approx([0.5] * 3, abs=1e-15)
    assert found.tallies("a pole") == {"faces touching a pole": 1, "faces along the axis": 1}


@pytest.mark.parametrize("first", [0, 1, 2])
def test_where_the_centroid_is_on_the_axis_the_corner_of_the_least_angle_counts(first):
    found = wrapped(np.roll([(0, 0), (-1, -1), (1, 1)], -first, axis=0))
    assert found.s[0] == pytest.approx(np.roll([0.125, 0.125, -0.375], -first), abs=1e-15)
    # The sum of its corners is the origin.
    around = wrapped(np.roll([(1, 0), (-1, 1), (0, -1)], -first, axis=0))
    assert around.s[0] == pytest.approx(np.roll([0.5, -0.125, 0.25], -first), abs=1e-15)
    assert around.tallies() == {"faces around the axis": 1}


def test_points_within_rounding_of_the_axis_lie_on_it():
    near = [(1e-16, 0.0), (1.0, 0.0), (0.0, 1.0)]
    assert not wrapped(near).on_axis.any()
    assert wrapped(near, rounding=1e-15).on_axis.tolist() == [[True, False, False]]


def test_both_sides_of_the_seam_are_a_whole_turn_apart_to_the_last_bit():
    rng = np.random.default_rng(3)
    points = rng.normal(size=(60, 3))
    faces = rng.integers(0, 60, (400, 3)).astype(np.int32)
    s = wrap_angles(points, faces, theta=WHOLE, rounding=0.0).s
    once = portable_math.arctan2(points[:, 1], points[:, 0]) / (2.0 * np.pi) + 0.5
    for vertex in range(60):
        values = set(s[faces == vertex].tolist())
        assert values <= {once[vertex] + turns for turns in (-1.0, 0.0, 1.0)}
