import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake.mapping.classical.box import side_pictures
from texbake.mapping.classical.frames import LocalPoints
from texbake.mapping.classical.intermediate import (
    Box,
    IntermediateSurface,
    mapped_by_rays,
    surface_around,
)
from texbake.mapping.options import UnwrapOptions

ROUND = ("cylinder", "sphere")


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


@given(st.integers(0, 2**32 - 1), st.sampled_from(("plane", *ROUND)))
@settings(max_examples=60)
def test_rays_meet_the_surface_where_they_leave_it(seed: int, name: str) -> None:
    local, directions, faces = rays(seed)
    surface = around(name, local, faces)
    hits, missed = surface.hits(local.points, directions)
    assert np.array_equal(hits[missed], local.points[missed])
    met, points, along = hits[~missed], local.points[~missed], directions[~missed]
    steps = np.einsum("ij,ij->i", met - points, along)
    # Steps are as long as 9 sizes of the mesh, of about 10, at most; each is right to 1e-14 of it.
    np.testing.assert_allclose(points + steps[:, None] * along, met, atol=1e-11)
    assert (steps >= 0.0).all()
    if name == "plane":
        np.testing.assert_allclose(met[:, 2], local.points[:, 2].max(), atol=1e-11)
    else:
        axes = 2 if name == "cylinder" else 3
        furthest = np.linalg.norm(local.points[:, :axes], axis=1).max()
        np.testing.assert_allclose(np.linalg.norm(met[:, :axes], axis=1), furthest, rtol=1e-9)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_a_sphere_is_always_met_and_a_cylinder_unless_far_away(seed: int) -> None:
    local, directions, faces = rays(seed)
    assert not around("sphere", local, faces).hits(local.points, directions)[1].any()
    x, y, z = local.points.T
    dx, dy, dz = directions.T
    a, b = dx * dx + dy * dy, x * dx + y * dy
    c = x * x + y * y - (x * x + y * y).max()
    height = z + dz * (np.sqrt(b * b - a * c) - b) / a
    reach = 4.0 * (z.max() - z.min())
    far = (height > z.max() + reach) | (height < z.min() - reach)
    missed = around("cylinder", local, faces).hits(local.points, directions)[1]
    assert np.array_equal(missed, far)


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


def test_a_ray_from_the_rim_leaves_the_cylinder_at_the_other_side() -> None:
    points = np.array([[1.0, 0, 0], [-0.5, 0.5, 1], [0, -1, 0.5]])
    cylinder = around("cylinder", LocalPoints(points, 1.0, 1e-15), np.array([[0, 1, 2]]))
    inward = np.array([[-1.0, 0, 0]] * 3)
    assert np.array_equal(cylinder.hits(points, inward)[0][0], [-1.0, 0.0, 0.0])
    assert np.array_equal(cylinder.hits(points, -inward)[0][0], [1.0, 0.0, 0.0])


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


def test_a_face_that_misses_goes_to_the_nearest_points_whole() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 2.0]])
    faces = np.array([[0, 1, 2], [2, 1, 3], [0, 1, 4]])
    plane = around("plane", LocalPoints(points, 1.0, 1e-15), faces)
    directions = np.array([[1.0, 0, 1]] * 5) / math.sqrt(2.0)
    directions[3] = [0.0, 0.0, -1.0]
    mapped = mapped_by_rays(plane, points, directions, faces)
    assert mapped.tallies == {"faces whose rays miss the plane, mapped to its nearest points": 1}
    moved = np.array([2.0, 0.0])
    np.testing.assert_allclose(mapped.corners[0], points[faces[0], :2] + moved, atol=1e-14)
    assert np.array_equal(mapped.corners[1], points[faces[1], :2])


@pytest.mark.parametrize("name", ["plane", *ROUND])
def test_surfaces_around_nothing_are_finite(name: str) -> None:
    axis_only = np.array([[0.0, 0, -1], [0, 0, 0], [0, 0, 1]])
    faces = np.array([[0, 1, 2]])
    for points in (axis_only, np.zeros((3, 3)), axis_only[:, [2, 1, 0]]):
        surface = around(name, LocalPoints(points, 1.0, 1e-16), faces)
        for directions in (np.zeros((3, 3)), np.eye(3), -np.eye(3)):
            mapped = mapped_by_rays(surface, points, directions, faces)
            assert np.isfinite(mapped.corners).all()


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


def test_pictures_of_sides_are_upright_and_apart() -> None:
    # On each side a triangle: the middle, one step to the right as seen from outside, one up.
    rights = np.array([[0, 0, -1], [0, 0, 1], [1, 0, 0], [1, 0, 0], [1, 0, 0], [-1, 0, 0]])
    ups = np.array([[0, 1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1], [0, 1, 0], [0, 1, 0]])
    middles = np.repeat(np.eye(3), 2, axis=0) * np.tile([1.0, -1.0], 3)[:, None]
    points = np.stack([middles, middles + rights, middles + ups], axis=1)
    options = UnwrapOptions(method="box", size=(310, 210), padding=10)
    found = side_pictures(points, np.arange(6), np.ones(3), options) * (310, 210)
    # Cells of 90 x 90 texels and 10 texels around them; +x is the upper left one.
    columns, rows = np.arange(6) // 2, 1 - np.arange(6) % 2
    expected = np.stack([55.0 + 100.0 * columns, 55.0 + 100.0 * rows], axis=1)
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-9)
    np.testing.assert_allclose(found[:, 1], expected + np.array([45.0, 0.0]), atol=1e-9)
    np.testing.assert_allclose(found[:, 2], expected + np.array([0.0, 45.0]), atol=1e-9)
