"""Truths against other computations of the same."""

import math

import numpy as np
import pytest

from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import icosphere, plane
from texbake.rendering.resolve import picture_error
from texbake.study.knob import Case, StudyPair
from texbake.study.truth.pictures import Floor, ball_points, sight_rays
from texbake.study.truth.probes import N_RAYS, angles_deg, mean_normals, probe
from texbake.study.truth.surfaces import (
    RadialSurface,
    orange_surface,
    rippled_surface,
    texel_grid,
    wave_heights,
    wave_normals,
    wave_slopes,
)
from texbake.texture.encoding import decode_srgb

DIRECTIONS = icosphere(3).positions


def ellipsoid(a, b, c):
    scale = np.array([a, b, c])
    return RadialSurface(lambda out: 1.0 / np.sqrt(np.square(out / scale).sum(axis=1))), scale


def test_normals_of_an_ellipsoid_are_those_of_its_equation():
    surface, scale = ellipsoid(1.0, 0.8, 0.6)
    points = DIRECTIONS * surface.radii(DIRECTIONS)[:, None]
    gradient = points / scale**2
    exact = gradient / np.linalg.norm(gradient, axis=1, keepdims=True)
    # Central differences of a step of 1e-5: h^2 and rounding / h, both about 1e-10 radians.
    assert np.degrees(np.abs(surface.normals(points) - exact)).max() < 1e-6


def test_lines_meet_an_ellipsoid_where_the_quadratic_says():
    surface, _ = ellipsoid(1.0, 0.9, 0.8)
    points = DIRECTIONS * surface.radii(DIRECTIONS)[:, None]
    rng = np.random.default_rng(0)
    lines = surface.normals(points) + 0.2 * rng.standard_normal(points.shape)
    lines /= np.linalg.norm(lines, axis=1, keepdims=True)
    points_met, converged = surface.hits(points + 0.03 * lines, lines)
    assert converged.all()
    assert np.linalg.norm(points_met - points, axis=1).max() < 1e-8


@pytest.mark.parametrize("make", [orange_surface, rippled_surface])
def test_triangles_of_a_made_surface_lie_along_its_normals(make):
    surface = make()
    mesh = surface.mesh(icosphere(5).positions, icosphere(5).faces, "made")
    a, b, c = (mesh.positions[mesh.faces[:, k]] for k in range(3))
    flat = np.cross(b - a, c - a)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    middle = surface.normals((a + b + c) / 3.0)
    assert np.median(np.einsum("ij,ij->i", flat, middle)) > math.cos(math.radians(6.0))


def test_probes_of_a_mesh_on_itself_find_its_own_normals():
    pair = Case(quick=True).made_pair
    itself = StudyPair(pair.low, pair.low, "itself")
    probes = probe(itself, 2000)
    assert len(probes.faces) == 2000
    assert np.abs(probes.heights).max() < 1e-6
    flat = np.zeros((16, 16, 3), np.float32)
    flat[..., 2] = 1.0
    # A flat map shows the shading normals of the low-poly mesh, which are the truth here.
    assert probes.normal_errors(flat).max() < 1e-3
    assert probes.height_errors(np.zeros((16, 16, 1), np.float32)).max() < 1e-6


def test_angles_are_exact_where_a_dot_product_is_not():
    small = 1e-6
    vectors = np.array([[math.sin(small), 0.0, math.cos(small)], [0.0, 0.0, -3.0]])
    up = np.array([[0.0, 0.0, 1.0]] * 2)
    assert angles_deg(vectors, up) == pytest.approx([math.degrees(small), 180.0], rel=1e-9)


def test_slopes_of_the_waves_are_their_differences():
    x, y = texel_grid(64)
    step = 1e-6
    along, up = wave_slopes(x, y)
    assert along == pytest.approx(
        (wave_heights(x + step, y) - wave_heights(x - step, y)) / (2 * step), abs=1e-7
    )
    assert up == pytest.approx(
        (wave_heights(x, y + step) - wave_heights(x, y - step)) / (2 * step), abs=1e-7
    )
    assert np.linalg.norm(wave_normals(x, y), axis=-1) == pytest.approx(1.0)
    assert wave_heights(x + 1.0, y - 2.0) == pytest.approx(wave_heights(x, y), abs=1e-12)
    assert y[0, 0] > y[-1, 0]


