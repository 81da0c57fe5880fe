"""Winding numbers against whole numbers, and against the sum over all triangles."""

import numpy as np
import pytest

from texbake.mesh.remeshing.parts import winding_numbers
from texbake.mesh.shapes import icosphere

BALL = icosphere(5)
RADIUS = 40.0  # voxels, so that there are clusters of faces near and far
POSITIONS = RADIUS * BALL.positions


def points_at(radius, n=20, seed=0):
    directions = np.random.default_rng(seed).normal(size=(n, 3))
    return radius * directions / np.linalg.norm(directions, axis=1, keepdims=True)


def solid_angles(points, faces):
    """Winding numbers as the sum over all triangles, after van Oosterom and Strackee."""
    a, b, c = np.moveaxis(POSITIONS[faces][None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(corner, axis=2) for corner in (a, b, c))
    dots = [(one * other).sum(axis=2) for one, other in ((a, b), (b, c), (c, a))]
    below = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
    return 2.0 * np.arctan2((a * np.cross(b, c)).sum(axis=2), below).sum(axis=1) / (4.0 * np.pi)


@pytest.mark.parametrize(("radius", "winding"), [(0.0, 1), (20, 1), (39, 1), (41, 0), (200, 0)])
def test_a_ball_is_wound_around_once(radius, winding):
    points = points_at(radius)
    # Dipoles at four times their size are off by a few percent, and a ball has many.
    assert winding_numbers(POSITIONS, BALL.faces, points) == pytest.approx(winding, abs=0.02)
    turned = np.ascontiguousarray(BALL.faces[:, ::-1])
    assert winding_numbers(POSITIONS, turned, points) == pytest.approx(-winding, abs=0.02)


def test_torn_surfaces_have_the_winding_of_their_solid_angle():
    faces = np.ascontiguousarray(BALL.faces[POSITIONS[BALL.faces].mean(axis=1)[:, 2] > -10.0])
    points = points_at(30.0)
    expected = solid_angles(points, faces)
    assert expected.min() > 0.2 and expected.max() < 0.95
    assert winding_numbers(POSITIONS, faces, points) == pytest.approx(expected, abs=0.02)


def test_every_number_of_threads_gives_the_same_numbers():
    points = points_at(35.0)
    one, *others = (winding_numbers(POSITIONS, BALL.faces, points, threads=n) for n in (1, 2, 3, 4))
    assert all(one.tobytes() == other.tobytes() for other in others)


def test_nothing_winds_around_nothing():
    assert len(winding_numbers(POSITIONS, BALL.faces, np.empty((0, 3)))) == 0
    assert winding_numbers(POSITIONS, BALL.faces[:0], np.zeros((2, 3))).tolist() == [0.0, 0.0]
