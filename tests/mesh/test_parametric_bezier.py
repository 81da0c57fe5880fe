"""Bicubic patches: exact evaluation, borders that meet bit by bit, borders that are points."""

from fractions import Fraction
from math import comb

import numpy as np
import pytest

from texbake import OptionError, make
from texbake.errors import MeshError
from texbake.mesh.normals import face_normals
from texbake.mesh.topology import find_edges, genus

KAPPA = 4 / 3 * (np.sqrt(2) - 1)  # of a cubic near a quarter circle


def bent(seed=0):
    """A patch near the unit square, somewhat bent."""
    row, column = np.indices((4, 4)) / 3
    flat = np.stack([column, row, np.zeros((4, 4))], axis=-1)
    return flat + np.random.default_rng(seed).uniform(-0.1, 0.1, (4, 4, 3))


def bernstein(patch, u, v):
    """Point of a patch in rational numbers, rounded once."""
    total = [Fraction(0)] * 3
    for row in range(4):
        for column in range(4):
            weight = comb(3, row) * v**row * (1 - v) ** (3 - row)
            weight *= comb(3, column) * u**column * (1 - u) ** (3 - column)
            total = [
                t + weight * Fraction(float(x))
                for t, x in zip(total, patch[row, column], strict=True)
            ]
    return [float(t) for t in total]


def quarters(profile):
    """Patches of a surface about z whose quarter circles are cubics; profile: (segments, 4, 2)."""
    arc = np.array([[1, 0], [1, KAPPA], [KAPPA, 1], [0, 1]])
    patches = []
    for segment in np.asarray(profile, dtype=float):
        for turn in ([[1, 0], [0, 1]], [[0, -1], [1, 0]], [[-1, 0], [0, -1]], [[0, 1], [-1, 0]]):
            circle = arc @ np.array(turn, dtype=float).T
            xy = segment[:, :1, None] * circle
            z = np.broadcast_to(segment[:, 1:, None], (4, 4, 1))
            patches.append(np.concatenate([xy, z], axis=2))
    return np.array(patches) + 0.0


# From the lower tip around the outside to the upper tip, both where borders are points.
DROP = quarters(
    [[(0, 0), (0.7, 0), (1, 0.2), (1, 0.7)], [(1, 0.7), (1, 1.2), (0.6, 1.5), (0, 1.5)]]
)


def with_uvs():
    """The bent patch, with texture coordinates at its control points."""
    uvs = np.random.default_rng(3).uniform(-1.0, 2.0, (4, 4, 2))
    return np.concatenate([bent(), uvs], axis=-1)


def test_coordinates_of_control_points_are_interpolated_as_the_points_are():
    patch = with_uvs()
    mesh = make("bezier", patches=[patch], resolution=(5, 7))
    plain = make("bezier", patches=[patch[..., :3]], resolution=(5, 7))
    np.testing.assert_array_equal(mesh.positions, plain.positions)
    np.testing.assert_array_equal(mesh.normals, plain.normals)
    np.testing.assert_array_equal(mesh.faces, plain.faces)
    at, found = plain.corner_uvs().reshape(-1, 2), mesh.corner_uvs().reshape(-1, 2)
    for (u, v), uv in zip(at, found, strict=True):
        exact = Fraction(round(u * 10), 10), Fraction(round(v * 14), 14)
        expected = bernstein(patch[..., [3, 4, 4]], *exact)[:2]
        np.testing.assert_allclose(uv, expected, atol=1e-14)


def test_points_are_those_of_rational_numbers():
    patch = bent()
    mesh = make("bezier", patches=[patch], resolution=(5, 7))
    assert (mesh.n_vertices, mesh.n_faces) == (6 * 8, 2 * 5 * 7)
    expected = [
        bernstein(patch, Fraction(i, 5), Fraction(j, 7)) for j in range(8) for i in range(6)
    ]
    # Two sums of four terms up to 1, with weights rounded once: some 2^-51.
    assert np.abs(mesh.positions - expected).max() < 5e-16
    uvs = [[i / 5, j / 7] for j in range(8) for i in range(6)]
    np.testing.assert_allclose(mesh.uvs, uvs, rtol=0, atol=2.0**-53)


@pytest.mark.parametrize("side", range(8))
@pytest.mark.parametrize("resolution", [1, 3, 8, 11])
def test_patches_that_share_a_border_share_its_points_bit_by_bit(side, resolution):
    # The neighbor has the first patch's last column as any of its borders, either way round.
    first, second = bent(1), bent(2)
    second[:, 0] = first[:, 3]
    second = np.rot90(second, side % 4)
    second = np.swapaxes(second, 0, 1) if side > 3 else second
    mesh = make("bezier", patches=[first, second], resolution=resolution)
    assert mesh.n_vertices == 2 * (resolution + 1) ** 2 - (resolution + 1)
    edges = find_edges(mesh.faces)
    assert (edges.n_faces == 2).sum() == len(edges.n_faces) - 6 * resolution
    assert edges.misoriented.sum() == (resolution if side > 3 else 0)


