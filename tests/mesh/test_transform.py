"""Transforms: closed forms of single options, their order, and what follows the positions."""

import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.mesh.normals import face_normals
from texbake.mesh.options import TransformOptions
from texbake.mesh.shapes import uv_sphere
from texbake.mesh.transform import transform

BALL = uv_sphere(5, 7)
POINTS = BALL.positions


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, POINTS),
        ({"scale": 2.5}, 2.5 * POINTS),
        ({"units": "in"}, 0.0254 * POINTS),
        ({"up": "z"}, POINTS[:, [0, 2, 1]] * (1, 1, -1)),
        ({"rotate": (90.0, 0.0, 0.0)}, POINTS[:, [0, 2, 1]] * (1, -1, 1)),
        ({"rotate": (90.0, 0.0, -90.0)}, POINTS[:, [2, 0, 1]] * (-1, -1, 1)),
        ({"move": (1.0, 2.0, 3.0)}, POINTS + np.arange(1, 4)),
        ({"scale": 2.0, "up": "z", "move": (1.0, 0.0, 0.0)},
         2 * POINTS[:, [0, 2, 1]] * (1, 1, -1) + np.eye(3)[0]),
    ],
)  # fmt: skip
def test_positions_have_a_closed_form(given: dict, expected: np.ndarray) -> None:
    moved = transform(BALL, TransformOptions(**given))
    assert np.array_equal(moved.positions, expected)
    assert np.array_equal(moved.faces, BALL.faces)
    assert np.array_equal(moved.corner_uvs(), BALL.corner_uvs())


def test_a_rotation_there_and_back_is_none() -> None:
    there = transform(BALL, TransformOptions(rotate=(0.0, 33.0, 0.0)))
    back = transform(there, TransformOptions(rotate=(0.0, -33.0, 0.0)))
    assert np.abs(back.positions - POINTS).max() < 1e-15
    assert np.abs(there.positions - POINTS).max() > 0.4


def test_flipped_faces_face_the_other_way_with_their_normals() -> None:
    ball = BALL.replace(normals=POINTS, normal_faces=BALL.faces)
    flipped = transform(ball, TransformOptions(flip=True))
    assert np.allclose(face_normals(flipped), -face_normals(ball))
    assert flipped.normals is not None and flipped.normal_faces is not None
    sides = flipped.positions[flipped.faces] * flipped.normals[flipped.normal_faces]
    assert (sides.sum(axis=2) < 0).all()
    again = transform(flipped, TransformOptions(flip=True))
    assert np.array_equal(again.faces, ball.faces)


def test_positions_stay_finite() -> None:
    huge = BALL.replace(positions=1e300 * POINTS)
    with pytest.raises(OptionError, match="scale, move: positions would not be finite"):
        transform(huge, TransformOptions(scale=1e10))
