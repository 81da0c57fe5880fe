"""Stacks of equal triangles, and loose ones: what trees, rays and atlases do with thousands."""

import numpy as np
import pytest

import texbake
from texbake import Mesh, RemeshOptions
from texbake.baking import texels
from texbake.core import core
from texbake.errors import MeshError
from texbake.mapping.overlap import find_overlaps
from texbake.mesh import distance, piecewise, remesh as remesh_module
from texbake.mesh.decimate import weld_corners
from texbake.mesh.frame import LocalFrame
from texbake.mesh.remesh import remesh_with_report
from texbake.mesh.remeshing import band
from texbake.mesh.remeshing.parts import winding_numbers
from texbake.mesh.shapes import icosphere, uv_sphere
from texbake.mesh.simplify import simplify_with_report
from texbake.mesh.triangle_tree import TriangleTree
from texbake.mesh.weld import later_copies, without_copies
from texbake.raycast import orientation
from texbake.raycast.morton_tree import MortonTree

N = 3000


def of_corners(corners):
    points = np.reshape(corners, (-1, 3))
    return Mesh(positions=points, faces=np.arange(len(points), dtype=np.int32).reshape(-1, 3))


def stack(n=N):
    return of_corners(np.tile([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], (n, 1)))


def loose(n=N):
    rng = np.random.default_rng(1)
    return of_corners(rng.random((n, 1, 3)) * 20.0 + rng.random((n, 3, 3)))


def stacks(n=N, n_different=20):
    """Many copies of each of some triangles that lie across one another."""
    corners = np.random.default_rng(3).random((n_different, 3, 3))
    return of_corners(corners[np.arange(n) % n_different])


def crossing(n):
    return of_corners(np.random.default_rng(7).random((3 * n, 3)))


def star(n):
    """Triangles in all directions that share one vertex and no edge."""
    ends = np.random.default_rng(8).normal(size=(n, 2, 3))
    ends[:, 1] = ends[:, 0] + 0.01 * ends[:, 1]
    ring = np.arange(1, 2 * n + 1, dtype=np.int32).reshape(-1, 2)
    faces = np.concatenate([np.zeros((n, 1), dtype=np.int32), ring], axis=1)
    return Mesh(positions=np.concatenate([np.zeros((1, 3)), ends.reshape(-1, 3)]), faces=faces)


def nearly_equal(mesh):
    """The mesh with each coordinate moved by up to four units in the last place of 1."""
    moves = np.random.default_rng(4).integers(-4, 5, mesh.positions.shape) * 2.0**-52
    return mesh.replace(positions=mesh.positions + moves)


@pytest.mark.parametrize("n_kept", [1, 2])
def test_all_rows_but_the_first_ones_of_a_kind_are_later_copies(n_kept):
    rows = np.random.default_rng(5).integers(0, 3, (500, 3)).astype(np.int32)
    seen = {}
    for row, is_later in zip(rows.tolist(), later_copies(rows, n_kept=n_kept), strict=True):
        seen[tuple(row)] = seen.get(tuple(row), 0) + 1
        assert is_later == (seen[tuple(row)] > n_kept)


def test_the_first_of_a_stack_is_kept_and_equal_codes_alone_are_no_copies():
    def kept(mesh, n=N):
        ids, codes = np.arange(n, dtype=np.int32), np.zeros(n, dtype=np.uint64)
        return np.flatnonzero(without_copies(mesh.positions, mesh.faces, ids, codes))

    assert kept(stack()).tolist() == [0]
    assert len(kept(stack(), 256)) == 256
    assert len(kept(loose())) == N


@pytest.mark.parametrize("mesh", [stack(), nearly_equal(stack())], ids=["equal", "nearly equal"])
def test_trees_look_at_a_stack_once(mesh):
    tree = TriangleTree.build(mesh.positions, mesh.faces)
    assert tree.order.tolist() == [0]
    distances, faces, weights = tree.closest_points(np.array([[0.25, 0.25, 2.0]]))
    np.testing.assert_allclose(distances, [2.0], rtol=1e-12)
    assert faces.tolist() == [0]
    np.testing.assert_allclose(weights, [[0.5, 0.25, 0.25]], atol=1e-12)
    assert (MortonTree.build(mesh, LocalFrame.around(mesh), threads=1).ids >= 0).sum() == 1


def test_rays_through_triangles_that_overlap_are_bounded(monkeypatch):
    n = 400
    mesh = crossing(n)
    free = orientation.points_allowed(mesh)
    monkeypatch.setattr(orientation, "_BOXES_ALLOWED", 1_000_000)
    assert orientation.points_allowed(mesh) < free / 50.0
    parts = np.arange(n, dtype=np.int32)
    points = orientation._points(mesh, np.ones(n), parts, np.zeros(n, dtype=np.bool_), n)
    assert 0 < points.left_out.sum() < n
    assert len(points.parts) <= orientation.points_allowed(mesh)
    assert not points.left_out[points.parts].any()