@pytest.mark.parametrize("resolution", [1, 2, 5, (6, 9)])
@pytest.mark.parametrize("transposed", [False, True])
def test_borders_that_are_points_close_the_surface(resolution, transposed):
    patches = np.swapaxes(DROP, 1, 2)[:, ::-1] if transposed else DROP
    if transposed and isinstance(resolution, tuple):
        resolution = resolution[::-1]
    mesh = make("bezier", patches=patches, resolution=resolution)
    edges = find_edges(mesh.faces)
    assert edges.closed and not edges.misoriented.any()
    assert genus(mesh.faces, edges, mesh.n_vertices) == 0
    assert (face_normals(mesh) != 0).any(axis=1).all()
    n_around, n_up = resolution if isinstance(resolution, tuple) else (resolution, resolution)
    if transposed and n_around != n_up:
        n_around, n_up = n_up, n_around
    assert mesh.n_faces == 2 * 4 * n_around * (2 * n_up - 1)


@pytest.mark.parametrize("transposed", [False, True])
def test_normals_at_such_points_are_the_limit(transposed):
    patches = np.swapaxes(DROP, 1, 2)[:, ::-1] if transposed else DROP
    mesh = make("bezier", patches=patches, resolution=12)
    normals, points = mesh.normals[mesh.normal_faces], mesh.positions[mesh.faces]
    for tip, z in ([0, 0, 0], -1.0), ([0, 0, 1.5], 1.0):
        at = (points == tip).all(axis=2)
        assert at.sum() == 4 * 12
        np.testing.assert_allclose(normals[at], [[0, 0, z]] * 48, atol=1e-15)
    # A face's own normal is off by about half its bend: quarters in 12 steps.
    assert np.einsum("fi,fci->fc", face_normals(mesh), normals).min() > 0.98
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-15)


def test_a_point_that_repeats_stays_where_it_is():
    # Weights of thirds do not sum up to 1 in floating point.
    patches = DROP + np.array([0.1, 3.15, 0.7])
    mesh = make("bezier", patches=patches, resolution=3)
    assert find_edges(mesh.faces).closed


def test_normals_are_those_of_differences():
    patch = bent(5)
    mesh = make("bezier", patches=[patch], resolution=6)
    h = Fraction(1, 10**6)
    for number in 8, 17, 30:
        u, v = (Fraction(round(6 * x), 6) for x in mesh.uvs[number])
        du = np.subtract(bernstein(patch, u + h, v), bernstein(patch, u - h, v))
        dv = np.subtract(bernstein(patch, u, v + h), bernstein(patch, u, v - h))
        expected = np.cross(du, dv) / np.linalg.norm(np.cross(du, dv))
        corner = np.flatnonzero(mesh.uv_faces.ravel() == number)[0]
        # Differences of numbers near 1 over 2e-6 leave 1e-10.
        found = mesh.normals[mesh.normal_faces.ravel()[corner]]
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_each_patch_has_a_tile_and_a_group():
    row = [bent() + np.array([k, 0, 0]) for k in range(12)]
    mesh = make("bezier", patches=row, resolution=2)
    assert mesh.group_names[11] == "patch 12"
    for k in range(12):
        corners = mesh.corner_uvs()[mesh.face_groups == k]
        assert corners.reshape(-1, 2).min(axis=0).tolist() == [k % 10, k // 10]
        assert corners.reshape(-1, 2).max(axis=0).tolist() == [k % 10 + 1, k // 10 + 1]


def test_a_fold_without_limit_has_the_smooth_normal():
    patch = np.zeros((4, 4, 3))
    patch[..., 0], patch[..., 1] = np.meshgrid([0, 0, 0, 1], [0, 0, 0, 1])  # no first derivatives
    mesh = make("bezier", patches=[patch], resolution=3)
    np.testing.assert_allclose(mesh.normals, [[0, 0, 1]] * len(mesh.normals), atol=1e-15)


def test_patches_without_area():
    with pytest.raises(MeshError, match="no faces"):
        make("bezier", patches=np.ones((2, 4, 4, 3)))


@pytest.mark.parametrize(
    "patches", [[], np.ones((4, 4, 3)), "", [["a"]], np.full((1, 4, 4, 3), np.nan)]
)
def test_arrays_that_are_no_patches(patches):
    with pytest.raises((OptionError, OSError)):
        make("bezier", patches=patches)
