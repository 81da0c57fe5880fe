"""Two-part mapping: pairs of surface and ray against closed forms, and rays that miss."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake import Mesh, UnwrapOptions
from texbake.mapping.classical.box import side_pictures
from texbake.mapping.classical.cylindrical import cylindrical, spherical
from texbake.mapping.classical.frames import LocalPoints
from texbake.mapping.classical.planar import planar
from texbake.mapping.classical.two_part import Box, surface_around, two_part
from texbake.mesh.shapes import cube, icosphere, plane

EYE = (0.7, 1.1, 5.0)

directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: math.hypot(*v) > 0.1)
centers = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


def mapped(mesh, surface, via, **options):
    if via == "reflection":
        options.setdefault("eye", EYE)
    return two_part(mesh, UnwrapOptions(method="two-part", surface=surface, via=via, **options))


def soup(seed, n_faces=40):
    """Triangles anywhere: each corner has the normal of its face."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1.0, 1.0, (n_faces, 1, 3)) + rng.normal(0.0, 0.1, (n_faces, 3, 3))
    faces = np.arange(3 * n_faces, dtype=np.int32).reshape(-1, 3)
    return Mesh(positions=corners.reshape(-1, 3), faces=faces)


SAME = [
    ("sphere", "centroid", spherical, 0.0),
    ("sphere", "surface-normal", spherical, 0.0),
    ("cylinder", "surface-normal", cylindrical, 0.0),
    ("plane", "surface-normal", planar, 1e-9),
]


@pytest.mark.parametrize(("surface", "via", "method", "apart"), SAME)
@given(st.integers(0, 1000), directions, centers, st.sampled_from([None, (-2.0, 1.0)]))
@settings(max_examples=25)
def test_pairs_that_are_one_of_the_other_mappings(
    surface, via, method, apart, seed, axis, center, height
):
    mesh, where = soup(seed), {"axis": axis}
    if surface != "plane":
        where |= {"center": center, "theta": (10.0, 250.0)}
    if surface == "cylinder":
        where["height"] = height
    expected = method(mesh, UnwrapOptions(method=method.__name__, **where))
    found = mapped(mesh, surface, via, **where)
    np.testing.assert_allclose(found.corners, expected.corners, rtol=0.0, atol=apart)
    assert surface == "plane" or found.tallies == expected.tallies


def ray_directions(mesh, via, corners):
    """(F, 3, 3) of a soup about the origin, after the formulas of the paper."""
    if via == "centroid":
        return corners
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True))[:, None]
    if via == "object-normal":
        return np.broadcast_to(normals, corners.shape)
    v = np.array(EYE) - corners
    v /= np.linalg.norm(v, axis=2, keepdims=True)
    return 2.0 * (normals * v).sum(axis=2, keepdims=True) * normals - v


def s_and_t(angle, t):
    return np.stack([0.5 + angle / (2.0 * np.pi), t], axis=-1)


@pytest.mark.parametrize("via", ["object-normal", "centroid", "reflection"])
@pytest.mark.parametrize("surface", ["plane", "cylinder", "sphere"])
def test_pairs_against_closed_forms(surface, via):
    mesh = soup(3, 400)
    corners = mesh.positions[mesh.faces]
    along = ray_directions(mesh, via, corners)
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    with np.errstate(divide="ignore"):
        if surface == "plane":
            steps = (high[2] - corners[..., 2]) / along[..., 2]
        else:  # about y, so that the angle is that of (z, x)
            flat = np.array([1.0, float(surface == "sphere"), 1.0])
            a, b = (along**2) @ flat, (corners * along) @ flat
            squares = (mesh.positions**2) @ flat
            steps = (np.sqrt(b * b - a * ((corners**2) @ flat - squares.max())) - b) / a
    met = corners + steps[:, :, None] * along
    if surface == "plane":
        expected = (met[..., :2] - low[:2]) / (high - low)[:2].max()
    elif surface == "cylinder":
        t = (met[..., 1] - low[1]) / (high - low)[1]
        expected = s_and_t(np.arctan2(met[..., 0], met[..., 2]), t)
    else:
        latitude = np.arctan2(met[..., 1], np.hypot(met[..., 0], met[..., 2]))
        expected = s_and_t(np.arctan2(met[..., 0], met[..., 2]), 0.5 + latitude / np.pi)
    # Rays that come to the surface, no further away than its size, by all corners of a face.
    near = (np.abs(expected - 0.5).max(axis=2) <= 4.4) & (steps > 0.0)
    whole = near.all(axis=1)
    assert whole.sum() > 100
    found = mapped(mesh, surface, via, center=(0.0, 0.0, 0.0)).corners
    difference = (found - expected)[whole]
    if surface != "plane":
        difference[..., 0] -= np.round(difference[..., 0])  # whole turns
    assert np.abs(difference).max() <= 1e-9


def test_a_reflection_by_hand():
    # A floor at z = 0 that looks up to the eye at (0, 0, 2), and a ceiling at z = 3: what the point
    # (a, b, 0) mirrors to the eye lies above (a, b) (1 + 3 / 2).
    floor = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    spot = np.array([[0.0, 0, 3], [0, 0, 3], [0, 0, 3]])
    mesh = Mesh(positions=np.concatenate([floor, spot]), faces=[[0, 1, 2], [0, 2, 3], [4, 5, 6]])
    found = mapped(mesh, "plane", "reflection", eye=(0.0, 0.0, 2.0))
    expected = 0.5 + 0.5 * 2.5 * floor[:, :2]
    np.testing.assert_allclose(found.corners[:2], expected[mesh.faces[:2]], atol=1e-12)
    assert found.tallies == {
        "corners without a ray, sent from the center": 3  # the spot has no normal
    }


