"""Lines, seams and poles of lattices; points of the circle."""

import numpy as np
import pytest

from texbake.mesh.parametric.grid import (
    circle_points,
    closed_lines,
    half_steps,
    lattice,
    make_grid,
    open_lines,
    part_way,
    triangulate,
)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 8, 24, 100, 1001])
def test_circle_points_are_those_of_long_double(n):
    angles = 2 * np.arange(n, dtype=np.longdouble) * np.longdouble("3.14159265358979323846264") / n
    exact = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    # The angle is rounded once more than the cosine: two units in the last place of 1.
    assert np.abs(circle_points(n) - exact).max() <= 2 * 2.0**-53


def test_circle_points_are_exact_and_mirrored_bit_by_bit():
    for n in 8, 60, 1000:
        points = circle_points(n)
        x, y = points.T
        assert points[[0, n // 4, n // 2, 3 * n // 4]].tolist() == [
            [1, 0],
            [0, 1],
            [-1, 0],
            [0, -1],
        ]
        np.testing.assert_array_equal(points[1:], (points * [1, -1])[:0:-1])  # about the x axis
        np.testing.assert_array_equal(np.roll(points, -n // 2, axis=0), -points)
        np.testing.assert_array_equal(np.roll(x, n // 4), y)
        assert not np.signbit(points[points == 0]).any()


@pytest.mark.parametrize("ends", [(0.1, 0.7), (-1.3, 1.3), (0.3, 0.3), (5.0, 0.0)])
def test_part_way_has_exact_ends_and_the_same_way_back(ends):
    steps = np.arange(8)
    there, back = part_way(*ends, steps, 7), part_way(*ends[::-1], steps, 7)
    assert (there[0], there[-1]) == ends
    np.testing.assert_array_equal(there, back[::-1])
    np.testing.assert_allclose(there, np.linspace(*ends, 8), rtol=0, atol=2e-15)  # a few roundings
    if ends[0] == ends[1]:
        assert (there == ends[0]).all()


def test_half_steps_lie_between():
    assert half_steps(np.array([0.0, 1.0, 3.0])).tolist() == [0.0, 0.5, 1.0, 2.0, 3.0]


def test_creases_have_no_squares():
    nodes, quads = lattice(np.array([0, 1, 1, 2]), open_lines(2))
    assert len(nodes) == 4 * 3
    assert len(quads) == 2 * 2
    columns = nodes[quads][..., 0] // 2
    assert {tuple(row) for row in columns.tolist()} == {(0, 1, 1, 0), (2, 3, 3, 2)}


def test_an_open_grid_has_two_triangles_a_square():
    grid = make_grid(open_lines(3), open_lines(2))
    assert len(grid.faces) == 2 * 3 * 2
    np.testing.assert_array_equal(grid.vertex_ids, np.arange(12))
    a, b, c = np.moveaxis(grid.nodes[grid.faces].astype(float), 1, 0)
    assert (np.linalg.det(np.stack([b - a, c - a], axis=1)) == 4.0).all()  # half steps, wound up


def test_a_pole_is_a_fan_with_nodes_in_the_middle():
    grid = make_grid(closed_lines(4), open_lines(1), poles=np.array([True, False]))
    assert len(grid.faces) == 4
    assert len(set(grid.vertex_ids[grid.faces].ravel().tolist())) == 5
    assert grid.nodes[grid.faces[:, 0]].tolist() == [[1, 0], [3, 0], [5, 0], [7, 0]]


@pytest.mark.parametrize("side", range(4))
def test_a_square_with_a_side_that_is_a_point(side):
    ids = np.arange(4)
    ids[(side + 1) % 4] = ids[side]
    nodes = np.array([[0, 0], [2, 0], [2, 2], [0, 2]])
    grid = triangulate(nodes, ids, np.array([[0, 1, 2, 3]]))
    assert len(grid.faces) == 1
    corners = grid.nodes[grid.faces[0]]
    assert corners[0].tolist() == ((nodes[side] + nodes[(side + 1) % 4]) // 2).tolist()
    assert np.linalg.det(np.array([corners[1] - corners[0], corners[2] - corners[0]])) > 0


@pytest.mark.parametrize("ids", [[0, 0, 1, 1], [0, 1, 1, 0], [0, 0, 0, 1], [0, 0, 0, 0]])
def test_a_square_without_area_is_dropped(ids):
    nodes = np.array([[0, 0], [2, 0], [2, 2], [0, 2]])
    assert len(triangulate(nodes, np.array(ids), np.array([[0, 1, 2, 3]])).faces) == 0


def test_opposite_corners_in_one_vertex_leave_no_triangle_with_that_twice():
    nodes = np.array([[0, 0], [2, 0], [2, 2], [0, 2]])
    for ids in [0, 1, 0, 2], [0, 1, 2, 1]:
        faces = triangulate(nodes, np.array(ids), np.array([[0, 1, 2, 3]])).faces
        assert all(len({ids[node] for node in face}) == 3 for face in faces.tolist())
