"""Cylindrical and spherical mapping: closed forms, heights, arcs, caps, poles and the axis."""

import math

import numpy as np
import pytest

from texbake import Mesh, UnwrapOptions
from texbake.mapping.classical.cylindrical import center_about_axis, cylindrical, spherical
from texbake.mapping.classical.frames import center_of, frame_about
from texbake.mapping.corner_uvs import signed_areas, surface_areas
from texbake.mesh.normals import face_normals
from texbake.mesh.shapes import icosphere, plane

FRONTS = {"x": (1, 2, 0), "y": (2, 0, 1), "z": (0, 1, 2)}  # coordinates along e1, e2 and the axis


def mapped(mesh, **choices):
    return cylindrical(mesh, UnwrapOptions(method="cylindrical", **choices))


def prism(n_sides, radius=1.0, height=2.0):
    """Closed prism about y, from 0 to its height, with a corner at angle 0."""
    angles = 2.0 * np.pi * np.arange(n_sides) / n_sides
    ring = np.stack([np.sin(angles), 0.0 * angles, np.cos(angles)], axis=1) * radius
    up = np.array([0.0, height, 0.0])
    positions = np.concatenate([ring, ring + up, [0.0 * up, up]])
    low = np.arange(n_sides)
    high, next_low = low + n_sides, (low + 1) % n_sides
    next_high = next_low + n_sides
    bottom, top = np.full(n_sides, 2 * n_sides), np.full(n_sides, 2 * n_sides + 1)
    columns = [
        (low, next_low, next_high),
        (low, next_high, high),
        (bottom, next_low, low),
        (top, high, next_high),
    ]
    faces = np.concatenate([np.stack(column, axis=1) for column in columns])
    return Mesh(positions=positions, faces=faces)


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("seed", range(4))
def test_points_about_a_center_are_the_closed_form(axis, seed):
    rng = np.random.default_rng(seed)
    mesh = scattered(seed)
    center = tuple(rng.normal(size=3).tolist())
    theta, height = (-30.0, 200.0), (0.25, -1.5)
    found = mapped(mesh, axis=axis, center=center, theta=theta, height=height)
    x, y, z = ((mesh.positions - center)[mesh.faces][..., i] for i in FRONTS[axis])
    assert np.abs(found.corners[..., 1] - (z - 0.25) / (-1.5 - 0.25)).max() < 1e-9
    angles = np.degrees(np.arctan2(y, x))
    s = (angles + 30.0) / 230.0
    turns = (found.corners[..., 0] - s) * 230.0 / 360.0
    assert np.abs(turns - np.round(turns)).max() < 1e-9
    spans = np.ptp(found.corners[..., 0], axis=1) * 230.0 / 360.0
    assert (spans > 0.5).sum() <= found.tallies.get("faces around the axis", 0)


@pytest.mark.parametrize("seed", range(4))
def test_heights_go_from_the_lowest_to_the_highest_corner(seed):
    axis = np.random.default_rng(seed).normal(size=3)
    mesh = icosphere(2)
    t = mapped(mesh, axis=tuple(axis.tolist()), center=(5, 6, 7)).corners[..., 1]
    heights = mesh.positions @ axis / np.linalg.norm(axis)
    expected = (heights - heights.min()) / np.ptp(heights)
    assert np.abs(t - expected[mesh.faces]).max() < 1e-12
    assert (t.min(), t.max()) == (0.0, 1.0)


def test_heights_and_angles_are_measured_from_the_center():
    mesh = Mesh(positions=[[1, 5, 1], [3, 7, 1], [1, 9, 4]], faces=[[0, 1, 2]])
    found = mapped(mesh, center=(1, 6, 1), height=(-1, 3), theta=(0, 360))
    # A corner on the axis takes its face's own angle: that of (2, 3) in (e1, e2) = (z, x) / 3.
    own = math.degrees(math.atan2(2, 3)) / 360.0
    assert found.corners[0] == pytest.approx(
        np.array([[own, 0.0], [0.25, 0.5], [0.0, 1.0]]), abs=1e-12
    )
    assert found.tallies == {"faces touching the axis": 1}


@pytest.mark.parametrize("height", [0.5, 2.0, 40.0])
@pytest.mark.parametrize("theta", [(-180.0, 180.0), (0.0, 90.0)])
def test_side_and_caps_have_one_density_and_none_is_mirrored(theta, height):
    n_sides, radius = 64, 1.5
    mesh = prism(n_sides, radius, height)
    found = mapped(mesh, caps=True, theta=theta)
    assert found.tallies == {"caps above": n_sides, "caps below": n_sides}
    areas = signed_areas(found.corners)
    assert (areas > 0.0).all()
    ratios = areas / surface_areas(mesh.positions[mesh.faces])
    side, caps = ratios[: 2 * n_sides], ratios[2 * n_sides :]
    assert np.abs(caps / caps[0] - 1.0).max() < 1e-9
    # Along the side, arcs are laid out and not chords; that is all the difference.
    half = math.pi / n_sides
    assert side / caps[0] == pytest.approx(np.full(2 * n_sides, half / math.sin(half)), rel=1e-9)


@pytest.mark.parametrize(("height", "end"), [(0.5, 0.25 / math.pi), (2.0, 1.0 / math.pi)])
def test_with_caps_t_of_the_side_is_height_over_the_length_of_the_arc(height, end):
    side = mapped(prism(64, 1.0, height), caps=True).corners[:128]
    assert [side[..., 1].min(), side[..., 1].max()] == pytest.approx([0.0, end], abs=1e-12)
    without = mapped(prism(64, 1.0, height)).corners[:128]
    assert [without[..., 1].min(), without[..., 1].max()] == [0.0, 1.0]
    np.testing.assert_array_equal(side[..., 0], without[..., 0])


