"""Stacks of equal triangles, and loose ones: what trees, rays and atlases do with thousands."""

import numpy as np
import pytest

import texbake
from texbake.core import core
from texbake.mapping.areas import signed_areas, surface_areas
from texbake.mapping.atlas.lone_faces import find_lone_faces, lone_charts
from texbake.mapping.overlap import find_overlaps
from texbake.mesh.copies import without_copies
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import icosphere
from texbake.mesh.triangle_tree import TriangleTree
from texbake.raycast import outside
from texbake.raycast.morton_tree import MortonTree

N = 3000


def stack(n=N):
    positions = np.tile([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], (n, 1))
    return Mesh(positions=positions, faces=np.arange(3 * n, dtype=np.int32).reshape(-1, 3))


def loose(n=N):
    rng = np.random.default_rng(1)
    corners = rng.random((n, 1, 3)) * 20.0 + rng.random((n, 3, 3))
    faces = np.arange(3 * n, dtype=np.int32).reshape(-1, 3)
    return Mesh(positions=corners.reshape(-1, 3), faces=faces)


def test_the_first_of_a_stack_is_kept():
    mesh = stack()
    ids, codes = np.arange(N, dtype=np.int32), np.zeros(N, dtype=np.uint64)
    kept = without_copies(mesh.positions, mesh.faces, ids, codes)
    assert np.flatnonzero(kept).tolist() == [0]
    few = without_copies(mesh.positions, mesh.faces, ids[:256], codes[:256])
    assert few.all()


def test_equal_codes_alone_are_no_copies():
    mesh = loose()
    kept = without_copies(
        mesh.positions, mesh.faces, np.arange(N, dtype=np.int32), np.zeros(N, dtype=np.uint64)
    )
    assert kept.all()


def test_trees_look_at_a_stack_once():
    mesh = stack()
    tree = TriangleTree.build(mesh.positions, mesh.faces)
    assert tree.order.tolist() == [0]
    distances, faces, weights = tree.closest_points(np.array([[0.25, 0.25, 2.0]]))
    assert distances.tolist() == [2.0] and faces.tolist() == [0]
    np.testing.assert_allclose(weights, [[0.5, 0.25, 0.25]], atol=1e-12)
    assert (MortonTree.build(mesh, LocalFrame.around(mesh), threads=1).ids >= 0).sum() == 1


def test_rays_through_triangles_that_overlap_are_bounded(monkeypatch):
    rng = np.random.default_rng(2)
    n = 400
    mesh = Mesh(
        positions=rng.random((3 * n, 3)), faces=np.arange(3 * n, dtype=np.int32).reshape(-1, 3)
    )
    free = outside._points_allowed(mesh)
    monkeypatch.setattr(outside, "_BOXES_ALLOWED", 1_000_000)
    assert outside._points_allowed(mesh) < free / 50.0
    parts = np.arange(n, dtype=np.int32)
    points = outside._points(mesh, parts, np.zeros(n, dtype=np.bool_), n)
    assert 0 < points.left_out.sum() < n
    assert len(points.parts) <= outside._points_allowed(mesh)
    assert not points.left_out[points.parts].any()


def test_loose_triangles_keep_their_shapes():
    mesh = loose()
    lone, others = find_lone_faces(mesh.positions, mesh.faces, None, 1)
    assert len(lone) == N and len(others) == 0
    charts = lone_charts(mesh.positions, mesh.faces)
    flat, space = charts.uvs[charts.faces], mesh.positions[mesh.faces]
    for values in flat, space:
        assert values.shape[:2] == (N, 3)
    lengths = [np.linalg.norm(v - np.roll(v, 1, axis=1), axis=2) for v in (flat, space)]
    np.testing.assert_allclose(lengths[0], lengths[1], rtol=1e-9)


@pytest.mark.parametrize("make", [stack, loose])
def test_an_atlas_holds_a_surface_and_loose_triangles(make):
    soup, ball = make(), icosphere()
    faces = np.concatenate([soup.faces, ball.faces + soup.n_vertices])
    mesh = Mesh(positions=np.concatenate([soup.positions, ball.positions + 30.0]), faces=faces)
    corners = texbake.unwrap(mesh, size=1024, padding=1).corner_uvs()
    assert (corners >= 0.0).all() and (corners <= 1.0).all()
    assert not find_overlaps(corners).overlapping.any()
    densities = signed_areas(corners) / surface_areas(mesh.positions[mesh.faces])
    # Corners lie on a grid of 2^-20 of the size of the mesh, which moves the narrowest ones most.
    np.testing.assert_allclose(densities[: soup.n_faces], densities[0], rtol=1e-2)


def test_the_core_takes_fewer_places_than_faces():
    mesh = stack(4)
    ids, codes = np.array([2], dtype=np.int32), np.zeros(1, dtype=np.uint64)
    boxes, nodes = np.empty((8, 6), dtype=np.float32), np.empty((8, 2), dtype=np.int32)
    assert core.build_triangle_tree(mesh.positions, mesh.faces, ids, codes, boxes, nodes) == 1
    assert nodes[0].tolist() == [0, 1]
