"""Normals: closed forms, an oracle, invariances, and degenerate faces."""

import itertools

import numpy as np
import pytest

from tests.models import CASES, moved, soup_of
from texbake import Mesh, make
from texbake.mesh.normals import (
    face_normals,
    flat_normals,
    shading_normals,
    smooth_normals,
    vertex_curvatures,
    vertex_normals,
    with_visible_normals,
)
from texbake.mesh.shapes import icosphere, plane, uv_sphere

# A unit normal is a few roundings of 2^-53 off; a sum of some tens of weighted ones, some tens.
ROUNDING = 1e-14

CUBE = np.array(list(itertools.product([-1.0, 1.0], repeat=3)))
CUBE_SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def cube_faces(cuts):
    """Two triangles a side, cut along its first or second diagonal."""
    faces = []
    for (a, b, c, d), second in zip(CUBE_SIDES, cuts, strict=True):
        faces += [(a, b, d), (b, c, d)] if second else [(a, b, c), (a, c, d)]
    return np.array(faces)


def grid_mesh(n, seed=0, **changes):
    """A bumpy sheet of 2 n^2 triangles."""
    rng = np.random.default_rng(seed)
    sheet = plane(n, n, lambda x, y: rng.normal(0, 0.3 / n, x.shape))
    return sheet.replace(uvs=None, uv_faces=None, **changes)


def oracle(positions, faces):
    """Angle-weighted normals in plain numpy, one angle at a time."""
    edges = positions[faces[:, [1, 2, 0]]] - positions[faces]
    back = -edges[:, [2, 0, 1]]
    cross = np.cross(edges, back)
    angles = np.arctan2(np.linalg.norm(cross, axis=2), (edges * back).sum(axis=2))
    units = cross / np.linalg.norm(cross, axis=2, keepdims=True)
    sums = np.zeros_like(positions)
    np.add.at(sums, faces, angles[..., None] * units)
    return sums / np.linalg.norm(sums, axis=1, keepdims=True)


@pytest.mark.parametrize("cuts", list(itertools.product([False, True], repeat=6)))
def test_cube_corners_point_outward_however_it_is_cut(cuts):
    mesh = Mesh(positions=CUBE, faces=cube_faces(cuts))
    assert np.abs(vertex_normals(mesh) - CUBE / np.sqrt(3)).max() < ROUNDING


def test_vertex_normals_match_the_oracle():
    mesh = grid_mesh(40)
    difference = vertex_normals(mesh) - oracle(mesh.positions, mesh.faces)
    assert np.abs(difference).max() < ROUNDING


@pytest.mark.parametrize("name", ["figure", "mirrored_ball"])
def test_vertex_normals_match_blender(name):
    reference = np.load(CASES / f"{name}_tangents.npz")
    mesh = Mesh(positions=reference["positions"], faces=reference["faces"])
    ours, theirs = vertex_normals(mesh)[mesh.faces], reference["normals"].astype(float)
    sines = np.linalg.norm(np.cross(ours, theirs), axis=2)
    # Blender's are float32, from an arc cosine good to 4.5e-5 radians.
    assert sines.max() < 4.5e-5
    assert (ours * theirs).sum(axis=2).min() > 0.0


