"""Range images of surfaces that have formulas: vertices lie on them, and holes stay."""

import math

import numpy as np
import pytest

from texbake import OptionError, make
from texbake.errors import MeshError
from texbake.mesh.normals import face_normals


def radii(n_rows: int = 24, n_columns: int = 40) -> np.ndarray:
    """A cone of radius 1 at the bottom and 1/2 at the top, with waves around it."""
    v = 1.0 - (np.arange(n_rows) + 0.5) / n_rows
    angles = 2.0 * math.pi * (np.arange(n_columns) + 0.5) / n_columns
    return (1.0 - 0.5 * v[:, None]) * (1.0 + 0.1 * np.cos(3.0 * angles))


def test_vertices_of_a_cylindrical_range_lie_on_the_surface() -> None:
    mesh = make("cylindrical-range", image=radii(), radius=2.0, height=3.0)
    assert (mesh.n_vertices, mesh.n_faces) == (24 * 40, 2 * 23 * 40)
    x, y, z = mesh.positions.T
    angles = np.arctan2(x, z) + math.pi
    v = y / 3.0 + 0.5
    np.testing.assert_allclose(
        np.hypot(x, z), 2.0 * (1.0 - 0.5 * v) * (1.0 + 0.1 * np.cos(3.0 * angles)), atol=1e-12
    )
    # Outwards, and closed around: each border edge is at the top or at the bottom.
    middles = mesh.positions[mesh.faces].mean(axis=1) * [1.0, 0.0, 1.0]
    assert (np.einsum("ij,ij->i", face_normals(mesh), middles) > 0.0).all()
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 1).sum() == 2 * 40


def test_texture_coordinates_are_centers_of_pixels_and_repeat_across_the_seam() -> None:
    image = radii()
    mesh = make("cylindrical-range", image=image)
    corners = mesh.corner_uvs().reshape(-1, 2)
    column, row = corners[:, 0] * 40 - 0.5, (1.0 - corners[:, 1]) * 24 - 0.5
    np.testing.assert_allclose(column, np.round(column), atol=1e-9)
    at = image[np.round(row).astype(int), np.round(column).astype(int) % 40]
    x, _, z = mesh.positions[mesh.faces.ravel()].T
    np.testing.assert_allclose(np.hypot(x, z), at, atol=1e-12)
    assert np.ptp(mesh.corner_uvs()[..., 0], axis=1).max() < 1.5 / 40


def test_a_depth_image_of_a_ball_lies_on_the_ball() -> None:
    n, fov = 64, 30.0
    reach = math.tan(math.radians(fov / 2.0))
    grid = ((np.arange(n) + 0.5) / n * 2.0 - 1.0) * reach
    x, y = np.meshgrid(grid, -grid)
    # The ray (x, y, -1) t meets the ball of radius 1 about (0, 0, -5).
    a, b, c = x * x + y * y + 1.0, -10.0, 24.0
    inside = b * b - 4.0 * a * c
    depths = np.where(inside > 0.0, (-b - np.sqrt(np.maximum(inside, 0.0))) / (2.0 * a), 0.0)
    mesh = make("depth-image", image=depths / 10.0, distance=10.0, fov=fov)
    away = np.linalg.norm(mesh.positions - [0.0, 0.0, -5.0], axis=1)
    np.testing.assert_allclose(away, 1.0, atol=1e-12)
    assert mesh.n_vertices <= (depths > 0.0).sum()
    toward = -mesh.positions[mesh.faces].mean(axis=1)
    assert (np.einsum("ij,ij->i", face_normals(mesh), toward) > 0.0).all()


def test_holes_stay_and_large_steps_are_not_bridged() -> None:
    image = np.full((8, 10), 0.5)
    image[3, 4] = 0.0
    image[6, 6] = np.nan
    holed = make("depth-image", image=image)
    assert holed.n_vertices == 78
    assert holed.n_faces == 2 * 7 * 9 - 2 * 4  # each square around a hole keeps one
    image = np.full((8, 10), 0.5)
    image[:, 5:] = 0.8
    whole, parted = (make("depth-image", image=image, max_step=step) for step in (None, 0.1))
    assert whole.n_faces - parted.n_faces == 2 * 7
    cylinder = make("cylindrical-range", image=image, max_step=0.1)
    assert cylinder.n_faces == 2 * 7 * 8


@pytest.mark.parametrize("missing", [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_a_square_without_one_corner_keeps_the_triangle_of_the_others(
    missing: tuple[int, int],
) -> None:
    for value, options in (0.0, {}), (0.9, {"max_step": 0.1}):
        image = np.full((2, 2), 0.5)
        image[missing] = value
        mesh = make("depth-image", image=image, **options)
        assert (mesh.n_vertices, mesh.n_faces) == (3, 1)
        assert (face_normals(mesh)[:, 2] > 0.0).all()
        rows, columns = 2 * (1.0 - mesh.uvs[:, 1]) - 0.5, 2 * mesh.uvs[:, 0] - 0.5
        kept = set(zip(np.rint(rows).tolist(), np.rint(columns).tolist(), strict=True))
        assert kept == {(0, 0), (0, 1), (1, 0), (1, 1)} - {missing}


@pytest.mark.parametrize("shape", ["cylindrical-range", "depth-image"])
def test_what_is_no_range_image_is_one_clear_error(shape: str) -> None:
    with pytest.raises(MeshError, match="no three neighboring pixels have a distance"):
        make(shape, image=np.zeros((5, 5)))
    with pytest.raises(OptionError, match="is not an image of 2 x 2 pixels or more"):
        make(shape, image=np.ones(5))
    with pytest.raises(OptionError, match="a vertex for each pixel"):
        make(shape, image=np.ones((5, 5)), resolution=4)
