"""The cage encloses the high-poly surface, and no vertex could move in on its own."""

import numpy as np
import pytest

from texbake import Mesh, OptionError, fit_cage, simplify
from texbake.mesh.shapes import cube, icosphere, orange, plane


@pytest.fixture(scope="module")
def peel():
    """A high-poly mesh with dents and bumps, and a low-poly one."""
    high = orange(6_000)
    return high, simplify(high, 300)


def _outside(points, cage):
    """Number of points that the closed cage does not enclose, by their winding numbers.

    Based on: A. Van Oosterom, J. Strackee, "The solid angle of a plane triangle", 1983.
    """
    angles = np.zeros(len(points))
    for face in cage.faces:
        a, b, c = (cage.positions[vertex] - points for vertex in face)
        la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
        volume = np.einsum("nx,nx->n", a, np.cross(b, c))
        whole = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
        angles += 2.0 * np.arctan2(volume, whole)
    return int(np.count_nonzero(angles / (4.0 * np.pi) < 0.5))


def test_a_cage_of_a_lifted_plane_moves_by_its_height():
    """Every vertex moves by 0.25, up to the rounding of the ray tree."""
    low = plane(3, 2)
    high = plane(17, 11)
    high = high.replace(positions=high.positions + np.array([0.0, 0.0, 0.25]))
    cage = fit_cage(high, low, margin=0.0)
    np.testing.assert_allclose(cage.distances, 0.25, atol=1e-6)
    np.testing.assert_array_equal(cage.mesh.faces, low.faces)
    np.testing.assert_array_equal(cage.mesh.uvs, low.uvs)


def test_a_peak_moves_only_the_face_under_it():
    """Over a tent on one of two faces, the vertex of the other face alone stays in place."""
    low = plane()
    middle = low.positions[low.faces[0]].mean(axis=0)
    peak = middle + np.array([0.0, 0.0, 0.3])
    corners = low.positions[low.faces[0]]
    high = Mesh(
        positions=np.vstack([corners, peak]),
        faces=np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3]], dtype=np.int32),
    )
    cage = fit_cage(high, low, margin=0.0)
    lone = np.setdiff1d(low.faces[1], low.faces[0])[0]
    assert cage.distances[lone] == 0.0
    # The plane through the three moved corners passes through the peak.
    assert cage.distances[low.faces[0]].mean() == pytest.approx(0.3, abs=1e-7)
    assert cage.n_beside == 0


def test_no_high_poly_vertex_lies_outside(peel):
    high, low = peel
    cage = fit_cage(high, low)
    assert cage.greatest_outside == 0.0
    assert _outside(high.positions, cage.mesh) == 0
    assert _outside(high.positions, low) > 200  # so that the cage was needed


def test_no_vertex_could_move_in_on_its_own(peel):
    """Moving a vertex back by a twentieth of its distance lets something through."""
    high, low = peel
    cage = fit_cage(high, low, margin=0.0)
    moved = np.flatnonzero(cage.distances > 0.002 * high.diagonal)
    assert len(moved) > 20
    directions = cage.mesh.positions - low.positions
    # Face centers too: the points that hold a vertex out may lie over an edge of the cage.
    points = np.vstack([high.positions, high.positions[high.faces].mean(axis=1)])
    loose = 0
    for vertex in moved[:: max(len(moved) // 6, 1)]:
        positions = cage.mesh.positions.copy()
        positions[vertex] -= 0.05 * directions[vertex]
        near = np.linalg.norm(points - cage.mesh.positions[vertex], axis=1) < 0.15 * high.diagonal
        loose += _outside(points[near], cage.mesh.replace(positions=positions)) == 0
    assert loose <= 1


def test_vertices_of_one_position_move_together():
    """A mesh whose faces share no vertices stays closed."""
    low = icosphere(1)
    split = low.replace(
        positions=low.positions[low.faces].reshape(-1, 3),
        faces=np.arange(3 * low.n_faces, dtype=np.int32).reshape(-1, 3), uvs=None, uv_faces=None,
        normals=None, normal_faces=None,
    )  # fmt: skip
    high = icosphere(4)
    cage = fit_cage(high, split).mesh
    assert len(np.unique(cage.positions, axis=0)) == low.n_vertices


def test_the_number_of_threads_changes_no_byte(peel):
    one, three = (fit_cage(*peel, threads=threads).mesh.positions for threads in (1, 3))
    assert one.tobytes() == three.tobytes()


def test_points_beside_the_border_are_a_warning():
    """The high-poly plane is wider than the low-poly one."""
    high = plane(9, 9)
    high = high.replace(positions=high.positions * 2.0 + np.array([0.0, 0.0, 0.1]))
    cage = fit_cage(high, plane(2, 2))
    assert cage.n_beside > 0
    assert any("border" in warning for warning in cage.warnings)


def test_vertices_without_a_normal_stay_with_a_warning():
    low = plane(2, 2)
    line = low.replace(positions=low.positions * [1.0, 0.0, 0.0])
    cage = fit_cage(plane(4, 4), line)
    assert np.array_equal(cage.mesh.positions, line.positions)
    assert cage.n_still == line.n_vertices
    assert any("no face around them has an area" in warning for warning in cage.warnings)
    assert fit_cage(plane(4, 4), low).n_still == 0


def test_normals_that_cancel_move_no_vertex_far():
    """The normals of a cube and its inside cancel, but for the rounding that a turn makes."""
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    box = cube()
    both = box.replace(
        positions=box.positions @ turn,
        faces=np.vstack([box.faces, box.faces[:, ::-1]]),
        normals=None, normal_faces=None, uvs=None, uv_faces=None,
    )  # fmt: skip
    high = both.replace(positions=both.positions * 1.05)
    assert fit_cage(high, both).distances.max() < 1.0


@pytest.mark.parametrize("margin", [-1.0, float("nan"), float("inf")])
def test_a_negative_or_infinite_margin_is_an_error(margin):
    with pytest.raises(OptionError, match="margin"):
        fit_cage(plane(), plane(), margin=margin)