@pytest.mark.parametrize("of", [face_normals, vertex_normals, smooth_normals])
class TestInvariance:
    @pytest.mark.parametrize("exponent", [-900, -40, 1, 40, 900])
    def test_power_of_two_changes_no_bit(self, of, exponent):
        mesh = grid_mesh(9)
        scaled = mesh.replace(positions=np.ldexp(mesh.positions, exponent))
        assert of(scaled).tobytes() == of(mesh).tobytes()

    def test_reversed_winding_flips_normals(self, of):
        mesh = grid_mesh(9)
        reversed_ = mesh.replace(faces=mesh.faces[:, ::-1])
        assert np.abs(of(reversed_) + of(mesh)).max() < ROUNDING

    def test_threads_change_no_bit(self, of):
        mesh = grid_mesh(110)  # 24,200 triangles: enough to be cut into bands
        one = of(mesh, threads=1)
        assert of(mesh, threads=2).tobytes() == one.tobytes()
        assert of(mesh, threads=5).tobytes() == one.tobytes()


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
def test_face_on_a_line_has_no_normal_and_a_sliver_its_own(scale):
    direction = np.array([0.1, 0.7, -0.3])
    points = (np.array([0.3, 0.9, 0.2]) + direction * np.array([[0], [1.1], [3.7]])) * scale
    mesh = Mesh(positions=points, faces=[[0, 1, 2], [0, 0, 1], [2, 2, 2]])
    assert not face_normals(mesh).any() and not vertex_normals(mesh).any()
    mesh = Mesh(
        positions=np.array([[0, 0, 0], [1, 0, 0], [0.5, 1e-9, 0]]) * scale, faces=[[0, 1, 2]]
    )
    assert face_normals(mesh).tolist() == [[0.0, 0.0, 1.0]]
    assert vertex_normals(mesh).tolist() == [[0.0, 0.0, 1.0]] * 3


def test_canceling_normals_give_that_of_the_first_face_with_area():
    pair = np.array([[0, 0, 0], [1, 0.1, 0], [0.3, 1.7, 0]])
    mesh = Mesh(
        positions=np.concatenate([pair, pair + np.array([0, 0, 5]), [[0, 0, 9]]]),
        faces=[[0, 0, 1], [0, 2, 1], [1, 2, 0], [3, 4, 5], [3, 5, 4]],
    )
    assert vertex_normals(mesh)[:, 2].tolist() == [-1.0] * 3 + [1.0] * 3 + [0.0]


class TestShadingNormals:
    def test_without_own_they_are_smooth(self):
        mesh = soup_of(grid_mesh(3))
        normals, normal_faces = shading_normals(mesh)
        assert np.array_equal(normals, smooth_normals(mesh))
        assert np.array_equal(normal_faces, mesh.faces)

    def test_zero_ones_are_replaced_corner_by_corner(self):
        own = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
        corners = np.zeros((8, 3), int)
        corners[2, 1] = 1
        mesh = grid_mesh(2, normals=own, normal_faces=corners)
        normals, normal_faces = shading_normals(mesh)
        expected = smooth_normals(mesh)[mesh.faces]
        expected[2, 1] = [1.0, 0.0, 0.0]
        assert np.array_equal(normals[normal_faces], expected)


def test_flat_normals_are_one_a_face():
    mesh = grid_mesh(3)
    normals, normal_faces = flat_normals(mesh)
    assert np.array_equal(normals, face_normals(mesh))
    assert normal_faces.dtype == np.int32
    assert np.array_equal(normal_faces, np.arange(18)[:, None] * [1, 1, 1])


def test_normals_turn_to_the_front_of_all_faces_where_one_does():
    n, n_turned = 8, 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        angles = 2 * np.pi * (np.arange(n) + rng.uniform(0, 0.9, n)) / n
        radii, heights = rng.uniform(0.1, 2, n), rng.normal(0, 2, n)
        ring = np.stack([radii * np.cos(angles), radii * np.sin(angles), heights], axis=1)
        around = np.arange(1, n + 1)
        fan = Mesh(
            positions=np.concatenate([np.zeros((1, 3)), ring]),
            faces=np.stack([0 * around, around, np.roll(around, -1)], axis=1),
        )
        sides, seen = face_normals(fan), with_visible_normals(fan)
        assert (sides[:, 2] > 0).all()  # so +z is a normal that all faces agree with
        before = (smooth_normals(fan)[0] * sides).sum(axis=1).min()
        if before < -np.sin(np.radians(1.0)):
            n_turned += 1
            assert (seen.normals[seen.normal_faces[:, 0]] * sides).sum(axis=1).min() > 0.0
    assert n_turned > 5
    ball = icosphere(2)
    assert with_visible_normals(ball) is ball


