"""Faces that other parts hide: `texbake.raycast.hidden_faces`."""

import numpy as np
import pytest

import texbake as tb
from texbake.mesh.compose import excerpt, join_meshes
from texbake.mesh.shapes import cube, icosphere
from texbake.raycast.hidden_faces import hidden_faces, visible_shares


def scaled(mesh, size, move=(0.0, 0.0, 0.0)):
    return mesh.replace(positions=mesh.positions * size + move)


BALL = scaled(icosphere(3), 0.2)
BOX = cube()  # from -0.5 to 0.5


def hidden(mesh, is_opaque=None, *, one_sided=False, **options):
    opaque = np.ones(mesh.n_faces, bool) if is_opaque is None else is_opaque
    return hidden_faces(mesh, opaque, np.full(mesh.n_faces, one_sided), **options)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_what_a_box_contains_is_hidden_and_the_box_is_not(size):
    mesh = scaled(join_meshes([BOX, BALL]), size, (3.0 * size, 0.0, 0.0))
    found = hidden(mesh)
    assert not found[: BOX.n_faces].any() and found[BOX.n_faces :].all()
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


def test_a_part_that_shows_anywhere_stays_whole():
    mesh = join_meshes([excerpt(BOX, np.arange(BOX.n_faces) >= 1), BALL])
    assert not hidden(mesh).any()
    # A wall of two triangles, seen through a small window of a box around it.
    grid = tb.make("plane", resolution=(21, 21))
    places = grid.positions[grid.faces].mean(axis=1)
    window = excerpt(grid, np.abs(places).max(axis=1) > 0.04)
    front = scaled(window, 1.0 / np.ptp(window.positions, axis=0).max(), (0.0, 0.0, 0.5))
    box = excerpt(BOX, BOX.positions[BOX.faces][..., 2].min(axis=1) < 0.4)
    wall = scaled(tb.make("plane", resolution=(1, 1)), 0.3, (0.0, 0.0, -0.3))
    assert not hidden(join_meshes([box, front, wall])).any()


def test_a_ball_in_a_well_and_the_well_stay():
    well = tb.make("cylinder", sides=32, height=2.0)
    ball = scaled(BALL, 0.9)
    assert not hidden(join_meshes([well, ball])).any()


def test_a_body_hides_nothing_of_itself():
    # A ball with a deep dent: nearly all rays from its bottom end in the dent.
    ball = icosphere(5)
    cosines = ball.positions[:, 2]
    dented = ball.replace(
        positions=ball.positions * np.where(cosines > 0.995, 0.02, 1.0)[:, np.newaxis]
    )
    for mesh in (dented, ball, join_meshes([dented, scaled(dented, 1.0, (5.0, 0.0, 0.0))])):
        assert not hidden(mesh).any()


def test_a_shell_that_draws_an_outline_hides_nothing():
    shell = scaled(BALL, 1.1).replace(faces=BALL.faces[:, ::-1])
    mesh = join_meshes([shell, BALL])
    assert not hidden(mesh, one_sided=True).any() and hidden(mesh)[BALL.n_faces :].all()
    outward = join_meshes([scaled(BALL, 1.1), BALL])
    assert hidden(outward, one_sided=True)[BALL.n_faces :].all()


def test_parts_stay_where_the_work_would_have_no_bound(monkeypatch):
    mesh = join_meshes([BOX, BALL])
    assert hidden(mesh).any()
    monkeypatch.setattr("texbake.raycast.hidden_faces._MOST_POINTS", 1e-3)
    assert not hidden(mesh).any()


def test_which_side_faces_out_does_not_matter():
    mesh = join_meshes([BOX, BALL])
    flipped = mesh.replace(faces=mesh.faces[:, ::-1])
    np.testing.assert_array_equal(hidden(flipped), hidden(mesh))


def shares(mesh, is_opaque=None, **options):
    opaque = np.ones(mesh.n_faces, bool) if is_opaque is None else is_opaque
    return visible_shares(mesh, opaque, np.zeros(mesh.n_faces, bool), **options)


def windowed_box():
    """A closed ball in a box of fine triangles, seen through a window in its top."""
    grid = tb.make("plane", resolution=(24, 24))
    grid = scaled(grid, 1.0 / np.ptp(grid.positions, axis=0).max())
    flat = np.argmin(np.ptp(grid.positions, axis=0))
    grid = grid.replace(positions=np.roll(grid.positions, 2 - flat, axis=1))
    window = excerpt(grid, np.abs(grid.positions[grid.faces].mean(axis=1)).max(axis=1) > 0.15)
    turns = [np.roll(np.eye(3), turn, axis=1) for turn in (1, 2)]
    walls = [grid.replace(positions=grid.positions @ turn) for turn in turns]
    pairs = [
        scaled(w, 1.0, s * 0.5 * t[2]) for w, t in zip(walls, turns, strict=True) for s in (1, -1)
    ]
    top, bottom = scaled(window, 1.0, (0.0, 0.0, 0.5)), scaled(grid, 1.0, (0.0, 0.0, -0.5))
    return join_meshes([scaled(icosphere(4), 0.4), top, bottom, *pairs])


@pytest.mark.parametrize("size", [1e-160, 1e160])
def test_surfaces_count_less_where_little_of_them_is_seen(size):
    mesh = scaled(windowed_box(), size, (0.0, size, 0.0))
    found = shares(mesh, threads=1)
    n = icosphere(4).n_vertices
    heights = mesh.positions[:n, 2] / size
    assert found[n:].min() > 0.8
    assert found[:n][heights < 0.0].max() < 0.1
    assert found[:n][heights > 0.35].mean() > 5.0 * found[:n][heights < 0.0].mean()
    np.testing.assert_array_equal(found, shares(mesh, threads=3))


def test_surfaces_count_less_also_between_vertices_that_cast_rays_far_apart(monkeypatch):
    mesh = windowed_box()
    monkeypatch.setattr("texbake.raycast.openness._MOST", mesh.n_vertices // 60)
    n = icosphere(4).n_vertices
    found, heights = shares(mesh)[:n], mesh.positions[:n, 2]
    assert found[heights < 0.0].max() < 0.1
    assert found[heights > 0.35].mean() > 0.5


def test_all_surfaces_count_alike_where_hardly_any_is_hidden_or_all_is_of_glass():
    assert shares(BALL) is None
    assert shares(join_meshes([BALL, scaled(BALL, 0.9, (1.0, 0.0, 0.0))])) is None
    assert shares(windowed_box(), np.zeros(windowed_box().n_faces, bool)) is None
    assert shares(windowed_box(), np.arange(windowed_box().n_faces) < icosphere(4).n_faces) is None
