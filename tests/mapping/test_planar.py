"""Planar mapping against closed forms; which way pictures are turned, fits, and sides."""

import numpy as np
import pytest

from texbake import Mesh, OptionError, UnwrapOptions
from texbake.errors import UvError
from texbake.mapping.classical.planar import parametric, planar
from texbake.mapping.corner_uvs import signed_areas, surface_areas
from texbake.mesh.normals import AREA_ROUNDING, face_normals
from texbake.mesh.shapes import cube, icosphere, plane, uv_sphere


def mapped(mesh, **choices):
    return planar(mesh, UnwrapOptions(method="planar", **choices))


def rotation(seed):
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


@pytest.mark.parametrize(("axis", "right", "up"), [
    ("z", (1, 0, 0), (0, 1, 0)),
    ("x", (0, 0, -1), (0, 1, 0)),
    ("y", (1, 0, 0), (0, 0, -1)),
    ((0, -2, 0), (1, 0, 0), (0, 0, 1)),
    ((0, 0, -1), (-1, 0, 0), (0, 1, 0)),
])  # fmt: skip
def test_the_plane_drops_one_coordinate_and_fits_the_square(axis, right, up):
    positions = np.random.default_rng(4).normal(size=(90, 3)) * (3.0, 2.0, 1.0)
    mesh = Mesh(positions=positions, faces=np.arange(90).reshape(-1, 3))
    corners = mapped(mesh, axis=axis).corners.reshape(-1, 2)
    flat = np.stack([positions @ right, positions @ up], axis=1)
    flat -= flat.min(axis=0)
    assert np.abs(corners - flat / flat.max()).max() < 1e-14
    assert (corners.min(), corners.max()) == (0.0, 1.0)


@pytest.mark.parametrize("seed", range(6))
def test_any_normal_is_a_parallel_projection_that_is_not_mirrored(seed):
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    mesh = icosphere(2)
    corners = mapped(mesh, normal=tuple(normal.tolist())).corners
    normal /= np.linalg.norm(normal)
    # Distances in the plane, which need no frame, and the sign of areas.
    flat = mesh.positions - (mesh.positions @ normal)[:, None] * normal
    edges = np.linalg.norm((np.roll(flat[mesh.faces], -1, axis=1) - flat[mesh.faces]), axis=2)
    found = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    scale = found.sum() / edges.sum()
    assert np.abs(found - scale * edges).max() < 1e-9
    facing = face_normals(mesh) @ normal
    assert np.array_equal(signed_areas(corners) > 0.0, facing > 0.0)
    assert np.ptp(corners[..., 1]) == pytest.approx(
        np.ptp(mesh.positions @ [0, 1, 0]) * scale, rel=0.5
    )


def test_a_cube_is_seen_from_its_front_with_four_faces_edge_on():
    found = mapped(cube())
    assert found.tallies == {"faces seen from behind": 2, "faces seen edge-on": 8}
    assert sorted(np.unique(np.abs(signed_areas(found.corners)))) == [0.0, 0.5]


def test_sides_lie_in_a_half_each_and_none_is_mirrored():
    # Turned, so that no face is edge-on.
    mesh = icosphere(3).replace(positions=icosphere(3).positions @ rotation(1))
    found = mapped(mesh, axis="x", sides=True)
    away = face_normals(mesh)[:, 0] < 0.0
    assert found.tallies == {"faces seen from behind": int(away.sum())}
    front, back = found.corners[~away], found.corners[away]
    assert (signed_areas(found.corners) > 0.0).all()
    assert front[..., 0].max() <= 0.5
    assert back[..., 0].min() >= 0.5
    assert found.corners.min() == 0.0
    assert 1.0 - 1e-12 < found.corners[..., 0].max() <= 1.0
    # One scale; and seen from behind, what is to the left in front is to the right.
    right, up = -mesh.positions[:, 2], mesh.positions[:, 1]
    scale = 0.5 / np.ptp(right)
    s = np.where(away[:, None], 1.0 - scale * (right - right.min())[mesh.faces], 0.0)
    s[~away] = scale * (right - right.min())[mesh.faces[~away]]
    assert np.abs(found.corners[..., 0] - s).max() < 1e-12
    assert np.abs(found.corners[..., 1] - scale * (up - up.min())[mesh.faces]).max() < 1e-12


