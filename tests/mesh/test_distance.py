"""Distances between surfaces that have a closed form, and how evenly samples lie."""

import numpy as np
import pytest

from tests.models import moved
from texbake import Mesh, OptionError, surface_distance
from texbake.core import core
from texbake.mesh.distance import sample_surface
from texbake.mesh.shapes import cube, icosphere, plane, uv_sphere
from texbake.mesh.triangle_tree import TriangleTree


def test_shifted_plane():
    distance = surface_distance(plane(3, 2), moved(plane(1, 5), by=[0, 0, 0.25]), n_samples=1000)
    for side in (distance.a_to_b, distance.b_to_a):
        # A power of two, through powers of two: nothing rounds but the mean of squares.
        assert (side.max, side.mean, side.p99) == (0.25, 0.25, 0.25)
        assert side.rms == pytest.approx(0.25, rel=1e-15)
    assert distance.diagonal == pytest.approx(np.sqrt(2.0 + 0.25**2), rel=1e-15)
    assert distance.max_relative == distance.max / distance.diagonal


def test_sloped_plane_has_the_moments_of_a_uniform_distribution():
    sloped = plane(1, 1, lambda x, y: 0.01 * x)
    distance = surface_distance(plane(), sloped, n_samples=100_000).b_to_a
    # Stratified samples: the error of a mean falls as 1 / n, not as 1 / sqrt(n).
    assert distance.mean == pytest.approx(0.005, rel=1e-4)
    assert distance.rms == pytest.approx(0.01 / np.sqrt(3.0), rel=1e-4)
    assert distance.max == pytest.approx(0.01, rel=1e-12)  # a vertex


def test_one_sided_parts_count():
    # The whole against its half: nothing one way, half a unit the other.
    half = Mesh(positions=plane().positions * [0.5, 1.0, 1.0], faces=plane().faces)
    distance = surface_distance(half, plane(), n_samples=20_000)
    assert distance.a_to_b.max < 1e-16
    assert (distance.b_to_a.max, distance.max) == (0.5, 0.5)
    assert distance.mean == pytest.approx(0.125, rel=1e-3)


def test_the_greatest_distance_lies_on_an_edge_that_bridges_a_valley():
    x, y, _ = plane(8, 8).positions.T
    valley = plane(8, 8).replace(positions=np.stack([4 * x - 2, 4 * y - 2, abs(4 * y - 2)], 1))
    corners = [[0.0, -1.0, 1.0], [0.0, 1.0, 1.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]
    bridge = Mesh(positions=corners, faces=[[0, 2, 1], [0, 1, 3]])
    for seed in range(5):
        distance = surface_distance(bridge, valley, n_samples=50, seed=seed)
        assert distance.a_to_b.max == pytest.approx(np.sqrt(0.5), rel=1e-12)


def test_threads_change_nothing_and_seeds_do():
    a, b = icosphere(3), uv_sphere(9, 14)
    one = surface_distance(a, b, n_samples=30_000, threads=1)
    assert surface_distance(a, b, n_samples=30_000, threads=3) == one
    assert surface_distance(a, b, n_samples=30_000, seed=1) != one


def test_the_error_of_the_rms_distance_covers_it():
    sloped = plane(1, 1, lambda x, y: 0.01 * x)
    for seed in range(20):
        side = surface_distance(plane(), sloped, n_samples=200, seed=seed).b_to_a
        assert abs(side.rms - 0.01 / np.sqrt(3.0)) < side.rms_error < 0.1 * side.rms


@pytest.mark.parametrize("is_shuffled", [False, True])
def test_few_points_find_the_same_distances_with_runs_of_faces(is_shuffled):
    mesh, random = uv_sphere(80, 160), np.random.default_rng(5)
    faces = mesh.faces[random.permutation(mesh.n_faces)] if is_shuffled else mesh.faces
    points = random.normal(size=(100, 3))
    tree = TriangleTree.for_points(len(points), mesh.positions, faces)
    finest = TriangleTree.build(mesh.positions, faces)
    assert (len(tree.nodes) < 0.25 * len(finest.nodes)) != is_shuffled
    distances, expected = (each.closest_points(points)[0] for each in (tree, finest))
    assert distances == pytest.approx(expected, rel=1e-12)


def test_unused_vertices_do_not_count_and_meshes_may_lack_size_or_area():
    stray = Mesh(positions=np.concatenate([plane().positions, [[9.0, 9, 9]]]), faces=plane().faces)
    distance = surface_distance(stray, plane(), n_samples=100)
    assert distance.max < 1e-15
    assert distance.diagonal == pytest.approx(np.sqrt(2.0), rel=1e-15)
    point = Mesh(positions=np.ones((3, 3)), faces=[[0, 1, 2]])
    distance = surface_distance(point, point, n_samples=10)
    assert (distance.max, distance.rms_relative, distance.diagonal) == (0.0, 0.0, 0.0)
    line = Mesh(positions=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], faces=[[0, 1, 2]])
    assert surface_distance(line, moved(line, by=[0, 1, 0]), n_samples=10).mean == 1.0