@pytest.mark.parametrize("make", [stack, loose])
def test_an_atlas_holds_a_surface_and_loose_triangles(make):
    soup, ball = make(), icosphere()
    faces = np.concatenate([soup.faces, ball.faces + soup.n_vertices])
    mesh = Mesh(positions=np.concatenate([soup.positions, ball.positions + 30.0]), faces=faces)
    corners = texbake.unwrap(mesh, size=1024, padding=1).corner_uvs()
    assert (corners >= 0.0).all() and (corners <= 1.0).all()
    assert not find_overlaps(corners).overlapping.any()
    # Corners lie on a grid of 2^-20 of the size of the mesh, which moves the narrowest ones most.
    flat, space = corners[: soup.n_faces], soup.positions[soup.faces]
    sides = [np.linalg.norm(v - np.roll(v, 1, axis=1), axis=2) for v in (flat, space)]
    np.testing.assert_allclose(sides[0] / sides[1], sides[0][0, 0] / sides[1][0, 0], rtol=1e-2)


def test_the_core_takes_fewer_places_than_faces():
    mesh = stack(4)
    ids, codes = np.array([2], dtype=np.int32), np.zeros(1, dtype=np.uint64)
    boxes, nodes = np.empty((8, 6), dtype=np.float32), np.empty((8, 2), dtype=np.int32)
    assert core.build_triangle_tree(mesh.positions, mesh.faces, ids, codes, 1, boxes, nodes) == 1
    assert nodes[0].tolist() == [0, 1]


def test_stacked_coordinates_are_rasterized_twice(monkeypatch):
    soup = stacks()
    mesh = soup.replace(uvs=nearly_equal(soup).positions[:, :2], uv_faces=soup.faces)
    grid = texels.SampleGrid(64, 64, 1)
    faces = texels.snap_uvs(mesh, grid)
    # Nearly equal coordinates are equal on the grid of the texture, but for a few at its middles.
    assert (faces.last_rows >= faces.first_rows).sum() == 40
    owners, n_overlaps = texels.rasterize_uv(faces, grid)
    monkeypatch.setattr(texels, "_MOST_LAYERS", np.inf)
    every = texels.snap_uvs(mesh, grid)
    assert (every.last_rows >= every.first_rows).all()
    expected, n_expected = texels.rasterize_uv(every, grid)
    assert (owners == expected).all() and n_overlaps == n_expected > 0


def test_distances_to_a_stack_are_measured_once(monkeypatch):
    listed, list_faces = [], band._faces_of_layers

    def spy(positions, faces, n_layers):
        listed.append(len(faces))
        return list_faces(positions, faces, n_layers)

    monkeypatch.setattr(band, "_faces_of_layers", spy)
    mesh = stacks()
    grid = band.Grid.around(mesh, RemeshOptions(resolution=48))
    positions = grid.to_voxels(mesh.positions)
    found = band.Band.around(positions, mesh.faces, grid)
    assert listed == [N, 20]
    monkeypatch.setattr(band, "_MOST_LAYERS_A_FACE", np.inf)
    expected = band.Band.around(positions, mesh.faces, grid)
    assert (found.slots == expected.slots).all()
    assert (found.distances == expected.distances).all()


@pytest.mark.parametrize(("name", "most"), [("_MOST_POINTS", 1e6), ("_MOST_BLOCKS", 5e4)])
def test_triangles_that_fill_the_voxels_many_times_are_refused_at_once(monkeypatch, name, most):
    mesh = crossing(300)
    few = {"_MOST_POINTS": 1e6, "_MOST_FILLS": 0.1, name: most}
    for name_of, value in few.items():
        monkeypatch.setattr(band, name_of, value)
    monkeypatch.setattr(core, "mark_band_blocks", None)  # it would begin the work
    with pytest.raises(MeshError, match=r"use a `resolution` of [0-9]+,") as raised:
        texbake.remesh(mesh, texbake.RemeshOptions(resolution=128))
    monkeypatch.undo()
    for name_of, value in few.items():
        monkeypatch.setattr(band, name_of, value)
    lower = int(str(raised.value).split("`resolution` of ")[1].split(",")[0])
    assert 8 <= lower < 128
    texbake.remesh(mesh, texbake.RemeshOptions(resolution=lower))
    monkeypatch.undo()
    monkeypatch.setattr(band, "_MOST_POINTS", 0.0)  # a mesh that fills no grid is never refused
    texbake.remesh(icosphere(), texbake.RemeshOptions(resolution=32))


