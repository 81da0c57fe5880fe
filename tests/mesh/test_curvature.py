"""Mean curvature at vertices, against surfaces whose curvature is known."""

import numpy as np
import pytest

from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import vertex_curvatures
from texbake.mesh.shapes import cube, icosphere, plane, uv_sphere


def scaled(mesh, factor, move=0.0):
    return mesh.replace(positions=mesh.positions * factor + move)


def tube(n_around=256, n_along=8, radius=0.25):
    """An open cylinder about z, of squares cut in two, one unit of arc as long as along."""
    step = 2.0 * np.pi * radius / n_around
    turns, heights = np.meshgrid(np.arange(n_around), np.arange(n_along + 1))
    angles = 2.0 * np.pi * turns / n_around
    points = np.stack([radius * np.cos(angles), radius * np.sin(angles), step * heights], axis=-1)
    here = (heights[:-1] * n_around + turns[:-1]).ravel()
    there = (heights[:-1] * n_around + (turns[:-1] + 1) % n_around).ravel()
    faces = np.concatenate(
        [
            np.stack([here, there, there + n_around], axis=1),
            np.stack([here, there + n_around, here + n_around], axis=1),
        ]
    )
    return Mesh(positions=points.reshape(-1, 3), faces=faces)


@pytest.mark.parametrize("radius", [1.0, 3.0, 1e-4, 1e6])
def test_a_sphere_with_radial_normals_has_one_over_its_radius_exactly(radius):
    ball = icosphere(3)
    found = vertex_curvatures(scaled(ball, radius), normals=ball.positions)
    # A few roundings of float64 over some faces; the chord's error cancels in the divergence.
    np.testing.assert_allclose(found, 1.0 / radius, rtol=1e-12)


def test_a_sphere_with_its_own_normals_has_one_over_its_radius():
    errors = [np.abs(vertex_curvatures(uv_sphere(n, 2 * n)) - 1.0) for n in (32, 64, 128)]
    # Normals that are averaged over faces are off by the squares of their widths in the mean, and
    # about the poles, where the faces are no neighbors' mirror images, by their widths.
    assert errors[2].max() < errors[1].max() / 1.9 < errors[0].max() / 1.9**2 < 0.005
    assert errors[2].mean() < errors[1].mean() / 3.0 < errors[0].mean() / 9.0 < 2e-4


def test_turned_inside_out_it_is_hollow():
    ball = icosphere(2)
    inside = ball.replace(faces=ball.faces[:, ::-1])
    np.testing.assert_allclose(vertex_curvatures(inside), -vertex_curvatures(ball), rtol=1e-12)


def test_a_cylinder_bends_along_one_way_only():
    mesh = tube()
    found = vertex_curvatures(mesh).reshape(9, -1)
    # 1 / r around, 0 along, and so half of it in the mean; the chords take (pi / 256)^2 of it.
    np.testing.assert_allclose(found[2:-2], 2.0, rtol=(np.pi / 256) ** 2)


def test_a_saddle_bends_both_ways_alike():
    mesh = plane(64, 64, lambda x, y: 0.5 * ((x - 0.5) ** 2 - (y - 0.5) ** 2))
    found = vertex_curvatures(mesh).reshape(65, 65)
    # Curvatures 1 and -1 in the middle; what is left is the diagonal's, of the size of the squares.
    assert abs(found[32, 32]) < 1e-3
    bowl = plane(64, 64, lambda x, y: 0.5 * ((x - 0.5) ** 2 + (y - 0.5) ** 2))
    # Hollow seen from above; 1/64^2 is the square of the step.
    assert vertex_curvatures(bowl).reshape(65, 65)[32, 32] == pytest.approx(-1.0, abs=1e-3)


def test_a_plane_is_flat_exactly():
    assert not vertex_curvatures(plane(7, 5)).any()


def test_edges_of_a_cube_are_convex_at_all_vertices():
    found = vertex_curvatures(cube())
    assert found.min() > 0.0


@pytest.mark.parametrize("factor", [2.0**-40, 2.0**40])
def test_size_by_a_power_of_two_changes_no_digit(factor):
    ball = icosphere(2)
    found = vertex_curvatures(scaled(ball, factor))
    np.testing.assert_array_equal(found * factor, vertex_curvatures(ball))


def test_a_mesh_far_away_bends_as_it_does_here():
    ball = scaled(icosphere(2), 1.0)
    # 1e6 leaves 1e-10 of a unit to positions; divided by edges of 0.3 and again by 0.3.
    found = vertex_curvatures(scaled(ball, 1.0, 1e6))
    np.testing.assert_allclose(found, vertex_curvatures(ball), atol=1e-8)


def test_vertices_at_one_position_agree():
    ball = icosphere(1)
    split = Mesh(positions=ball.positions[ball.faces].reshape(-1, 3),
                 faces=np.arange(3 * ball.n_faces).reshape(-1, 3))  # fmt: skip
    np.testing.assert_allclose(
        vertex_curvatures(split)[split.faces], vertex_curvatures(ball)[ball.faces], rtol=1e-12
    )


def test_faces_without_area_and_lone_vertices_are_flat():
    mesh = Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [9, 9, 9]],
        faces=[[0, 1, 2], [0, 2, 3]],
    )
    assert vertex_curvatures(mesh).tolist() == [0.0] * 5
