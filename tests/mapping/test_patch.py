"""Layouts that overlap themselves are recognized by their boundaries."""

import math

import numpy as np
import pytest

from texbake.core import core

TURNS = np.linspace(0, 2 * math.pi, 7)[:-1]
HEXAGON = np.stack([np.cos(TURNS), np.sin(TURNS)], axis=1)


def is_injective(uvs, faces):
    points = np.column_stack([uvs, np.zeros(len(uvs))])
    figures = np.empty(3)
    return bool(core.measure_layout(points, faces, np.array(uvs), figures) and figures[2])


def ring(n, turns, inner=1.0, outer=1.4, *, closed=False):
    """A band of n quads around the origin, and its layout."""
    angle = np.arange(n if closed else n + 1) * (2 * math.pi * turns / n)
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    a, b = np.arange(n), (np.arange(n) + 1) % len(angle)
    faces = np.concatenate(
        [np.stack([a, a + len(rim), b + len(rim)], axis=1), np.stack([a, b + len(rim), b], axis=1)]
    )
    return np.concatenate([inner * rim, outer * rim]), faces.astype(np.int32)


@pytest.mark.parametrize(
    ("turns", "injective"), [(0.5, True), (0.99, True), (1.01, False), (1.5, False), (2.0, False)]
)
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_band(turns, injective, size):
    uvs, faces = ring(50, turns)
    assert is_injective(size * uvs, faces) is injective


def test_slit_that_closes_exactly():
    """Both ends of a full turn lie on one another: the sides touch, and no area is shared."""
    uvs, faces = ring(50, 1.0)
    assert is_injective(uvs, faces)
    uvs[[50, 101]] = uvs[[0, 51]]
    assert is_injective(uvs, faces)
    # By more than rounding, and less than a face.
    turn = np.array([[math.cos(1e-3), math.sin(1e-3)], [-math.sin(1e-3), math.cos(1e-3)]])
    uvs[[50, 101]] = uvs[[0, 51]] @ turn
    assert not is_injective(uvs, faces)


def test_hole_wound_twice():
    """A closed band around the origin twice, as the square root's sheet is."""
    uvs, faces = ring(50, 1.0, closed=True)
    assert is_injective(uvs, faces)
    uvs, faces = ring(50, 2.0, closed=True)
    assert not is_injective(uvs, faces)


def test_hole_turned_inside_out():
    """The inner loop mirrored: triangles are flipped, though no edges of the boundary cross."""
    _, faces = ring(6, 1.0, closed=True)
    assert is_injective(np.concatenate([0.2 * HEXAGON, HEXAGON]), faces)
    mirrored = np.concatenate([0.2 * HEXAGON * [1, -1], HEXAGON])
    assert not is_injective(mirrored, faces)


def test_fans_that_touch():
    """Triangles around one corner: beside each other, or one within the other."""
    faces = np.array([[0, 1, 2], [0, 3, 4]], dtype=np.int32)
    uvs = np.array([[0, 0], [1, 0], [1, 1], [-1, 0], [-1, -1]], dtype=float)
    assert is_injective(uvs, faces)
    uvs[3:] = [[0.5, 0.1], [0.5, 0.2]]  # no edges cross
    assert not is_injective(uvs, faces)