def test_changes_on_the_floor_are_differences_of_its_coordinates():
    floor = Floor(width=40, height=30)
    step = 1e-5
    to_right = (floor.uvs(right=step) - floor.uvs(right=-step)) / (2 * step)
    to_below = (floor.uvs(down=step) - floor.uvs(down=-step)) / (2 * step)
    exact = np.concatenate([to_right, to_below], axis=1)
    assert floor.changes() == pytest.approx(exact, rel=1e-4, abs=1e-7)


def test_rays_of_sight_meet_a_ball_on_it():
    camera = Floor(width=64, height=48).camera
    rays = sight_rays(camera, 64, 48)
    assert rays @ -camera.axes[2] == pytest.approx(1.0)
    middle = camera.eye - 2.0 * camera.axes[2]
    points, cosines = ball_points(camera, rays, middle, 0.4)
    seen = cosines > 0.0
    assert 0.05 < seen.mean() < 0.5
    assert np.linalg.norm(points[seen] - middle, axis=-1) == pytest.approx(0.4)
    assert cosines.max() == pytest.approx(1.0, abs=3e-3)  # half a pixel beside the middle


def test_picture_error_is_in_steps_of_a_screen():
    black = np.zeros((4, 4, 3), np.float32)
    gray = np.full((4, 4, 4), decode_srgb(10.0 / 255.0), np.float32)
    assert picture_error(black, gray) == pytest.approx(10.0, rel=1e-4)
    where = np.zeros((4, 4), bool)
    where[0] = True
    gray[1:] = 1.0
    assert picture_error(black, gray, where) == pytest.approx(10.0, rel=1e-4)


def test_mean_normals_are_those_of_all_rays_together():
    """A roof over a plane, its ridge inside a column of texels: sines and cosines in proportion."""
    size, share, slope = 32, 0.3, 0.1
    at = -1.0 + 2.0 * (20 + share) / size
    x, y = np.meshgrid([-1.0, at, 1.0], [-1.0, 1.0])
    positions = np.column_stack([x.ravel(), y.ravel(), slope * (np.maximum(x - at, 0.0)).ravel()])
    high = Mesh(positions=positions, faces=[[0, 1, 4], [0, 4, 3], [2, 5, 1], [5, 4, 1]])
    high = high.replace(
        normals=[[0.0, 0.0, 1.0], [-math.sqrt(0.5), 0.0, math.sqrt(0.5)]],
        normal_faces=[[0] * 3] * 2 + [[1] * 3] * 2,
    )
    low = plane()
    unit = 2.0 * (low.positions[:, :2] - low.bounds[0][:2]) / np.ptp(low.bounds, axis=0)[:2] - 1.0
    low = low.replace(positions=np.column_stack([unit, np.zeros(len(unit))]))
    means, known = mean_normals(StudyPair(high, low, ""), size)
    assert known.all()
    assert N_RAYS == 16**2
    # Of 16 columns of rays 5 lie before the ridge, at 0.3 of the texel.
    beyond = 11.0 / 16.0
    mean = np.array([-beyond * math.sqrt(0.5), 0.0, 1.0 - beyond + beyond * math.sqrt(0.5)])
    mean /= np.linalg.norm(mean)
    expected = np.broadcast_to([0.0, 0.0, 1.0], means.shape).copy()
    expected[:, 20] = mean
    expected[:, 21:] = [-math.sqrt(0.5), 0.0, math.sqrt(0.5)]
    assert means == pytest.approx(expected, abs=1e-6)  # float32 normals


def test_texels_that_are_covered_in_part_have_a_mean_too():
    low = plane()
    low = low.replace(uvs=0.5 + 0.37 * (low.uvs - 0.5))
    _, known = mean_normals(StudyPair(low, low, ""), 16)
    inside = 0.37 * 16
    assert inside**2 < known.sum() == math.ceil(inside / 2.0) ** 2 * 4
