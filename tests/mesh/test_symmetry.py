import numpy as np
import pytest

from texbake.mapping.atlas.cutting.cut import snap_points
from texbake.mesh.shapes import icosphere
from texbake.mesh.symmetry import find_mirror_plane


def shape(bump=0.0, noise=0.0):
    """A body with one mirror plane, x = 0, which a bump on one side takes from it.

    Its faces do not mirror each other.
    """
    mesh = turned(icosphere(4), seed=4)[0]
    x, y, z = positions = mesh.positions.T - [[5.0], [-2.0], [1.0]]
    points = positions.T * [1.0, 1.4, 0.8]
    points[:, 1] += 0.4 * x**2 + 0.3 * z
    points[:, 2] += 0.3 * np.abs(x) * y
    points[:, 0] += bump * np.exp(-8.0 * ((x - 0.7) ** 2 + (y - 0.5) ** 2))
    points += noise * np.random.default_rng(1).standard_normal(points.shape)
    return mesh.replace(positions=points)


def turned(mesh, seed=3):
    turn, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    return mesh.replace(positions=mesh.positions @ turn.T + [5.0, -2.0, 1.0]), turn[:, 0]


@pytest.mark.parametrize(("noise", "tolerance"), [(0.0, 1e-3), (0.005, 0.02)])
def test_the_plane_is_found_however_the_mesh_is_turned(noise, tolerance):
    mesh, normal = turned(shape(noise=noise))
    plane = find_mirror_plane(snap_points(mesh), mesh.faces)
    assert abs(plane.normal @ normal) > 1.0 - tolerance
    assert plane.error < 0.012
    points = np.array([[0.1, 0.2, 0.3], [-0.4, 0.0, 0.1]])
    np.testing.assert_allclose(plane.mirrored(plane.mirrored(points)), points, atol=1e-15)
    np.testing.assert_allclose(plane.heights(plane.mirrored(points)), -plane.heights(points))


def test_a_mesh_without_mirror_plane_has_none():
    mesh = shape(bump=0.9)
    assert find_mirror_plane(snap_points(mesh), mesh.faces) is None


def test_a_plate_is_not_symmetric_because_it_is_thin():
    mesh = icosphere(4)
    x, y, z = mesh.positions.T
    angle = np.arctan2(y, x)
    radius = 1.0 + 0.45 * np.cos(angle) + 0.35 * np.sin(3.0 * angle)
    height = 0.01 * np.where(z > 0.0, z * (2.0 + x), z)
    plate = mesh.replace(positions=np.stack([x * radius, y * radius, height], axis=1))
    assert find_mirror_plane(snap_points(plate), plate.faces) is None
