import math

import numpy as np
from hypothesis import given, settings, strategies as st

from texbake.mapping.classical.box import side_pictures
from texbake.mapping.classical.frames import LocalPoints
from texbake.mapping.classical.intermediate import (
    Box,
    IntermediateSurface,
    surface_around,
)
from texbake.mapping.options import UnwrapOptions


def options_of(surface: str, **options: object) -> UnwrapOptions:
    return UnwrapOptions(method="two-part", surface=surface, **options)


def rays(seed: int, n: int = 300) -> tuple[LocalPoints, np.ndarray, np.ndarray]:
    """Points with directions of unit length, and faces that use each once."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n, 3)) * rng.uniform(0.2, 2.0, 3) + rng.normal(size=3)
    directions = rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    faces = np.arange(n, dtype=np.int32).reshape(-1, 3)
    return LocalPoints(points, 1.0, 1e-15), directions, faces


def around(
    surface: str, local: LocalPoints, faces: np.ndarray, **options: object
) -> IntermediateSurface:
    return surface_around(local, faces, options_of(surface, **options))


def test_rays_that_miss_a_plane() -> None:
    # Corners of the unit square at height 0, and one point at height 1: the plane is z = 1.
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 1, 2], [1, 2, 3], [0, 1, 4]])
    plane = around("plane", LocalPoints(points, 1.0, 1e-15), faces)
    directions = np.array(
        [
            [0.0, 0, 1],  # straight
            [1, 0, 0],  # along the plane
            [0, 0, -1],  # away from it
            [3.9, 0, 1],  # to x = 4.9, less than four sides beyond the mesh
            [0, -4.1, 1],  # far beyond the mesh, had it any way to go: it starts on the plane
        ]
    )
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    hits, missed = plane.hits(points, directions)
    assert missed.tolist() == [False, True, True, False, False]
    np.testing.assert_allclose(hits[0], [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(hits[3], [4.9, 1, 1], atol=1e-14)
    far = np.array([[4.1, 0.0, 1.0]] * 5) / math.hypot(4.1, 1.0)
    assert plane.hits(points, far)[1].tolist() == [False, True, False, True, False]


def test_rays_that_miss_a_cylinder() -> None:
    points = np.array([[1.0, 0, -1], [0, 1, 1], [0, 0, 0], [0, 0, 0.5]])
    faces = np.array([[0, 1, 2], [1, 2, 3]])
    cylinder = around("cylinder", LocalPoints(points, 1.0, 1e-15), faces)
    directions = np.array([[0.0, 0, 1], [0, 0, 0], [1, 0, 8.9], [1, 0, 9.1]])
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    hits, missed = cylinder.hits(points, directions / np.where(lengths, lengths, 1.0))
    # Height 2 and a reach of four times that: up to z = 9.
    assert missed.tolist() == [True, True, False, True]
    np.testing.assert_allclose(hits[2], [1.0, 0.0, 8.9], rtol=1e-14)


def test_rays_to_a_pole_end_on_it() -> None:
    points = np.array([[0.3, 0.4, 0.1], [1.0, 0.0, 0.0], [0.0, 0.9, 0.0]])
    sphere = around("sphere", LocalPoints(points, 1.0, 1e-16), np.array([[0, 1, 2]]))
    to_pole = np.array([0.0, 0.0, 1.0]) - points
    to_pole /= np.linalg.norm(to_pole, axis=1, keepdims=True)
    hits, missed = sphere.hits(points, to_pole)
    assert not missed.any()
    assert (hits[:, :2] == 0.0).all()
    mapped = sphere.coordinates(hits, np.array([[0, 1, 2]]))
    assert mapped.tallies == {"faces touching a pole": 1, "faces along the axis": 1}
    assert (mapped.corners[..., 1] == 1.0).all()


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_rays_leave_a_box_through_the_first_of_its_planes(seed: int) -> None:
    local, directions, _ = rays(seed)
    faces = np.repeat(np.arange(len(local.points), dtype=np.int32)[:, None], 3, axis=1)
    options = options_of("box")
    mapped = Box.around(local, faces, options).mapped_by_rays(local.points, directions, faces)
    assert mapped.tallies == {}
    upright, along = local.points[:, [1, 2, 0]], directions[:, [1, 2, 0]]
    half = np.abs(upright).max(axis=0)
    steps = np.stack([sign * half - upright for sign in (1.0, -1.0)], axis=2) / along[:, :, None]
    # Of the six planes, three lie behind; those that lie ahead are met in their order.
    forward = np.where(np.stack([along, -along], axis=2) > 0.0, steps, np.inf).reshape(-1, 6)
    sides = forward.argmin(axis=1)
    met = upright + forward.min(axis=1)[:, None] * along
    expected = side_pictures(np.repeat(met[:, None], 3, axis=1), sides, half, options)
    np.testing.assert_allclose(mapped.corners, expected, atol=1e-12)


def test_a_face_across_an_edge_of_the_box_stays_in_one_cell() -> None:
    points = np.array([[1.0, 0.3, 0], [0.3, 1.0, 0], [0.9, 0.2, 0.1], [-1, -1, -1], [1, 1, 1]])
    faces = np.array([[0, 1, 2], [3, 4, 3]])
    local = LocalPoints(points, 1.0, 1e-16)
    directions = points / np.linalg.norm(points, axis=1, keepdims=True)
    box = Box.around(local, faces, options_of("box"))
    mapped = box.mapped_by_rays(points, directions, faces[:1])
    assert mapped.tallies == {"faces across an edge of the box": 1}
    # Angle 0 is the front: e1 is +z of the pictures. The second corner's ray would meet the plane
    # e1 = 1 at e2 = 1 / 0.3, beyond the edge, so it lies on the edge at e2 = 1.
    upright = np.array([[0.3, 0.0, 1.0], [1.0, 0.0, 1.0], [0.2 / 0.9, 0.1 / 0.9, 1.0]])
    expected = side_pictures(upright[None], np.array([4]), np.ones(3), options_of("box"))
    np.testing.assert_allclose(mapped.corners, expected, atol=1e-14)
