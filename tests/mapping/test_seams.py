import math

import numpy as np
import pytest

from texbake.mapping.seams import border_edges, chart_ids, connected_faces, seam_edges, seam_length
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, plane, uv_sphere
from texbake.mesh.topology import edge_ids


def cube_of_squares():
    """The cube with a chart for each side."""
    corners = np.tile(plane().corner_uvs(), (6, 1, 1)) * 0.1
    corners += np.repeat(np.arange(6), 2)[:, None, None] * 0.15
    return cube().replace(
        uvs=corners.reshape(-1, 2), uv_faces=np.arange(36, dtype=np.int32).reshape(-1, 3)
    )


def test_a_cube_cut_along_all_its_edges_and_a_sphere_from_pole_to_pole():
    mesh = cube_of_squares()
    assert chart_ids(mesh).tolist() == np.repeat(np.arange(6), 2).tolist()
    assert (border_edges(mesh).sum(), seam_length(mesh)) == (6 * 4, 12.0)
    n_lat, n_lon = 24, 48
    mesh = uv_sphere(n_lat, n_lon)
    # A half circle of chords, and at each pole every face's own corner cuts the edges to it.
    chord = 2.0 * math.sin(math.pi / n_lat / 2.0)
    spokes = 2 * n_lon
    expected = chord * (n_lat - 2 + spokes)
    assert seam_length(mesh) == pytest.approx(expected, rel=1e-12)


def test_faces_that_touch_at_a_corner_are_two_charts():
    mesh = Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]],
        faces=[[0, 1, 2], [0, 3, 4]],
        uvs=[[0.5, 0.5], [1, 0.5], [0.5, 1], [0, 0.5], [0.5, 0]],
        uv_faces=[[0, 1, 2], [0, 3, 4]],
    )
    assert chart_ids(mesh).tolist() == [0, 1]


def test_both_sides_of_a_cut_are_seams_and_the_ends_of_the_surface_are_none():
    mesh = plane(2, 1)
    apart = mesh.corner_uvs().copy()
    apart[2:] += [0.5, 0.0]  # the right half
    each = np.arange(12, dtype=np.int32).reshape(-1, 3)
    cut = mesh.replace(uvs=apart.reshape(-1, 2), uv_faces=each)
    seams = seam_edges(cut)
    assert seams.sum() == 2
    rows, starts = np.nonzero(seams)
    ends = mesh.positions[np.stack([mesh.faces[rows, starts], mesh.faces[rows, (starts + 1) % 3]])]
    assert np.ptp(ends[..., 0]) == 0.0  # both are the line in the middle
    assert seam_length(cut) == pytest.approx(np.linalg.norm(ends[1, 0] - ends[0, 0]))
    assert not (seams & ~border_edges(cut)).any()
    only_left = np.array([True, True, False, False])
    assert not seam_edges(cut, only_left).any()


def test_edges_are_numbered_without_gaps_and_faces_in_their_order():
    random = np.random.default_rng(1)
    faces = random.integers(0, 40, (60, 3))
    edges = edge_ids(faces)
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
    same = (ends[:, None] == ends[None]).all(axis=2)
    assert np.array_equal(edges.ravel()[:, None] == edges.ravel()[None], same)
    assert np.array_equal(np.unique(edges), np.arange(edges.max() + 1))
    components = connected_faces(edges)
    # Of the components by growing sets of faces until nothing changes.
    linked = (edges[:, None, :, None] == edges[None, :, None, :]).any(axis=(2, 3))
    reach = np.linalg.matrix_power(linked.astype(float), 60) > 0.0
    assert np.array_equal(components[:, None] == components[None], reach)
    _, firsts = np.unique(components, return_index=True)
    assert np.array_equal(firsts, np.sort(firsts))
