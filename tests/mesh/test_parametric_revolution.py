"""Surfaces about an axis, against their closed forms, their volumes and their topology."""

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from tests.mesh.test_shapes import areas_in_texture
from texbake import OptionError, make
from texbake.mesh.normals import face_normals
from texbake.mesh.parametric.revolution import profile_outline
from texbake.mesh.topology import find_edges, genus

# A few roundings of numbers up to about 2.
ROUNDING = 2e-15

CLOSED = {
    "sphere": ({}, 0), "torus": ({}, 1), "cylinder": ({"caps": True}, 0),
    "cone": ({"caps": True}, 0),
}  # fmt: skip


def volume(mesh):
    """What faces enclose about the y axis: the flux of (x, 0, z) / 2, of which lids have none."""
    a, b, c = np.moveaxis(mesh.positions[mesh.faces], 1, 0)
    return ((a + b + c) / 6 * [1, 0, 1] * np.cross(b - a, c - a)).sum() / 2


def corners_of(mesh):
    """u, v, positions and normals of all corners, one after the other."""
    u, v = mesh.corner_uvs().reshape(-1, 2).T
    return u, v, mesh.positions[mesh.faces].reshape(-1, 3), corner_normals(mesh).reshape(-1, 3)


def corner_normals(mesh):
    return mesh.normals[mesh.normal_faces]


def around(u, radius, height):
    angle = 2 * np.pi * (u - 0.5)
    height = np.broadcast_to(height, u.shape)
    return np.stack([radius * np.sin(angle), height, radius * np.cos(angle)], axis=-1)


def sphere(u, v):
    normals = around(u, np.sin(np.pi * v), -np.cos(np.pi * v))
    return normals, normals


def torus(u, v):
    tube = 2 * np.pi * (v - 0.5)
    points = around(u, 1 + 0.4 * np.cos(tube), 0.4 * np.sin(tube))
    return points, around(u, np.cos(tube), np.sin(tube))


def cylinder(u, v):
    return around(u, 1.0, 2 * v - 1), around(u, 1.0, 0.0)


def cone(u, v):
    slope = np.sqrt(5.0)
    return around(u, 1 - v, 2 * v - 1), around(u, 2 / slope, 1 / slope)


@pytest.mark.parametrize("surface", [sphere, torus, cylinder, cone])
@pytest.mark.parametrize("resolution", [(3, 3), (8, 5), (37, 20)])
def test_corners_follow_the_closed_form(surface, resolution):
    u, v, positions, normals = corners_of(make(surface.__name__, resolution=resolution))
    points, directions = surface(u, v)
    assert np.abs(positions - points).max() < ROUNDING
    # At a pole each face has the normal of its own middle u, which its coordinate is.
    assert np.abs(normals - directions).max() < ROUNDING


@pytest.mark.parametrize("shape", CLOSED)
@pytest.mark.parametrize("resolution", [(3, 3), (16, 8), (65, 30)])
def test_closed_shapes_are_closed_by_their_indices(shape, resolution):
    options, handles = CLOSED[shape]
    mesh = make(shape, resolution=resolution, **options)
    edges = find_edges(mesh.faces)
    assert edges.closed and not edges.misoriented.any()
    assert genus(mesh.faces, edges, mesh.n_vertices) == handles
    assert volume(mesh) > 0
    assert len(np.unique(mesh.positions, axis=0)) == mesh.n_vertices


@pytest.mark.parametrize("sides", [3, 4, 7])
@pytest.mark.parametrize("resolution", [None, 5, (20, 3)])
def test_prisms_and_pyramids_have_their_volumes_and_flat_sides(sides, resolution):
    foot = 0.5 * sides * np.sin(2 * np.pi / sides)
    for shape, part in ("cylinder", 1.0), ("cone", 1 / 3):
        mesh = make(shape, sides=sides, caps=True, resolution=resolution, height=3)
        assert volume(mesh) == pytest.approx(foot * 3 * part, rel=1e-14)
        away = np.abs(corner_normals(mesh) - face_normals(mesh)[:, None]).max()
        assert away < 1e-14  # a cross product of numbers up to 3
        assert len(mesh.normals) == sides + len(mesh.group_names) - 1
        assert find_edges(mesh.faces).closed


def test_a_prism_of_default_resolution_has_one_square_a_side():
    assert make("cylinder", sides=6).n_faces == 12
    assert make("cone", sides=4).n_faces == 4


def test_each_cap_is_a_disk_in_a_tile_of_its_own():
    mesh = make("cylinder", caps=True, resolution=(16, 2), radius=3)
    assert mesh.group_names == ("side", "bottom", "top")
    corners, points = mesh.corner_uvs(), mesh.positions[mesh.faces]
    for part, up in (1, 1), (2, -1):
        faces = mesh.face_groups == part
        assert faces.sum() == 16
        disk = corners[faces] - [part + 0.5, 0.5]
        np.testing.assert_allclose(disk, points[faces][..., [0, 2]] * [1, up] / 6, atol=ROUNDING)
    assert corners[mesh.face_groups == 0].max() == 1.0
    # The center is one coordinate, and each corner of the rim one in the cap.
    assert len(mesh.uvs) == 17 * 3 + 2 * 17


# ---- profiles


def lathe(profile, **options):
    return make("revolution", profile=profile, **{"resolution": (24, 1), **options})


def test_a_profile_gives_the_shapes_that_have_names():
    for profile, shape in (([(1, -1), (1, 1)], "cylinder"), ([(1, -1), (0, 1)], "cone")):
        named, turned = make(shape, resolution=(24, 6)), lathe(profile, resolution=(24, 6))
        np.testing.assert_array_equal(named.faces, turned.faces)
        np.testing.assert_array_equal(named.positions, turned.positions)
        np.testing.assert_array_equal(named.uvs, turned.uvs)
        np.testing.assert_allclose(named.normals, turned.normals, atol=ROUNDING)


