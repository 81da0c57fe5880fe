from __future__ import annotations

import numpy as np

from texbake.mapping.projected import joined_corners, with_coordinates
from texbake.mesh.shapes import cube, icosphere, plane


def test_corners_come_back_bit_for_bit() -> None:
    corners = np.random.default_rng(1).integers(0, 3, (500, 3, 2)) / 3.0
    faces = np.random.default_rng(2).integers(0, 50, (500, 3)).astype(np.int32)
    uvs, uv_faces = joined_corners(faces, corners)
    assert np.array_equal(uvs[uv_faces], corners)
    keys = {
        (v, *uv) for v, uv in zip(faces.ravel(), map(tuple, corners.reshape(-1, 2)), strict=True)
    }
    assert len(uvs) == len(keys)


def test_coordinates_come_in_the_order_of_their_first_use() -> None:
    _, uv_faces = joined_corners(cube().faces, np.arange(72.0).reshape(12, 3, 2))
    assert np.array_equal(uv_faces.ravel(), np.arange(36))


def test_equal_places_of_different_vertices_stay_apart() -> None:
    # Welding them would join charts that merely touch.
    uvs, _ = joined_corners(np.array([[0, 1, 2], [3, 4, 5]], np.int32), np.zeros((2, 3, 2)))
    assert len(uvs) == 6


def test_minus_zero_is_zero() -> None:
    corners = np.array(
        [[[0.0, -0.0], [0.0, 1.0], [1.0, 0.0]], [[-0.0, 0.0], [0.0, 1.0], [1.0, -0.0]]]
    )
    uvs, _ = joined_corners(np.array([[0, 1, 2], [0, 1, 2]], np.int32), corners)
    assert len(uvs) == 3
    assert not np.signbit(uvs).any()


def test_everything_else_is_shared() -> None:
    mesh = icosphere(1)
    mapped = with_coordinates(mesh, np.zeros((mesh.n_faces, 3, 2)))
    assert np.shares_memory(mapped.positions, mesh.positions)
    assert np.shares_memory(mapped.faces, mesh.faces)
    assert plane(1, 1).uvs is not None
