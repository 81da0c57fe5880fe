"""Bevels: where they count as hard edges, and planes that seams leave whole."""

from __future__ import annotations

import numpy as np
import pytest

from texbake.mapping.atlas.bevels import labels_of_planes
from texbake.mapping.atlas.cutting.cut import surface_of
from texbake.mapping.atlas.edge_weights import edge_weights
from texbake.mapping.seams import chart_ids, seam_edges
from texbake.mapping.unwrap import unwrap
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import icosphere, plane
from texbake.study.bench.solids import beveled_box


def angles_of(mesh):
    """Half-edges with neighbors, the angles at them before and after, and which lie in planes."""
    surface = surface_of(mesh)
    corners, _, opposite = surface.joints
    edges = np.flatnonzero(opposite >= 0).astype(np.int32)
    a, b, c = (surface.points[corners[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    cosines = (normals[edges // 3] * normals[opposite[edges] // 3]).sum(axis=1)
    plain = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
    found, is_flat = surface.bevels.angles, surface.bevels.within
    return edges, plain, found, is_flat


def rounded_prism(radius, n_segments):
    """The walls of a prism over a square with sides of 1, its corners rounded."""
    turns = np.linspace(0.0, np.pi / 2.0, n_segments + 1)
    inner = 0.5 - radius
    outline = np.concatenate(
        [
            np.stack(
                [inner * x + radius * np.cos(t + turns), inner * y + radius * np.sin(t + turns)]
            )
            for t, x, y in zip(
                np.arange(4) * np.pi / 2.0, (1, -1, -1, 1), (1, 1, -1, -1), strict=True
            )
        ],
        axis=1,
    ).T
    n = len(outline)
    points = np.concatenate([np.insert(outline, 2, height, axis=1) for height in (0.0, 1.0)])
    low, next_low = np.arange(n), (np.arange(n) + 1) % n
    faces = [(low, next_low, next_low + n), (low, next_low + n, low + n)]
    return Mesh(
        positions=points,
        faces=np.concatenate([np.stack(each, axis=1) for each in faces]).astype(np.int32),
        name="prism",
    )


@pytest.mark.parametrize("n_segments", [1, 2, 3, 6])
def test_a_bevel_is_one_hard_edge(n_segments):
    mesh = rounded_prism(0.04, n_segments)
    edges, plain, found, is_flat = angles_of(mesh)
    changed = found > plain + 1.0
    assert np.count_nonzero(changed) == 8  # the half-edges of one row at each of four corners
    assert np.allclose(found[changed], 90.0, atol=0.1)
    assert (found >= plain - 1e-4).all()
    weights = edge_weights(surface_of(mesh)).weights.ravel()
    assert np.allclose(weights[edges[changed]], 0.3)
    assert (weights[edges[is_flat]] == 3.0).all()


def test_wide_fillets_and_round_surfaces_have_no_bevels():
    for mesh in (rounded_prism(0.3, 8), icosphere(5)):
        _, plain, found, _ = angles_of(mesh)
        assert np.allclose(found, plain, atol=1e-4)
    *_, is_flat = angles_of(icosphere(7))  # neighbors turn by less than a degree
    assert not is_flat.any()


def test_the_size_of_a_model_changes_no_bevel():
    for mesh in (rounded_prism(0.04, 3), beveled_box(2_000)):
        scaled = mesh.replace(positions=mesh.positions * 300.0 + 17.0)
        small, large = (angles_of(each)[2] for each in (mesh, scaled))
        assert np.allclose(small, large, atol=0.1)


@pytest.mark.parametrize("n_triangles", [1_500, 3_000, 6_000])
@pytest.mark.parametrize("quality", ["fast", "good"])
def test_seams_leave_the_planes_of_a_beveled_box_whole(quality, n_triangles):
    mesh = beveled_box(n_triangles)
    cut = seam_edges(unwrap(mesh, quality=quality))
    ends = mesh.positions[np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2)[cut]]
    middles = np.sort(np.abs(ends.mean(axis=1)), axis=1)
    assert len(ends) and not ((middles[:, 2] > 0.5 - 1e-9) & (middles[:, 1] < 0.41)).any()


def test_the_faces_of_a_plane_get_one_label_but_not_those_of_no_chart_or_of_a_cut_polygon():
    planes = np.array([0, 0, 0, 0, 0, 5, 5, -1, -1], dtype=np.int32)
    labels = np.array([2, 2, 2, 1, -1, 3, 4, 1, 1], dtype=np.int32)
    polygons = np.array([0, 1, 2, 3, 4, 5, 6, 3, 8], dtype=np.int32)
    most = labels_of_planes(planes, labels, least_share=0.75)
    np.testing.assert_array_equal(most, [2, 2, 2, 2, -1, 3, 4, 1, 1])
    whole = labels_of_planes(planes, labels, polygons, least_share=0.75)
    np.testing.assert_array_equal(whole, labels)


def test_a_plane_is_flat_as_a_whole():
    _, _, found, is_flat = angles_of(plane(6, 6))
    assert is_flat.all() and np.allclose(found, 0.0)


def test_the_flat_sides_of_a_ring_are_charts():
    """Each has 31 % of the area, and a hole, and yet nobody would cut it."""
    n = 32
    turns = 2.0 * np.pi * np.arange(n) / n
    circle = np.stack([np.cos(turns), np.sin(turns), np.zeros(n)], axis=1)
    out, up = np.array([1.0, 1.0, 0.0]), np.array([0.0, 0.0, 0.3])
    loops = np.stack([circle, circle + up, 0.5 * out * circle + up, 0.5 * out * circle])
    ids = np.arange(4 * n).reshape(4, n)
    a, b = ids, np.roll(ids, -1, axis=1)
    c, d = np.roll(b, -1, axis=0), np.roll(a, -1, axis=0)
    faces = np.concatenate(
        [np.stack(each, axis=-1).reshape(-1, 3) for each in ((a, b, c), (a, c, d))]
    )
    mesh = Mesh(positions=loops.reshape(-1, 3), faces=faces.astype(np.int32), name="ring")
    unwrapped = unwrap(mesh, quality="fast")
    flat = np.ptp(mesh.positions[mesh.faces][:, :, 2], axis=1) == 0.0
    high = mesh.positions[mesh.faces][:, 0, 2] > 0.1
    ids = chart_ids(unwrapped)
    assert [len(np.unique(ids[flat & side])) for side in (high, ~high)] == [1, 1]
