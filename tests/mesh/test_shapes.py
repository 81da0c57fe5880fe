"""Meshes made by code: closed forms, exact counts, topology."""

import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.mesh.shapes import cube, grid_sphere, icosphere, orange, plane, uv_sphere


def open_edges(mesh):
    """Directed edges without their opposite; also checks that none is used twice."""
    edges = mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    directed = {tuple(edge) for edge in edges.tolist()}
    assert len(directed) == len(edges), "two faces wind the same edge the same way"
    return {edge for edge in directed if edge[::-1] not in directed}


def signed_volume(mesh):
    return np.linalg.det(mesh.positions[mesh.faces]).sum() / 6.0


def areas_in_texture(mesh):
    a, b, c = np.moveaxis(mesh.corner_uvs(), 1, 0)
    return 0.5 * np.linalg.det(np.stack([b - a, c - a], axis=1))


@pytest.mark.parametrize("level", [0, 1, 2, 4])
def test_icosphere_is_closed_and_of_genus_zero(level):
    mesh = icosphere(level)
    assert mesh.n_faces == 20 * 4**level
    assert mesh.n_vertices == 10 * 4**level + 2  # Euler: V - E + F = 2
    assert not open_edges(mesh)
    # Two rounding steps of a normalization.
    assert np.abs(np.linalg.norm(mesh.positions, axis=1) - 1.0).max() < 1e-15 * 4


def test_icosphere_triangles_are_nearly_equal():
    corners = icosphere(5).positions[icosphere(5).faces]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    assert areas.max() / areas.min() < 1.25  # plain normalized subdivision has 2


@pytest.mark.parametrize(("n_lat", "n_lon"), [(2, 3), (5, 7), (17, 16)])
def test_uv_sphere_is_closed_and_covers_texture_space(n_lat, n_lon):
    mesh = uv_sphere(n_lat, n_lon)
    assert mesh.n_faces == 2 * (n_lat - 1) * n_lon
    assert mesh.n_vertices == (n_lat - 1) * n_lon + 2
    assert not open_edges(mesh) and signed_volume(mesh) > 0.0
    areas = areas_in_texture(mesh)
    assert areas.min() > 0.0
    # Of the first and last band of latitudes a triangle fan covers half.
    assert areas.sum() == pytest.approx(1.0 - 1.0 / n_lat, rel=1e-12)


def test_uv_sphere_texture_coordinates_are_longitude_and_latitude():
    mesh = uv_sphere(8, 12)
    z = mesh.positions[mesh.faces][..., 2]
    v = mesh.corner_uvs()[..., 1]
    assert np.abs(z - np.cos(np.pi * (1.0 - v))).max() < 1e-15 * 4
    x, y = np.moveaxis(mesh.positions[mesh.faces][..., :2], -1, 0)
    u = mesh.corner_uvs()[..., 0]
    off_axis = np.hypot(x, y) > 0.0
    turn = np.exp(2j * np.pi * u[off_axis])
    assert np.abs((x + 1j * y)[off_axis] / np.hypot(x, y)[off_axis] - turn).max() < 1e-14


def test_grid_sphere_follows_its_closed_form():
    def radius_at(theta, phi):
        return 1.0 + 0.02 * np.sin(40.0 * theta) * np.sin(40.0 * phi)

    mesh = grid_sphere(50, 60, radius_at, pole_margin=0.01)
    row, column = 17, 42
    theta = 0.01 + (np.pi - 0.02) * row / 49
    phi = 2.0 * np.pi * column / 60
    r = radius_at(theta, phi)
    expected = r * np.array(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
    )
    assert mesh.positions[row * 60 + column] == pytest.approx(expected, abs=1e-14)
    assert mesh.n_faces == 2 * 49 * 60
    assert len(open_edges(mesh)) == 2 * 60  # a ring at either pole
    assert signed_volume(mesh) > 0.0


def test_plane_is_exact():
    mesh = plane(4, 2, lambda x, y: 2.0 * x + y)
    assert (mesh.n_faces, mesh.positions[2 * 5 + 3].tolist()) == (16, [0.75, 1.0, 2.5])
    assert np.array_equal(mesh.uvs, mesh.positions[:, :2])
    assert np.array_equal(mesh.uv_faces, mesh.faces)
    assert areas_in_texture(mesh) == pytest.approx(np.full(16, 1.0 / 16.0), abs=1e-16)
    assert len(open_edges(mesh)) == 2 * (4 + 2)


def test_cube():
    assert not open_edges(cube())
    assert signed_volume(cube()) == 1.0


def test_orange_is_the_same_surface_at_any_count():
    # Frequencies 16 and 32: the coarse orange's directions are among the fine one's.
    coarse, fine = orange(20 * 16**2), orange(20 * 32**2)

    def by_direction(mesh):
        radii = np.linalg.norm(mesh.positions, axis=1)
        keys = np.round(mesh.positions / radii[:, None], 9) + 0.0
        return dict(zip(map(tuple, keys.tolist()), radii.tolist(), strict=True))

    coarse_radii, fine_radii = by_direction(coarse), by_direction(fine)
    assert coarse_radii.keys() <= fine_radii.keys()
    # 1e-12: rounding of a direction, times the steepest slope of the peel (about 2).
    assert max(abs(fine_radii[key] - r) for key, r in coarse_radii.items()) < 1e-12


def test_orange_has_pores_of_every_depth_and_no_jump():
    from texbake.mesh.shapes import peel_radii

    # Around a circle at a step of a hundredth of the smallest pore.
    angle = np.linspace(0.0, 2.0 * np.pi, 60_000)
    circle = np.stack([np.cos(angle), 0.3 * np.ones_like(angle), np.sin(angle)], axis=1)
    radii = peel_radii(circle / np.linalg.norm(circle, axis=1, keepdims=True))
    steps = np.diff(radii)
    # The steepest pore falls 0.0065 over 0.4 of its radius 0.024.
    assert np.abs(steps).max() < 1.0 * (angle[1] - angle[0])
    n_dips = ((steps[:-1] < 0.0) & (steps[1:] > 0.0)).sum()
    assert n_dips > 100
    assert radii[0] == pytest.approx(radii[-1], abs=1e-12)


@pytest.mark.parametrize(("make", "message"), [
    (lambda: icosphere(-1), "must be at least 0"),
    (lambda: orange(19), "must be at least 20"),
    (lambda: icosphere(30), "must be at most 9"),
    (lambda: orange(10**11), "must be at most 20,000,000"),
])  # fmt: skip
def test_counts_out_of_range_are_errors(make, message):
    with pytest.raises(OptionError, match=message):
        make()
