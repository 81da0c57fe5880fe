import numpy as np
import pytest

from texbake.mapping.atlas.cutting.parts import ChartLimits, Part, disk_charts, step_lengths
from texbake.mapping.corner_uvs import surface_areas
from texbake.mesh.distance import area_vectors
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import _geodesic_sphere, cube, plane
from texbake.mesh.topology import opposite_half_edges


def laid(mesh, most_l2, *, length=np.inf, area=np.inf):
    solid = np.ones(mesh.n_faces, dtype=bool)
    opposite = opposite_half_edges(mesh.faces, solid=solid)
    part = Part(face_ids=np.arange(mesh.n_faces, dtype=np.int32), opposite=opposite)
    lengths = step_lengths(mesh.positions, mesh.faces, opposite)
    total_area = float(surface_areas(mesh.positions[mesh.faces]).sum())
    limits = ChartLimits(
        l2=most_l2, length=length, area=area, flat_area=0.0, total_area=total_area,
        tiny_area=0.007 * min(area, total_area),
    )  # fmt: skip
    normals = area_vectors(mesh.positions, mesh.faces)
    weights = np.ones((mesh.n_faces, 3))
    pieces, left = disk_charts(
        mesh.positions, mesh.faces, normals, lengths, weights, [part], limits=limits
    )
    return [charts for _, charts in pieces], len(left)


def test_a_developable_part_is_one_chart_with_its_own_lengths():
    mesh = plane(16, 16, lambda x, y: np.sqrt(1.0 - (x - 0.5) ** 2))  # on a cylinder
    (charts,), n_left = laid(mesh, 1.001)
    assert (charts.n_charts, n_left) == (1, 0)
    flat, space = (
        np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        for corners in (charts.uvs[charts.faces], mesh.positions[mesh.faces])
    )
    assert np.abs(flat / space - 1.0).max() < 1e-3


def test_a_closed_part_is_divided_until_it_is_flat_enough():
    positions, faces = _geodesic_sphere(16)
    few, many = (laid(Mesh(positions=positions, faces=faces), l2) for l2 in (1.2, 1.01))
    assert few[1] == many[1] == 0 and 2 <= few[0][0].n_charts < many[0][0].n_charts <= 32


def test_noise_does_not_divide_a_chart():
    mesh = plane(40, 40)
    noise = 0.012 * np.random.default_rng(1).standard_normal(mesh.n_vertices)
    rough = mesh.replace(positions=mesh.positions + noise[:, None] * [0.0, 0.0, 1.0])
    (charts,), n_left = laid(rough, 1.001)  # less than its layout in one piece has
    assert charts.n_charts - charts.n_split == 1
    assert n_left == 0


def test_faces_on_one_edge_each_get_a_place():
    book = Mesh(
        positions=[[0, 0, 0], [0, 0, 1], [1, 0, 0.5], [0, 1, 0.5], [-1, 0, 0.5]],
        faces=[[0, 1, 2], [0, 1, 3], [0, 1, 4]],
    )
    (charts,), n_left = laid(book, 1.1)
    assert (charts.n_charts, n_left) == (3, 0)


def tube(n_around, n_along, height):
    """The side of a prism of radius 1."""
    at, along = np.meshgrid(np.arange(n_around), np.arange(n_along + 1), indexing="ij")
    angles = 2.0 * np.pi * at.ravel() / n_around
    rows = np.arange(at.size).reshape(at.shape)
    a, b = rows[:, :-1].ravel(), np.roll(rows, -1, axis=0)[:, :-1].ravel()
    return Mesh(
        positions=np.stack([np.cos(angles), np.sin(angles), height * along.ravel() / n_along], 1),
        faces=np.concatenate([np.stack([a, b, b + 1], axis=1), np.stack([a, b + 1, a + 1], 1)]),
    )


def test_a_tube_is_cut_open_once():
    mesh = tube(24, 6, 2.0)
    (charts,), n_left = laid(mesh, 1.001)
    assert (charts.n_charts, n_left) == (1, 0)
    sides = np.sort(
        np.linalg.norm(charts.uvs[charts.faces[:, 1:]] - charts.uvs[charts.faces[:, :1]], axis=2)
    )
    assert sides == pytest.approx(
        np.sort(
            np.linalg.norm(
                mesh.positions[mesh.faces[:, 1:]] - mesh.positions[mesh.faces[:, :1]], axis=2
            )
        ),
        rel=1e-3,
    )


def test_creases_bound_charts():
    box = Mesh(
        positions=np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], float),
        faces=cube().faces,
    )
    (charts,), _ = laid(box, 1.001, area=8.0, length=4.0)
    assert charts.n_charts == 6


def test_a_long_chart_is_divided():
    strip = plane(64, 1).replace(positions=plane(64, 1).positions * [16.0, 1.0, 1.0])
    (charts,), _ = laid(strip, 1.001, length=6.0, area=99.0)
    assert charts.n_charts == 4
    assert all(np.ptp(charts.uvs[charts.chart_ids == chart], 0).max() < 6.0 for chart in range(4))


def test_a_ring_is_divided():
    n = 64
    angles = 2.0 * np.pi * np.arange(n) / n
    rim = np.stack([np.cos(angles), np.sin(angles), np.zeros(n)], axis=1)
    inner, outer = np.arange(n), n + np.arange(n)
    ahead = np.roll(inner, -1)
    ring = Mesh(
        positions=np.concatenate([rim, 1.05 * rim]),
        faces=np.concatenate(
            [np.stack([inner, outer, outer[ahead]], 1), np.stack([inner, outer[ahead], ahead], 1)]
        ),
    )
    whole, parts = (laid(ring, 1.001, area=area)[0][0] for area in (np.inf, 1.0))
    assert whole.n_charts == 1
    assert 2 < parts.n_charts < 16
