"""Planes, height fields and Möbius strips."""

from __future__ import annotations

import numpy as np
import pytest

from texbake import OptionError, make
from texbake.mesh.normals import face_normals
from texbake.mesh.remeshing.boundary import Loops
from texbake.mesh.topology import euler_characteristic, face_components, find_edges
from texbake.texture.lookup import lookup


@pytest.mark.parametrize("resolution", [1, 3, (7, 2)])
def test_a_plane_is_exact(resolution):
    mesh = make("plane", resolution=resolution, width=3, height=0.5)
    n_u, n_v = resolution if isinstance(resolution, tuple) else (resolution, resolution)
    assert (mesh.n_vertices, mesh.n_faces) == ((n_u + 1) * (n_v + 1), 2 * n_u * n_v)
    assert mesh.bounds.tolist() == [[-1.5, -0.25, 0], [1.5, 0.25, 0]]
    expected = (mesh.uvs - 0.5) * [3, 0.5]
    np.testing.assert_allclose(mesh.positions[:, :2], expected, atol=4e-16)
    np.testing.assert_array_equal(mesh.faces, mesh.uv_faces)
    assert mesh.normals.tolist() == [[0, 0, 1]]
    assert (face_normals(mesh) == [0, 0, 1]).all()
    # Opposite borders lie opposite, bit by bit.
    np.testing.assert_array_equal(
        np.sort(mesh.positions[:, 0]), -np.sort(mesh.positions[:, 0])[::-1]
    )


def test_a_height_field_has_a_vertex_a_pixel():
    image = np.random.default_rng(0).uniform(-1, 2, (5, 7)).astype(np.float32)
    mesh = make("height-field", image=image, width=7, height=0.3)
    assert (mesh.n_vertices, mesh.n_faces) == (35, 2 * 6 * 4)
    for x, y, z in mesh.positions:
        column, row = x + 3, 2 - y  # pixels of side 1 about the origin, row 0 at the top
        assert z == 0.3 * np.float64(image[round(row), round(column)])
    # A lookup at the vertices' coordinates finds their own pixels.
    found = lookup(image[..., None], mesh.uvs)[:, 0]
    heights = np.empty(len(mesh.uvs))
    heights[mesh.uv_faces] = mesh.positions[mesh.faces, 2]
    np.testing.assert_allclose(heights, 0.3 * found, rtol=1e-5)  # float32


def test_another_resolution_is_bilinear():
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    image = 1 + 2 * x + 5 * y + x * y  # bilinear everywhere
    mesh = make("height-field", image=image, width=4, height=1, resolution=(9, 10))
    assert mesh.n_faces == 2 * 9 * 10
    x, y, z = mesh.positions.T
    x, y = x + 1.5, 1 - y
    np.testing.assert_allclose(z, 1 + 2 * x + 5 * y + x * y, rtol=1e-14)
    coarse = make("height-field", image=image, resolution=1)
    assert sorted(coarse.positions[:, 2].tolist()) == [1 / 4, 7 / 4, 11 / 4, 23 / 4]


def test_of_colors_the_mean_counts_and_alpha_does_not():
    gray = np.random.default_rng(1).random((4, 5)).astype(np.float32)
    alpha = np.zeros((4, 5), dtype=np.float32)
    plain = make("height-field", image=gray).positions
    for channels in [gray], [gray, alpha], [gray] * 3, [gray, gray, gray, alpha]:
        image = np.stack(channels, axis=-1)
        np.testing.assert_array_equal(make("height-field", image=image).positions, plain)


def test_it_faces_the_viewer():
    mesh = make("height-field", image=np.random.default_rng(2).random((9, 9)))
    assert face_normals(mesh)[:, 2].min() > 0
    a, b, c = np.moveaxis(mesh.corner_uvs(), 1, 0)
    assert np.linalg.det(np.stack([b - a, c - a], axis=1)).min() > 0


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.zeros((1, 9)), r"the shape \(1, 9\) is not an image of 2 x 2 pixels or more"),
        (np.zeros(4), "is not an image"),
        (np.zeros((2, 2, 0)), "is not an image"),
        ([[0, np.nan], [np.inf, 0]], "some of its pixels are not finite"),
        ("hill.png", "not an array"),
    ],
)
def test_arrays_that_are_no_images(image, message):
    with pytest.raises(OptionError, match=message):
        make("height-field", image=image)


@pytest.mark.parametrize("twists", [-3, -1, 0, 1, 2, 3])
@pytest.mark.parametrize("resolution", [(3, 1), (24, 5)])
def test_topology(twists, resolution):
    mesh = make("mobius", twists=twists, resolution=resolution)
    n_u, n_v = resolution
    edges = find_edges(mesh.faces)
    odd = twists % 2 == 1
    assert (mesh.n_vertices, mesh.n_faces) == (n_u * (n_v + 1), 2 * n_u * n_v)
    assert euler_characteristic(mesh.faces, edges) == 0
    assert len(Loops.of(mesh.positions, mesh.faces).sizes) == (1 if odd else 2)
    assert edges.misoriented.sum() == (n_v if odd else 0)
    assert not edges.non_manifold.any()
    assert face_components(mesh.faces, mesh.n_vertices)[1] == 1


def strip(u, v, twists, radius=1.0, width=0.8):
    angle, turn = 2 * np.pi * (u - 0.5), np.pi * twists * (u - 0.5)
    across = width * (v - 0.5)
    r = radius + across * np.sin(turn)
    return np.stack([r * np.sin(angle), across * np.cos(turn), r * np.cos(angle)], axis=-1)


@pytest.mark.parametrize("twists", [1, 2, -5])
def test_corners_follow_the_closed_form(twists):
    mesh = make("mobius", twists=twists, resolution=(48, 6))
    u, v = mesh.corner_uvs().reshape(-1, 2).T
    points = mesh.positions[mesh.faces].reshape(-1, 3)
    # The cosine of an angle of up to 5 pi / 2, rounded: some 2^-51.
    assert np.abs(points - strip(u, v, twists)).max() < 3e-15
    # Central differences of step h are off by h^2 times third derivatives, of about (2 pi)^3.
    h = 1e-5
    du = strip(u + h, v, twists) - strip(u - h, v, twists)
    dv = strip(u, v + h, twists) - strip(u, v - h, twists)
    expected = np.cross(du, dv)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    normals = mesh.normals[mesh.normal_faces].reshape(-1, 3)
    assert np.abs(normals - expected).max() < 1e-7


def test_faces_look_where_their_normals_do():
    mesh = make("mobius")
    corners = mesh.normals[mesh.normal_faces]
    assert np.einsum("fi,fci->fc", face_normals(mesh), corners).min() > 0.99


@pytest.mark.parametrize("options", [{"width": 2.0}, {"twists": 200}, {"twists": 10**30}])
def test_strips_that_cannot_be(options):
    with pytest.raises(OptionError, match=r"width: 2\.0 is not|twists: .* raise the resolution"):
        make("mobius", **options)
