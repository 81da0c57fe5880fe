"""Normals by a rule: which edges are hard, and which meshes have sharp edges."""

import numpy as np
import pytest

from tests.models import joined
from texbake import Mesh, OptionError, make, unwrap
from texbake.mesh.hard_edges import (
    inner_edges,
    normals_jump,
    with_normals,
    with_own_hard_edges,
    with_sharp_edges,
)
from texbake.mesh.normals import face_normals, smooth_normals
from texbake.mesh.shapes import cube, icosphere


def bare(mesh):
    return Mesh(positions=mesh.positions, faces=mesh.faces)


BARREL = bare(make("cylinder", resolution=(96, 4), caps=True))
TORUS = bare(make("torus", resolution=(60, 30)))


def turns(mesh):
    """Degrees that faces turn by at each inner edge."""
    one, other = inner_edges(mesh)
    sides = face_normals(mesh)
    cosines = (sides[one // 3] * sides[other // 3]).sum(axis=1)
    return np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))


@pytest.mark.parametrize("mesh", [cube(), BARREL, TORUS], ids=["cube", "barrel", "torus"])
@pytest.mark.parametrize("angle", [3.0, 30.0, 60.0, 120.0])
def test_edges_are_hard_above_the_angle_alone(mesh, angle):
    hard = with_normals(mesh, "angle", angle=angle)
    jumps = normals_jump(hard, *inner_edges(hard))
    np.testing.assert_array_equal(jumps, turns(mesh) > angle)
    np.testing.assert_array_equal(hard.positions, mesh.positions)
    again = with_own_hard_edges(hard)
    np.testing.assert_array_equal(again.normals, hard.normals)


def test_smooth_normals_are_those_of_places():
    mesh = with_normals(with_normals(cube(), "angle"), "smooth")
    np.testing.assert_array_equal(
        mesh.normals[mesh.normal_faces], smooth_normals(cube())[cube().faces]
    )
    assert not normals_jump(mesh, *inner_edges(mesh)).any()


def test_polygons_have_no_hard_edge_within():
    """A sheet of quads, each bent along its diagonal."""
    x, y = (axis.ravel() for axis in np.meshgrid(range(4), range(4)))
    corners = (x[:, None] + 4 * y[:, None] + [0, 1, 5, 4])[(x < 3) & (y < 3)]
    faces = corners[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    polygon_of = np.arange(len(faces)) // 2
    sheet = Mesh(positions=np.stack([x, y, x * y % 3], axis=1), faces=faces, polygon_of=polygon_of)
    one, other = inner_edges(sheet)
    hard = with_normals(sheet, "angle", angle=5.0)
    within = polygon_of[one // 3] == polygon_of[other // 3]
    jumps = normals_jump(hard, one, other)
    np.testing.assert_array_equal(jumps[within], False)
    np.testing.assert_array_equal(jumps[~within], turns(sheet)[~within] > 5.0)


def test_normals_are_split_where_coordinates_are():
    mesh = with_normals(unwrap(BARREL, size=128), "uv")
    one, other = inner_edges(mesh)
    corners = mesh.corner_uvs().reshape(-1, 2)

    def after(half_edges):
        return 3 * (half_edges // 3) + (half_edges + 1) % 3

    ends = (corners[one] != corners[after(other)]) | (corners[after(one)] != corners[other])
    jumps = normals_jump(mesh, one, other)
    is_split = ends.any(axis=1)
    assert not jumps[~is_split].any() and jumps[is_split & (turns(mesh) > 60)].all()
    assert jumps.any()
    assert with_normals(mesh, "keep") is mesh


@pytest.mark.parametrize("mesh, n_sharp", [
    (cube(), 12),
    (BARREL, 192),
    (with_normals(joined(icosphere(3), cube()), "angle", angle=1e-3), 12),  # all facets
    (joined(cube(), bare(cube()).replace(positions=cube().positions + 5.0)), 24),
    (TORUS, 0),
    (icosphere(3), 0),
    (bare(make("sphere", resolution=(16, 8))), 0),
])  # fmt: skip
def test_sharp_edges_of_made_surfaces(mesh, n_sharp):
    found = with_sharp_edges(mesh)
    assert (found.normals is None) == (n_sharp == 0)
    if n_sharp:
        assert normals_jump(found, *inner_edges(found)).sum() == n_sharp


def test_normals_that_a_mesh_has_decide_its_hard_edges():
    mesh = with_normals(cube(), "smooth")
    assert with_sharp_edges(mesh) is mesh
    assert with_own_hard_edges(cube()).normals is None


@pytest.mark.parametrize("roughness", [0.003, 0.01, 0.03, 0.1])
def test_noise_makes_no_sharp_edges(roughness):
    sphere = icosphere(5)
    noise = np.random.default_rng(3).normal(size=(sphere.n_vertices, 1))
    rough = sphere.replace(positions=sphere.positions * (1.0 + roughness * noise))
    assert with_sharp_edges(rough) is rough


def test_an_angle_without_use_and_an_unknown_rule_are_errors():
    from texbake.jobs.options import RunOptions
    from texbake.mesh.options import TransformOptions

    for options in (TransformOptions, RunOptions):
        with pytest.raises(OptionError, match="angle: normals smooth do not use it"):
            options(normals="smooth", angle=30.0)
    with pytest.raises(OptionError, match="normals: flat is not one of smooth, angle, uv, keep"):
        with_normals(cube(), "flat")
