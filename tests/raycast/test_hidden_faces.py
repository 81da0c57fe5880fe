"""Faces that other parts hide: `texbake.raycast.hidden_faces`."""

import numpy as np
import pytest

from texbake.mesh.compose import excerpt, join_meshes
from texbake.mesh.deformation import Deformation
from texbake.mesh.shapes import cube, icosphere
from texbake.raycast.hidden_faces import hidden_faces


def scaled(mesh, size, move=(0.0, 0.0, 0.0)):
    return mesh.replace(positions=mesh.positions * size + move)


BALL = scaled(icosphere(3), 0.2)
BOX = cube()  # from -0.5 to 0.5


def hidden(mesh, is_opaque=None, **options):
    opaque = np.ones(mesh.n_faces, bool) if is_opaque is None else is_opaque
    return hidden_faces(mesh, opaque, **options)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_what_a_box_contains_is_hidden_and_the_box_is_not(size):
    mesh = scaled(join_meshes([BOX, BALL]), size, (3.0 * size, 0.0, 0.0))
    found = hidden(mesh)
    assert not found[: BOX.n_faces].any()
    assert found[BOX.n_faces :].all()
    np.testing.assert_array_equal(found, hidden(mesh, threads=1))


def test_transparent_faces_hide_nothing_and_are_hidden():
    mesh = join_meshes([BOX, BALL, scaled(BALL, 0.5)])
    is_opaque = np.arange(mesh.n_faces) >= BOX.n_faces
    found = hidden(mesh, is_opaque)
    assert not found[: BOX.n_faces + BALL.n_faces].any()
    assert found[BOX.n_faces + BALL.n_faces :].all()
    assert not hidden(mesh, np.zeros(mesh.n_faces, bool)).any()
    pane = ~is_opaque[::-1]  # the inner ball is of glass
    pane[: BOX.n_faces] = True
    assert hidden(mesh, pane)[BOX.n_faces :].all()


@pytest.mark.parametrize("n_open", [1, 2])
def test_a_hole_in_the_box_lets_the_ball_be_seen(n_open):
    mesh = join_meshes([excerpt(BOX, np.arange(BOX.n_faces) >= n_open), BALL])
    found = hidden(mesh)
    assert not found.all()
    assert 0 < found.sum() < BALL.n_faces  # what looks away from the hole, without its neighbors


def test_a_body_hides_nothing_of_itself():
    # A ball with a deep dent: nearly all rays from its bottom end in the dent.
    ball = icosphere(5)
    cosines = ball.positions[:, 2]
    dented = ball.replace(
        positions=ball.positions * np.where(cosines > 0.995, 0.02, 1.0)[:, np.newaxis]
    )
    for mesh in (dented, ball, join_meshes([dented, scaled(dented, 1.0, (5.0, 0.0, 0.0))])):
        assert not hidden(mesh).any()


def test_a_part_that_comes_out_in_a_pose_stays():
    mesh = join_meshes([BOX, BALL])
    out = mesh.positions + np.where(np.arange(mesh.n_vertices) < BOX.n_vertices, 0.0, 1.0)[:, None]
    bound = np.zeros((mesh.n_vertices, 1), np.int32)
    moving = mesh.replace(
        deformation=Deformation(bound, np.ones(bound.shape), poses=out[np.newaxis])
    )
    assert hidden(mesh).any()
    assert not hidden(moving).any()


def test_which_side_faces_out_does_not_matter():
    mesh = join_meshes([BOX, BALL])
    flipped = mesh.replace(faces=mesh.faces[:, ::-1])
    np.testing.assert_array_equal(hidden(flipped), hidden(mesh))
