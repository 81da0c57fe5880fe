"""The plane and height fields: exact coordinates."""

import numpy as np
import pytest

from texbake import OptionError, make
from texbake.mesh.normals import face_normals
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
        (np.zeros((1, 1)), "1 x 1 pixels"),
        (np.zeros((1, 9)), "9 x 1 pixels"),
        (np.zeros(4), "no image"),
        (np.zeros((0, 0)), "0 x 0 pixels"),
        (
            [[0, np.nan], [np.inf, 0]],
            "2 of its pixels are not finite, the first in row 0, column 1",
        ),
        ("hill.png", "not an array"),
    ],
)
def test_arrays_that_are_no_images(image, message):
    with pytest.raises(OptionError, match=message):
        make("height-field", image=image)