def test_it_faces_outwards_from_whichever_end_it_is_listed():
    points = [(0.0, 0.0), (1.0, 0.2), (0.7, 1.0), (0.0, 1.5)]
    up, down = lathe(points), lathe(points[::-1])
    assert volume(up) > 0
    np.testing.assert_array_equal(up.positions, down.positions)
    np.testing.assert_array_equal(up.faces, down.faces)


def test_v_is_the_length_of_the_profile_and_long_segments_get_more_rows():
    mesh = lathe([(1, 0), (1, 3), (2, 3)])
    assert sorted(set(mesh.uvs[:, 1].tolist())) == [0.0, 0.75, 1.0]
    mesh = lathe([(1, 0), (1, 9), (2, 9)], resolution=(8, 10))
    assert mesh.n_faces == 2 * 8 * 10
    heights = set(mesh.positions[:, 1].tolist())
    assert heights == set(range(10))
    assert lathe([(1, 0), (1, 9), (2, 9)], resolution=(8, 1)).n_faces == 2 * 8 * 2


@given(
    st.lists(st.tuples(st.floats(0.5, 2.0), st.floats(0.1, 1.0)), min_size=3, max_size=7),
    st.sampled_from([0.0, 20.0, 60.0, 90.0]),
    st.booleans(),
)
def test_normals_of_a_profile_are_means_where_it_is_smooth(steps, crease, tip):
    """The mean at a point weights each segment by the length of the other."""
    heights = np.cumsum([height for _, height in steps])
    points = np.column_stack([[radius for radius, _ in steps], heights])
    points[-1, 0] *= not tip
    edges = np.diff(points, axis=0)
    lengths = np.hypot(*edges.T)
    normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / lengths[:, None]
    turns = np.degrees(np.arccos(np.clip((normals[1:] * normals[:-1]).sum(axis=1), -1, 1)))
    last = np.degrees(np.arcsin(abs(normals[-1, 0]))) * 2  # from one side of the tip to the other
    assume((np.abs(np.append(turns, last) - crease) > 1e-4).all())
    expected = [(points[0], normals[0])]
    for i, turn in enumerate(turns):
        mean = lengths[i + 1] * normals[i] + lengths[i] * normals[i + 1]
        mean /= np.linalg.norm(mean)
        sides = [mean] if turn <= crease else [normals[i], normals[i + 1]]
        expected += [(points[i + 1], normal) for normal in sides]
    expected.append((points[-1], [0.0, 1.0] if tip and last <= crease else normals[-1]))
    for profile in points, points[::-1]:
        found = profile_outline(profile, 1, crease)
        np.testing.assert_allclose(found.points, [point for point, _ in expected], atol=1e-15)
        np.testing.assert_allclose(found.normals, [n for _, n in expected], atol=1e-12)


def test_a_closed_profile_is_a_ring():
    square = [(1, 0), (2, 0), (2, 1), (1, 1), (1, 0)]
    for points in square, square[::-1], square[2:] + square[1:3]:
        mesh = lathe(points)
        edges = find_edges(mesh.faces)
        assert genus(mesh.faces, edges, mesh.n_vertices) == 1
        # Pappus: the area goes around the centroid, at 1.5, on a polygon of 24 sides.
        assert volume(mesh) == pytest.approx((4 - 1) * 12 * np.sin(2 * np.pi / 24), rel=1e-14)
        assert areas_in_texture(mesh).sum() == pytest.approx(1)


def test_a_profile_may_touch_the_axis_run_along_it_and_repeat_points():
    mesh = lathe([(1, -1), (0, 0), (1, 1)])
    assert (mesh.n_vertices, mesh.n_faces) == (2 * 24 + 1, 2 * 24)
    assert (face_normals(mesh) != 0).any(axis=1).all() and np.isfinite(mesh.normals).all()
    plain = lathe([(0, 0), (1, 0), (1, 1), (0, 1)])
    more = lathe([(0, -2), (0, -1), (0, 0), (1, 0), (1, 0), (1, 1), (0, 1), (0, 1), (0, 7)])
    np.testing.assert_array_equal(plain.positions, more.positions)
    np.testing.assert_array_equal(plain.uvs, more.uvs)


def test_part_of_a_turn_is_open_with_its_middle_at_the_front():
    mesh = lathe([(1, 0), (1, 1)], turns=0.5, resolution=(4, 1))
    assert (mesh.n_vertices, find_edges(mesh.faces).boundary.sum()) == (5 * 2, 2 * 4 + 2)
    x, _, z = mesh.positions.T
    assert z.min() == pytest.approx(0, abs=1e-16)
    assert sorted(x.tolist())[::9] == [-1.0, 1.0]


@settings(max_examples=60)
@given(
    st.lists(
        st.tuples(st.integers(0, 9999), st.integers(-9999, 9999)).map(lambda p: np.divide(p, 1000)),
        min_size=2,
        max_size=8,
    ),
    st.sampled_from([0.0, 30.0, 90.0]),
)
def test_any_profile_gives_a_sound_mesh_or_one_clear_error(points, crease):
    try:
        mesh = lathe(points, crease=crease, resolution=(5, 6))
    except OptionError as error:
        assert str(error).startswith("profile: it ")
        return
    assert np.isfinite(mesh.normals).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-12)
    assert mesh.uvs.min() >= 0 and mesh.uvs.max() <= 1
    edges = find_edges(mesh.faces)
    assert not edges.non_manifold.any() and not edges.misoriented.any()
    assert volume(mesh) >= -1e-9 * np.abs(mesh.positions).max() ** 3