def test_searches_among_triangles_that_overlap_are_bounded(monkeypatch):
    mesh, ball = crossing(3000), icosphere()
    many = TriangleTree.build(mesh.positions, mesh.faces).boxes_at_a_point()
    assert 200.0 < many < 3000.0
    assert TriangleTree.build(ball.positions, ball.faces).boxes_at_a_point() < 30.0
    searched = []
    search = TriangleTree.closest_points

    def spy(tree, points, **options):
        searched.append(len(points))
        return search(tree, points, **options)

    monkeypatch.setattr(TriangleTree, "closest_points", spy)
    monkeypatch.setattr(distance, "_BOXES_ALLOWED", 1000.0 * many)
    monkeypatch.setattr(distance, "_BOXES_AT_A_POINT", 0.0)
    found = distance.surface_distance(ball, mesh, n_samples=5000)
    assert searched[0] in (999, 1000) and max(searched[:3]) <= 1000 and searched[3] == 5000
    monkeypatch.setattr(distance, "_BOXES_ALLOWED", 1e99)
    expected = distance.surface_distance(ball, mesh, n_samples=5000)
    np.testing.assert_allclose(found.a_to_b.mean, expected.a_to_b.mean, rtol=0.1)
    assert (found.a_to_b.n_samples, found.a_to_b.n_left_out) == (searched[0], 5000 - searched[0])
    assert (found.b_to_a.n_samples, found.b_to_a.n_left_out) == (5000, 0)
    assert f"at {searched[0]:,} points of the surface instead of 5,000" in found.notes[0]
    assert expected.a_to_b.n_left_out == 0 and expected.notes == ()


def test_distances_at_fewer_points_are_told_in_reports(monkeypatch):
    mesh = crossing(300)
    monkeypatch.setattr(distance, "_BOXES_ALLOWED", 1000.0)
    monkeypatch.setattr(distance, "_BOXES_AT_A_POINT", 0.0)
    _, simplified = simplify_with_report(mesh, 100)
    _, wrapped = remesh_with_report(mesh, texbake.RemeshOptions(resolution=16))
    for report in (simplified, wrapped):
        told = "points of the surface instead of 10,000, because"
        assert sum(told in note for note in report.notes) == 1
    assert simplified.to_json()["distance"]["a_to_b"]["n_left_out"] > 0
    assert wrapped.to_json()["distance"]["n_left_out"] > 0


def test_rooms_that_are_not_tested_are_counted_and_told(monkeypatch):
    balls = [icosphere(2), *(icosphere(2).replace(faces=icosphere(2).faces[:, ::-1]),) * 3]
    placed = zip(balls, [(2.0, 0.0), (0.6, -1.0), (0.4, 0.2), (0.3, 1.1)], strict=True)
    mesh = Mesh(
        positions=np.concatenate([s * ball.positions + [x, 0, 0] for ball, (s, x) in placed]),
        faces=np.concatenate([ball.faces + i * 162 for i, ball in enumerate(balls)]),
    )
    options = texbake.RemeshOptions(resolution=48, keep_interior=True)
    _, report = remesh_with_report(mesh, options)
    assert (report.n_cavities_kept, report.n_rooms_untested, report.notes) == (3, 0, ())
    # The room between the balls is the largest, then their insides from large to small.
    monkeypatch.setattr(remesh_module, "_MOST_FACES_SUMMED", 2000.0)
    _, report = remesh_with_report(mesh, options)
    assert (report.n_cavities_kept, report.n_rooms_untested) == (1, 2)
    assert "count as solid: 2;" in report.notes[0]
    assert report.to_json()["n_rooms_untested"] == 2


def test_of_many_rooms_the_first_are_measured():
    mesh = icosphere()
    points = np.random.default_rng(6).random((500, 3)) * 3.0 - 1.5
    positions = 100.0 * mesh.positions
    whole = winding_numbers(positions, mesh.faces, 100.0 * points)
    some = winding_numbers(positions, mesh.faces, 100.0 * points, most_work=20_000.0)
    n = int(np.isfinite(some).sum())
    assert 10 < n < 490 and np.isnan(some[n:]).all()
    assert (some[:n] == whole[:n]).all()


def test_simplification_begins_without_the_copies_of_a_stack():
    mesh = stack()
    assert len(weld_corners(mesh).faces) == 1
    cells = np.arange(N)[:, None, None] / N + 0.5 / N * mesh.positions[mesh.faces][..., :2]
    mapped = mesh.replace(uvs=cells.reshape(-1, 2), uv_faces=mesh.faces)
    stream = weld_corners(mapped)
    assert len(stream.faces) == 1 and len(stream.points) == 3
    turned = Mesh(positions=mesh.positions, faces=np.concatenate([mesh.faces, [[0, 2, 1]]]))
    assert len(weld_corners(turned).faces) == 2
    assert len(weld_corners(icosphere()).faces) == icosphere().n_faces


def test_a_pole_of_thousands_of_faces_is_nothing_special():
    assert not piecewise._is_crowded(weld_corners(uv_sphere(4, 5000)))
    assert piecewise._is_crowded(weld_corners(star(20_000)))
