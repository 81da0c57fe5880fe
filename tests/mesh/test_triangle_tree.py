"""Closest points: closed forms, brute force, degenerate triangles, determinism."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake.mesh.shapes import cube, grid_sphere, icosphere
from texbake.mesh.triangle_tree import TriangleTree

# Distances come from differences of coordinates of about 1: up to some ten units of 2^-53.
ROUNDING = 4e-15


def closest_on_segment(p, a, b):
    ab = b - a
    length_squared = ab @ ab
    t = np.clip((p - a) @ ab / length_squared, 0.0, 1.0) if length_squared > 0.0 else 0.0
    return np.linalg.norm(p - (a + t * ab))


def brute_force(p, corners):
    """Distance to one triangle by another way: its plane if p is above it, else its edges."""
    a, b, c = corners
    distances = [closest_on_segment(p, *edge) for edge in ((a, b), (b, c), (c, a))]
    normal = np.cross(b - a, c - a)
    if normal @ normal > 1e-20:
        sides = [np.cross(q - r, p - r) @ normal for r, q in ((a, b), (b, c), (c, a))]
        if min(sides) >= 0.0:
            distances.append(abs((p - a) @ normal) / np.linalg.norm(normal))
    return min(distances)


@pytest.mark.parametrize("n_faces", [1, 5, 64])
@pytest.mark.parametrize("has_directions", [False, True])
def test_any_triangles_agree_with_brute_force(n_faces, has_directions):
    """With directions, only triangles that face them count."""
    rng = np.random.default_rng(n_faces)
    corners = rng.uniform(-0.5, 0.5, size=(n_faces, 3, 3))
    corners[::3] = corners[::3, :1] + 0.01 * rng.normal(size=corners[::3].shape)
    tree = TriangleTree.build(corners.reshape(-1, 3), np.arange(3 * n_faces).reshape(-1, 3))
    points, facing = rng.normal(size=(2, 100, 3))
    distances, face_ids, _ = tree.closest_points(points, facing=facing if has_directions else None)
    expected = np.array([[brute_force(p, triangle) for triangle in corners] for p in points])
    if has_directions:
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        expected[facing @ normals.T <= 0.0] = np.inf
    np.testing.assert_allclose(distances, expected.min(axis=1), rtol=0.0, atol=1e-13)
    found = face_ids >= 0
    assert (found == np.isfinite(distances)).all()
    at_face = np.take_along_axis(expected, face_ids[:, None], axis=1)[:, 0]
    np.testing.assert_allclose(at_face[found], distances[found], rtol=0.0, atol=1e-13)


def test_any_point_that_is_near_enough_will_do():
    rng = np.random.default_rng(4)
    sphere = icosphere(3)
    tree = TriangleTree.build(sphere.positions, sphere.faces)
    points = np.cumsum(rng.normal(scale=0.1, size=(400, 3)), axis=0)
    exact, *_ = tree.closest_points(points)
    distances, *_ = tree.closest_points(points, enough=0.5)
    far = exact > 0.5
    np.testing.assert_array_equal(distances[far], exact[far])
    assert (distances[~far] <= 0.5).all() and (distances >= exact).all()
    assert 20 < far.sum() < 380 and (distances > exact).sum() > 20


coordinate = st.sampled_from([-1.0, -0.5, 0.0, 1e-9, 0.25, 0.5, 1.0])
point = st.tuples(coordinate, coordinate, coordinate)


@given(st.lists(point, min_size=3, max_size=3), point)
@settings(max_examples=400)
def test_degenerate_triangles_are_their_points_and_edges(corners, p):
    corners, p = np.array(corners), np.array(p)
    tree = TriangleTree.build(corners, [[0, 1, 2]])
    (distance,), (face,), (weights,) = tree.closest_points(p[None])
    assert face == 0
    # 1e-9: heights that this small are in the data, and brute force takes them as flat.
    assert distance == pytest.approx(brute_force(p, corners), abs=2e-9)
    assert np.linalg.norm(weights @ corners - p) == pytest.approx(distance, abs=1e-15)


@pytest.mark.parametrize("height", [1e-3, 1e-9, 1e-13, 1e-15, 0.0])
def test_needles_are_as_exact_as_other_triangles(height):
    rng = np.random.default_rng(1)
    for _ in range(50):
        corners = rng.uniform(-0.5, 0.5, size=(3, 3))
        along = rng.uniform(-0.5, 1.5)  # also beyond the others, on their line
        corners[2] = corners[0] + along * (corners[1] - corners[0]) + height * rng.normal(size=3)
        corners = corners[rng.permutation(3)]
        tree = TriangleTree.build(corners, [[0, 1, 2]])
        on_it = rng.dirichlet([1.0, 1.0, 1.0], size=20) @ corners
        assert tree.closest_points(on_it)[0].max() < ROUNDING
        around = rng.normal(size=(20, 3))
        edges = [(corners[i], corners[i - 1]) for i in range(3)]
        to_edges = [min(closest_on_segment(p, *edge) for edge in edges) for p in around]
        nearer = to_edges - tree.closest_points(around)[0]
        assert nearer.min() > -ROUNDING
        assert nearer.max() < 5.0 * height + ROUNDING  # 5: what `normal` rarely goes beyond


def test_max_distance_leaves_far_points_without_a_face():
    tree = TriangleTree.build(cube().positions, cube().faces)
    points = np.array([[0.0, 0.0, 0.75], [0.0, 0.0, 0.76], [0.0, 0.0, 0.74]])
    distances, face_ids, barycentrics = tree.closest_points(points, max_distance=0.25)
    assert distances[0] == 0.25  # within includes at
    assert distances[1] == np.inf
    assert face_ids[1] == -1
    assert not barycentrics[1].any()
    assert distances[2] == pytest.approx(0.24)


def test_answers_do_not_depend_on_threads_order_or_place():
    mesh = grid_sphere(60, 120)
    rng = np.random.default_rng(2)
    points = rng.normal(size=(20_000, 3))
    tree = TriangleTree.build(mesh.positions, mesh.faces, threads=1)
    one = tree.closest_points(points, threads=1)
    again = TriangleTree.build(mesh.positions, mesh.faces, threads=3)
    for a, b in zip(one, again.closest_points(points, threads=3), strict=True):
        assert a.tobytes() == b.tobytes()
    order = rng.permutation(len(points))
    assert np.array_equal(tree.closest_points(points[order])[0], one[0][order])
    # Far from the origin float32 boxes are loose; the answers are not.
    far = np.array([1e6, -2e6, 3e6])
    moved = TriangleTree.build(mesh.positions + far, mesh.faces).closest_points(points[:200] + far)
    assert np.abs(moved[0] - one[0][:200]).max() < 1e-8  # 2^-53 of 3e6, a few times