@pytest.mark.parametrize("seed", range(8))
def test_pca_lays_a_turned_rectangle_along_s(seed):
    flat = plane(8, 4)
    turn = rotation(seed)
    corners = (flat.positions - (0.5, 0.5, 0.0)) * (4.0, 1.0, 0.0)
    # Divided unevenly: more triangles at one end must not turn it.
    corners[:, 0] += 0.4 * np.cos(np.pi * corners[:, 0] / 4.0)
    mesh = flat.replace(positions=corners @ turn.T + 10.0)
    found = mapped(mesh, fit="pca").corners.reshape(-1, 2)
    assert np.ptp(found, axis=0) == pytest.approx([1.0, 0.25], abs=1e-9)
    expected = (corners[:, :2] + (2.0, 0.5))[mesh.faces].reshape(-1, 2) / 4.0
    ways = [expected, (1.0, 0.25) - expected]  # either end first, and never mirrored
    assert min(np.abs(found - way).max() for way in ways) < 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_pca_in_a_plane_that_is_given_turns_within_it(seed):
    mesh = icosphere(2).replace(positions=icosphere(2).positions * (3.0, 1.0, 2.0) @ rotation(seed))
    corners = mapped(mesh, axis="z", fit="pca").corners
    bounds = mapped(mesh, axis="z").corners
    scale = np.sqrt(np.abs(signed_areas(bounds)).sum() / np.abs(signed_areas(corners)).sum())
    # The same picture but for a turn by at most a quarter and a scale.
    moved = (bounds - bounds[0, 0]).reshape(-1, 2) @ (1.0, 1.0j)
    turned = scale * ((corners - corners[0, 0]).reshape(-1, 2) @ (1.0, 1.0j))
    ratios = turned[np.abs(moved) > 0.1] / moved[np.abs(moved) > 0.1]
    assert np.abs(ratios - ratios[0]).max() < 1e-9
    assert abs(ratios[0]) == pytest.approx(1.0, abs=1e-9)
    assert ratios[0].real > 0.0
    # Coordinates of the points of the surface no longer correlate; a triangle's second moments are
    # those of its corners and nine times its middle's.
    areas = surface_areas(mesh.positions[mesh.faces])
    off = corners - np.average(corners.mean(axis=1), axis=0, weights=areas)
    middles = off.mean(axis=1)
    covariance = np.einsum("f,fci,fcj->ij", areas, off, off)
    covariance += 9.0 * np.einsum("f,fi,fj->ij", areas, middles, middles)
    assert abs(covariance[0, 1]) < 1e-12 * np.trace(covariance)
    assert covariance[0, 0] >= covariance[1, 1]


@pytest.mark.parametrize("mesh", [cube(), icosphere(2)], ids=["cube", "sphere"])
def test_pca_of_an_evenly_spread_mesh_is_the_front(mesh):
    # Directions of equal variances are projected onto: a rounding away from the axes.
    assert np.abs(mapped(mesh, fit="pca").corners - mapped(mesh).corners).max() < 1e-14


def test_pca_looks_from_the_front_where_it_can():
    tile = plane(1, 1).replace(positions=plane(1, 1).positions * (1.0, 0.5, 0.0))
    assert np.array_equal(mapped(tile, fit="pca").corners, mapped(tile).corners)
    # An open surface that faces backwards is seen from where it faces.
    turned = tile.replace(faces=tile.faces[:, ::-1])
    assert not mapped(turned, fit="pca").tallies
    assert mapped(turned).tallies == {"faces seen from behind": 2}


def test_a_plane_seen_edge_on_is_a_line_and_a_point_a_point():
    found = mapped(plane(2, 2), axis="x")
    assert found.tallies == {"faces seen edge-on": 8}
    assert np.array_equal(np.unique(found.corners[..., 0]), [0.0])
    assert np.array_equal(np.unique(found.corners[..., 1]), [0.0, 0.5, 1.0])
    point = Mesh(positions=[[3, 4, 5]] * 3, faces=[[0, 1, 2]])
    for fit in "bounds", "pca":
        assert not mapped(point, fit=fit, sides=True).corners.any()


@pytest.mark.parametrize("first", [0, 1, 2])
def test_a_face_is_edge_on_by_its_longest_edge_whichever_comes_first(first):
    thickness = 0.1 * AREA_ROUNDING
    positions = [[0, -0.5, 0], [0, 0.5, 0], [thickness, -0.499, 1]]
    mesh = Mesh(positions=positions, faces=[np.roll([0, 1, 2], first)])
    assert mapped(mesh).tallies == {"faces seen edge-on": 1}


def test_without_a_map_coordinates_are_the_parameters_bit_by_bit():
    mesh = uv_sphere(6, 9)
    found = parametric(mesh, UnwrapOptions(method="parametric"))
    assert np.array_equal(found.corners, mesh.corner_uvs())
    assert found.tallies == {}


def test_the_linear_map_is_that_of_its_six_numbers():
    mesh = plane(3, 5)  # (u, v) = (x, y)
    linear = (2.0, -1.0, 0.25, 0.5, 3.0, -7.0)
    found = parametric(mesh, UnwrapOptions(method="parametric", linear=linear))
    x, y, _ = np.moveaxis(mesh.positions[mesh.faces], 2, 0)
    assert np.array_equal(found.corners[..., 0], 2.0 * x - y + 0.25)
    assert np.array_equal(found.corners[..., 1], 0.5 * x + 3.0 * y - 7.0)


def test_a_mesh_without_parameters_is_an_error():
    with pytest.raises(UvError, match="no texture coordinates"):
        parametric(cube(), UnwrapOptions(method="parametric"))


def test_coordinates_that_overflow_are_one_error():
    mesh = plane().replace(uvs=plane().uvs * 1e200)
    options = UnwrapOptions(method="parametric", linear=(1e200, 0.0, 0.0, 0.0, 1.0, 0.0))
    with pytest.raises(OptionError, match="that are not finite"):
        parametric(mesh, options)