def test_caps_lie_above_the_side_apart_and_within_the_square():
    n_sides = 32
    for height in 0.5, 2.0, 40.0:
        found = mapped(prism(n_sides, 1.0, height), caps=True).corners
        side, below, above = np.split(found, [2 * n_sides, 3 * n_sides])
        assert min(above[..., 1].min(), below[..., 1].min()) > side[..., 1].max()
        assert below[..., 0].min() > above[..., 0].max()
        assert found.min() >= -1e-12 and found.max() <= 1.0 + 1e-12
        # Disks: as far from their middles as the radius in the texture.
        scale = np.ptp(side[..., 1]) / height
        for cap in above, below:
            middle = (cap.min(axis=(0, 1)) + cap.max(axis=(0, 1))) / 2.0
            rims = np.linalg.norm(cap - middle, axis=2)
            assert np.sort(np.unique(np.round(rims / scale, 9))) == pytest.approx(
                [0.0, 1.0], abs=1e-9
            )


def test_caps_are_folded_out_from_the_front():
    mesh = prism(4)  # corners at +z (the front), +x, -z, -x
    corners = mapped(mesh, caps=True).corners
    places = {}
    for name, faces in (("above", slice(12, 16)), ("below", slice(8, 12))):
        vertices, shown = mesh.faces[faces].ravel(), corners[faces].reshape(-1, 2)
        places[name] = {v % 4: p for v, p in zip(vertices, shown, strict=True) if v < 8}
    front, right, back, left = range(4)
    above, below = places["above"], places["below"]
    assert above[front][1] < above[right][1] < above[back][1]
    assert below[front][1] > below[right][1] > below[back][1]
    assert above[left][0] < above[right][0]
    assert below[left][0] < below[right][0]


def test_faces_within_45_degrees_of_the_axis_are_a_cap():
    mesh = icosphere(3)
    axis = np.array([0.3, 1.0, 0.2])
    cosines = face_normals(mesh) @ axis / np.linalg.norm(axis)
    found = mapped(mesh, axis=tuple(axis.tolist()), caps=True)
    assert found.tallies["caps above"] == (cosines > math.sqrt(0.5)).sum()
    assert found.tallies["caps below"] == (cosines < -math.sqrt(0.5)).sum()
    assert (signed_areas(found.corners) > 0.0).all()


def test_corners_beyond_the_height_stay_clear_of_the_caps():
    mesh = prism(16)
    found = mapped(mesh, caps=True, height=(-1.5, -0.5)).corners  # the side goes from -1 to 1
    assert found[32:, :, 1].min() > found[:32, :, 1].max() and found[:32, :, 1].min() >= 0.0


def on_sphere(mesh, **choices):
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
    corners = on_sphere(mesh, axis=tuple(axis.tolist()), center=(0.1, 0.2, 0.3)).corners
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


def test_faces_around_a_pole_are_counted_and_the_others_span_less_than_half():
    mesh = icosphere(3)
    # An axis through the inside of two faces, which no vertex comes near to.
    corners = mesh.positions[mesh.faces[17]]
    found = on_sphere(mesh, axis=tuple((corners * [[3], [2], [1]]).sum(axis=0).tolist()))
    assert found.tallies == {"faces around a pole": 2}
    spans = np.ptp(found.corners[..., 0], axis=1)
    assert (spans >= 0.5).sum() == 2
    assert spans[17] > 0.5


def test_theta_is_the_arc_that_fills_s():
    mesh = Mesh(positions=[[0, 0, 1], [1, 0, 1], [1, 1, 1]], faces=[[0, 1, 2]])
    s = on_sphere(mesh, theta=(0.0, 90.0), center=(0, 0, 0)).corners[0, :, 0]
    assert s == pytest.approx([0.0, 0.5, 0.5], abs=1e-12)  # about y, the front is +z


@pytest.mark.parametrize("height", [1.0, -1.0, 1e-9, -1e-9])
def test_points_near_a_pole_keep_their_latitude(height):
    # The arc cosine of height / distance would have lost all of it.
    tiny = 1e-9 * abs(height)
    mesh = Mesh(
        positions=[[tiny, height, 0], [0, height, tiny], [-tiny, height, 0]], faces=[[0, 1, 2]]
    )
    from_pole = 0.5 - np.abs(on_sphere(mesh, center=(0, 0, 0)).corners[0, :, 1] - 0.5)
    assert from_pole * math.pi == pytest.approx([1e-9] * 3, rel=1e-6)


@pytest.mark.parametrize("axis", ["y", (1.0, 2.0, -0.5)])
@pytest.mark.parametrize("sides", [3, 4, 7, 101])
def test_the_axis_of_a_prism_runs_through_its_middle(sides, axis):
    frame = frame_about(axis)
    upright = prism(sides)
    # From the axes (z, x, y), which the prism was made in, to those of the frame.
    place = np.array([1e3, -2e3, 5e2])
    mesh = upright.replace(positions=upright.positions[:, [2, 0, 1]] @ frame * 4.0 + place)
    center = frame @ (center_about_axis(mesh, None, frame) - place)
    np.testing.assert_allclose(center[:2], 0.0, atol=1e-8)


def test_without_a_circle_around_it_the_axis_is_that_of_the_bounding_box_to_the_last_bit():
    bent = prism(5)
    positions = bent.positions.copy()
    positions[[0, 5]] *= (0.9, 1.0, 0.9)  # a corner inside the circle
    part = bent.replace(faces=bent.faces[:1])
    for mesh in (icosphere(2), plane(3, 2), prism(4), bent.replace(positions=positions), part):
        found = center_about_axis(mesh, None, frame_about("y"))
        np.testing.assert_array_equal(found, center_of(mesh, None))