def test_a_cube_by_the_normals_of_its_box_fills_six_equal_squares():
    mesh = cube()
    found = mapped(mesh, "box", "surface-normal")
    assert found.tallies == {}
    areas = 0.5 * np.linalg.det(found.corners[:, 1:] - found.corners[:, :1])
    assert (areas > 0.0).all()  # seen from outside, none is mirrored
    np.testing.assert_allclose(areas, areas[0], rtol=1e-12)
    # Two faces a side, and the sides in a cell each.
    normals = np.cross(*np.diff(mesh.positions[mesh.faces], axis=1).transpose(1, 0, 2))
    middles = {
        tuple(normal): found.corners[(normals == normal).all(axis=1)].mean(axis=(0, 1)).round(3)
        for normal in normals
    }
    assert len(middles) == len({tuple(middle) for middle in middles.values()}) == 6


def test_faces_turned_away_from_the_plane_take_its_nearest_points():
    mesh = plane(3, 3)
    away = Mesh(positions=mesh.positions, faces=mesh.faces[:, ::-1])
    found = mapped(away, "plane", "object-normal")
    assert found.tallies == {"faces whose rays miss the plane, mapped to its nearest points": 18}
    assert np.array_equal(found.corners, mapped(away, "plane", "surface-normal").corners)
    assert mapped(mesh, "plane", "object-normal").tallies == {}


def test_smooth_normals_lead_the_rays_even_where_a_mesh_has_its_own():
    mesh = icosphere(1)
    wrong = mesh.replace(normals=[[1.0, 0.0, 0.0]], normal_faces=np.zeros_like(mesh.faces))
    assert np.array_equal(
        mapped(wrong, "sphere", "object-normal").corners,
        mapped(mesh, "sphere", "object-normal").corners,
    )


def box_options():
    return UnwrapOptions(method="two-part", surface="box")


def around(surface, points, faces):
    options = UnwrapOptions(method="two-part", surface=surface)
    return surface_around(LocalPoints(points, 1.0, 1e-15), faces, options)


def test_rays_that_miss_a_plane():
    # Corners of the unit square at height 0, and one point at height 1: the plane is z = 1.
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 1, 2], [1, 2, 3], [0, 1, 4]])
    plane = around("plane", points, faces)
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


def test_rays_that_miss_a_cylinder():
    points = np.array([[1.0, 0, -1], [0, 1, 1], [0, 0, 0], [0, 0, 0.5]])
    faces = np.array([[0, 1, 2], [1, 2, 3]])
    cylinder = around("cylinder", points, faces)
    directions = np.array([[0.0, 0, 1], [0, 0, 0], [1, 0, 8.9], [1, 0, 9.1]])
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    hits, missed = cylinder.hits(points, directions / np.where(lengths, lengths, 1.0))
    # Height 2 and a reach of four times that: up to z = 9.
    assert missed.tolist() == [True, True, False, True]
    np.testing.assert_allclose(hits[2], [1.0, 0.0, 8.9], rtol=1e-14)


def test_rays_to_a_pole_end_on_it():
    points = np.array([[0.3, 0.4, 0.1], [1.0, 0.0, 0.0], [0.0, 0.9, 0.0]])
    sphere = around("sphere", points, np.array([[0, 1, 2]]))
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
def test_rays_leave_a_box_through_the_first_of_its_planes(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(300, 3)) * rng.uniform(0.2, 2.0, 3) + rng.normal(size=3)
    directions = rng.normal(size=(300, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    local = LocalPoints(points, 1.0, 1e-15)
    faces = np.repeat(np.arange(len(local.points), dtype=np.int32)[:, None], 3, axis=1)
    options = box_options()
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


def test_a_face_across_an_edge_of_the_box_stays_in_one_cell():
    points = np.array([[1.0, 0.3, 0], [0.3, 1.0, 0], [0.9, 0.2, 0.1], [-1, -1, -1], [1, 1, 1]])
    faces = np.array([[0, 1, 2], [3, 4, 3]])
    local = LocalPoints(points, 1.0, 1e-16)
    directions = points / np.linalg.norm(points, axis=1, keepdims=True)
    box = Box.around(local, faces, box_options())
    mapped = box.mapped_by_rays(points, directions, faces[:1])
    assert mapped.tallies == {"faces across an edge of the box": 1}
    # Angle 0 is the front: e1 is +z of the pictures. The second corner's ray would meet the plane
    # e1 = 1 at e2 = 1 / 0.3, beyond the edge, so it lies on the edge at e2 = 1.
    upright = np.array([[0.3, 0.0, 1.0], [1.0, 0.0, 1.0], [0.2 / 0.9, 0.1 / 0.9, 1.0]])
    expected = side_pictures(upright[None], np.array([4]), np.ones(3), box_options())
    np.testing.assert_allclose(mapped.corners, expected, atol=1e-14)