def test_samples_lie_on_their_faces_in_order():
    mesh = uv_sphere(9, 14)
    points, face_ids, barycentrics = sample_surface(mesh, 5000, seed=3)
    assert np.all(np.diff(face_ids) >= 0)
    assert barycentrics.min() >= 0.0
    assert np.abs(barycentrics.sum(axis=1) - 1.0).max() < 1e-15
    corners = mesh.positions[mesh.faces[face_ids]]
    assert np.abs(np.einsum("nc,ncx->nx", barycentrics, corners) - points).max() < 1e-15


def test_each_face_gets_its_share_of_samples():
    mesh = uv_sphere(9, 14)
    a, b, c = np.moveaxis(mesh.positions[mesh.faces], 1, 0)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    n = 10_000
    _, face_ids, _ = sample_surface(mesh, n)
    share = n * areas / areas.sum()
    # One sample a step of area: a face can gain or lose at most one at either end.
    assert np.abs(np.bincount(face_ids, minlength=mesh.n_faces) - share).max() < 2.0


def test_samples_within_a_face_are_spread_evenly():
    points, _, _ = sample_surface(plane(), 4096, seed=5)
    counts, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=8, range=[[0, 1], [0, 1]])
    # 64 expected in each cell. Independent points would be off by 8 in the mean square.
    assert np.sqrt(np.mean((counts - 64.0) ** 2)) < 4.0


def test_faces_without_area_get_no_sample():
    mesh = cube()
    flat = np.array([[0, 0, 1], [2, 2, 2]])
    with_flat = mesh.replace(faces=np.concatenate([flat, mesh.faces, flat]))
    _, face_ids, _ = sample_surface(with_flat, 1000)
    assert (face_ids.min(), face_ids.max()) == (2, 13)


def test_no_samples_is_an_error():
    with pytest.raises(OptionError, match="at least 1"):
        surface_distance(plane(), plane(), n_samples=0)
    with pytest.raises(OptionError, match="at least 1"):
        sample_surface(plane(), 0)


@pytest.mark.parametrize("seed", [0, 1, 12345, (1 << 32) - 1, 1 << 32, (1 << 64) - 1])
def test_random_numbers_are_those_of_numpy(seed):
    values = np.empty(1000)
    core.draw_uniform(seed, values)
    assert np.array_equal(values, np.random.default_rng(seed).random(1000))


def test_a_tree_without_faces_has_no_closest_point():
    tree = TriangleTree.build(np.eye(3), np.empty((0, 3), np.int32))
    distances, faces, weights = tree.closest_points(np.zeros((2, 3)))
    assert np.isinf(distances).all() and (faces == -1).all() and (weights == 0.0).all()
