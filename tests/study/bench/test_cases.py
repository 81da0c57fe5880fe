"""Made cases are what their closed forms say."""

import numpy as np
import pytest

from texbake.errors import MeshError
from texbake.mapping.distortion import distortion
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import face_normals
from texbake.mesh.shapes import plane, uv_sphere
from texbake.study.bench.cases import made_case, own_case
from texbake.study.options import CASE_NAMES
from texbake.study.truth.surfaces import ImplicitSurface


@pytest.fixture(scope="module", params=CASE_NAMES)
def case(request):
    return made_case(request.param, 8000)


def test_the_high_poly_mesh_lies_on_its_surface(case):
    assert np.abs(case.surface.value(case.high.positions)).max() < 1e-6  # float32
    assert 7000 < case.high.n_faces < 9000
    middles = case.high.positions[case.high.faces].mean(axis=1)
    facing = np.einsum("ij,ij->i", face_normals(case.high), case.surface.normals(middles))
    assert facing.min() > 0.9


def test_the_low_poly_mesh_has_an_atlas_of_its_own(case):
    found = distortion(case.low, 512)
    assert found.n_mirrored == found.n_overlapping == found.n_collapsed == 0
    assert case.low.uvs.min() >= 0.0 and case.low.uvs.max() <= 1.0
    assert case.low.n_faces < 2000


def test_the_surface_lies_within_reach_of_the_low_poly_mesh(case):
    corners = case.low.positions[case.low.faces]
    middles = corners.mean(axis=1)
    normals = face_normals(case.low)
    hits, found = case.surface.hits(middles, normals)
    assert found.all()
    assert np.linalg.norm(hits - middles, axis=1).max() < case.reach


def test_any_number_of_triangles_can_be_unwrapped(case):
    for count in (500, 2000):
        mesh = case.build(count)
        assert mesh.uvs is None and 0.6 * count < mesh.n_faces < 1.6 * count


def test_ambient_light_under_a_ball_is_the_cosine_weighted_share_of_the_sky():
    """Against directions of the hemisphere, tested one by one."""
    case = made_case("two-parts", 4000)
    rng = np.random.default_rng(3)
    u, angle = rng.random(400_000), 2.0 * np.pi * rng.random(400_000)
    r = np.sqrt(u)  # the density of the cosine
    out = np.stack([r * np.cos(angle), r * np.sin(angle), np.sqrt(1.0 - u)], axis=1)
    middle = np.array([0.0, 0.0, 0.58])
    for x in (0.0, 0.3, 1.2):
        point = np.array([[x, 0.1, 0.0]])
        along = (middle - point) @ out.T
        away = np.square(middle - point).sum() - along**2
        seen = 1.0 - ((away < 0.25) & (along > 0.0)).mean()
        assert case.openness(point)[0] == pytest.approx(seen, abs=4e-3)


def test_lines_meet_an_implicit_surface():
    surface = ImplicitSurface(lambda p: np.linalg.norm(p, axis=1) - 2.0)
    starts = np.array([[0.0, 0.0, 1.98], [1.0, 0.0, 1.75], [0.0, 2.1, 0.0]])
    directions = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    points, found = surface.hits(starts, directions)
    assert found.tolist() == [True, True, False]  # the last passes by
    np.testing.assert_allclose(points[0], [0.0, 0.0, 2.0], atol=1e-12)
    np.testing.assert_allclose(points[1], [1.0, 0.0, np.sqrt(3.0)], atol=1e-12)
    np.testing.assert_allclose(surface.normals(points[:2]), points[:2] / 2.0, atol=1e-9)


def test_own_meshes_lose_their_normals_and_get_texture_coordinates():
    ball = uv_sphere(8, 8)
    normals = ball.positions / np.linalg.norm(ball.positions, axis=1, keepdims=True)
    low = ball.replace(uvs=None, uv_faces=None, normals=-normals, normal_faces=ball.faces)
    case = own_case(uv_sphere(24, 24), low)
    assert case.low.normals is None and case.low.uvs is not None
    assert case.surface is None
    assert 0.05 < case.reach < 0.3
    flat = Mesh(positions=np.zeros((3, 3)), faces=np.array([[0, 1, 2]]), name="flat")
    with pytest.raises(MeshError, match="flat: none of its 1 faces has an area"):
        own_case(plane(), flat)