def test_a_normal_that_turns_stays_where_distant_faces_share_it():
    shared = np.array([0.96, 0.0, -0.28])
    mesh = Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 0, 0], [9, 1, 0], [9, 0, 1]],
        faces=[[0, 1, 2], [3, 4, 5]], normals=[shared], normal_faces=np.zeros((2, 3), np.int32),
    )  # fmt: skip
    seen = with_visible_normals(mesh)
    turned, kept = seen.normals[seen.normal_faces]
    assert (turned[:, 2] > 0.0).all() and (turned[:, 0] > 0.9).all()
    assert np.array_equal(kept, [shared] * 3)


@pytest.mark.parametrize("radius", [1.0, 3.0, 1e-4, 1e6])
def test_a_sphere_with_radial_normals_has_one_over_its_radius_exactly(radius):
    ball = icosphere(3)
    found = vertex_curvatures(moved(ball, scale=radius), normals=ball.positions)
    # A few roundings of float64 over some faces; the chord's error cancels in the divergence.
    np.testing.assert_allclose(found, 1.0 / radius, rtol=1e-12)


def test_a_sphere_with_its_own_normals_has_one_over_its_radius():
    errors = [np.abs(vertex_curvatures(uv_sphere(n, 2 * n)) - 1.0) for n in (32, 64, 128)]
    # Normals that are averaged over faces are off by the squares of their widths in the mean, and
    # about the poles, where the faces are no neighbors' mirror images, by their widths.
    assert errors[2].max() < errors[1].max() / 1.9 < errors[0].max() / 1.9**2 < 0.005
    assert errors[2].mean() < errors[1].mean() / 3.0 < errors[0].mean() / 9.0 < 2e-4


def test_turned_inside_out_it_is_hollow():
    ball = icosphere(2)
    inside = ball.replace(faces=ball.faces[:, ::-1])
    np.testing.assert_allclose(vertex_curvatures(inside), -vertex_curvatures(ball), rtol=1e-12)


def test_a_cylinder_bends_along_one_way_only():
    step = 2.0 * np.pi * 0.25 / 256
    mesh = make("cylinder", resolution=(256, 8), radius=0.25, height=8.0 * step)
    inner = np.abs(mesh.positions[:, 1]) < 2.5 * step
    # 1 / r around, 0 along, and so half of it in the mean; the chords take (pi / 256)^2 of it.
    found = vertex_curvatures(mesh)[inner]
    assert len(found) == 5 * 256
    np.testing.assert_allclose(found, 2.0, rtol=(np.pi / 256) ** 2)


def test_a_saddle_bends_both_ways_alike():
    mesh = plane(64, 64, lambda x, y: 0.5 * ((x - 0.5) ** 2 - (y - 0.5) ** 2))
    found = vertex_curvatures(mesh).reshape(65, 65)
    # Curvatures 1 and -1 in the middle; what is left is the diagonal's, of the size of the squares.
    assert abs(found[32, 32]) < 1e-3
    bowl = plane(64, 64, lambda x, y: 0.5 * ((x - 0.5) ** 2 + (y - 0.5) ** 2))
    # Hollow seen from above; 1/64^2 is the square of the step.
    assert vertex_curvatures(bowl).reshape(65, 65)[32, 32] == pytest.approx(-1.0, abs=1e-3)


def test_a_mesh_far_away_bends_as_it_does_here():
    ball = icosphere(2)
    # 1e6 leaves 1e-10 of a unit to positions; divided by edges of 0.3 and again by 0.3.
    found = vertex_curvatures(moved(ball, by=1e6))
    np.testing.assert_allclose(found, vertex_curvatures(ball), atol=1e-8)


def test_vertices_at_one_position_agree():
    ball = icosphere(1)
    split = soup_of(ball)
    np.testing.assert_allclose(
        vertex_curvatures(split)[split.faces], vertex_curvatures(ball)[ball.faces], rtol=1e-12
    )


def test_faces_without_area_and_lone_vertices_are_flat():
    mesh = Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [9, 9, 9]],
        faces=[[0, 1, 2], [0, 2, 3]],
    )
    assert vertex_curvatures(mesh).tolist() == [0.0] * 5
