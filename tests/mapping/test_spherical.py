"""Spherical mapping against closed forms; poles, the seam and the center."""

import math

import numpy as np
import pytest

from texbake.mapping.classical.cylindrical import spherical
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import icosphere, uv_sphere


def mapped(mesh, **choices):
    return spherical(mesh, UnwrapOptions(method="spherical", **choices))


def scattered(seed):
    """Small triangles about random points, so that none is around the axis by much chance."""
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(300, 1, 3)) + 0.02 * rng.normal(size=(300, 3, 3))
    return Mesh(positions=corners.reshape(-1, 3), faces=np.arange(900).reshape(-1, 3))


def check_closed_form(corners, x, y, height):
    """Longitude modulo a whole turn, and latitude as the angle whose sine and cosine it has."""
    turns = corners[..., 0] - 0.5 - np.arctan2(y, x) / (2.0 * math.pi)
    assert np.abs(turns - np.round(turns)).max() < 1e-9
    latitude = (corners[..., 1] - 0.5) * math.pi
    distance = np.sqrt(x * x + y * y + height * height)
    assert np.abs(np.sin(latitude) * distance - height).max() < 1e-9
    assert np.abs(np.cos(latitude) * distance - np.hypot(x, y)).max() < 1e-9


@pytest.mark.parametrize("seed", range(8))
def test_any_axis_gives_latitude_and_longitude_about_it(seed):
    rng = np.random.default_rng(seed)
    mesh, axis = scattered(seed), rng.normal(size=3)
    corners = mapped(mesh, axis=tuple(axis.tolist()), center=(0.1, 0.2, 0.3)).corners
    axis /= np.linalg.norm(axis)
    points = mesh.positions[mesh.faces] - (0.1, 0.2, 0.3)
    height = points @ axis
    across = points - height[..., None] * axis
    # Without a frame: angles between two points about the axis are what their longitudes differ by.
    first = across[0, 0]
    x, y = across @ first, np.cross(first, across) @ axis
    scale = np.linalg.norm(first)
    turned = corners - (corners[0, 0, 0] - 0.5, 0.0)
    check_closed_form(turned, x / scale, y / scale, height)


def test_a_sphere_has_its_own_longitude_and_latitude():
    n_lat, n_lon = 8, 16
    mesh = uv_sphere(n_lat, n_lon)
    found = mapped(mesh, axis="z")
    assert found.tallies == {"faces touching a pole": 2 * n_lon}
    s, t = found.corners[..., 0], found.corners[..., 1]
    # Every coordinate is a step of the grid; longitudes at the poles lie halfway.
    assert np.abs(t * n_lat - np.round(t * n_lat)).max() < 1e-12
    off_pole = (t > 0.01) & (t < 0.99)
    assert np.abs(s * n_lon - np.round(s * n_lon))[off_pole].max() < 1e-12
    assert np.abs(s * n_lon % 1.0 - 0.5)[~off_pole].max() < 1e-12
    assert set(t[~off_pole]) == {0.0, 1.0}
    assert np.ptp(s, axis=1).max() == pytest.approx(1.0 / n_lon, abs=1e-12)


def test_faces_around_a_pole_are_counted_and_the_others_span_less_than_half():
    mesh = icosphere(3)
    # An axis through the inside of two faces, which no vertex comes near to.
    corners = mesh.positions[mesh.faces[17]]
    found = mapped(mesh, axis=tuple((corners * [[3], [2], [1]]).sum(axis=0).tolist()))
    assert found.tallies == {"faces around a pole": 2}
    spans = np.ptp(found.corners[..., 0], axis=1)
    assert (spans >= 0.5).sum() == 2
    assert spans[17] > 0.5


def test_theta_is_the_arc_that_fills_s():
    mesh = Mesh(positions=[[0, 0, 1], [1, 0, 1], [1, 1, 1]], faces=[[0, 1, 2]])
    s = mapped(mesh, theta=(0.0, 90.0), center=(0, 0, 0)).corners[0, :, 0]
    assert s == pytest.approx([0.0, 0.5, 0.5], abs=1e-12)  # about y, the front is +z


@pytest.mark.parametrize("distance", [0.5, 3.0])
def test_the_center_may_lie_inside_or_outside(distance):
    mesh = icosphere(2)
    found = mapped(mesh, center=(distance, 0.0, 0.1))
    assert np.isfinite(found.corners).all()
    covered = np.ptp(found.corners[..., 1])
    # From outside, a sphere covers the cone of half angle asin(1 / distance) about its middle.
    limit = 1.0 if distance < 1 else 2.0 * math.asin(1.0 / math.hypot(distance, 0.1)) / math.pi
    assert covered <= limit + 1e-9
    assert covered > 0.9 * limit


@pytest.mark.parametrize("height", [1.0, -1.0, 1e-9, -1e-9])
def test_points_near_a_pole_keep_their_latitude(height):
    # The arc cosine of height / distance would have lost all of it.
    tiny = 1e-9 * abs(height)
    mesh = Mesh(
        positions=[[tiny, height, 0], [0, height, tiny], [-tiny, height, 0]], faces=[[0, 1, 2]]
    )
    from_pole = 0.5 - np.abs(mapped(mesh, center=(0, 0, 0)).corners[0, :, 1] - 0.5)
    assert from_pole * math.pi == pytest.approx([1e-9] * 3, rel=1e-6)
