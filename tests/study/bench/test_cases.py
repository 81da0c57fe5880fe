"""Made cases are what their closed forms say."""

import hashlib
from functools import cache

import numpy as np
import pytest

from texbake import Mesh, distortion, read_mesh
from texbake.errors import MeshError
from texbake.mesh.frame import LocalFrame
from texbake.mesh.normals import face_normals
from texbake.mesh.shapes import plane, uv_sphere
from texbake.mesh.topology import find_edges, genus
from texbake.mesh.weld import weld_rows
from texbake.raycast.rays import Rays
from texbake.raycast.scene import RayScene
from texbake.study.bench.cases import made_case, own_case, pair_files
from texbake.study.options import CASE_NAMES
from texbake.study.truth.surfaces import ImplicitSurface

BYTES = {
    "sphere": "f06d8271c7006b36", "displaced-sphere": "9bcbf02d81f010c0",
    "orange": "3b044cb587263aea", "gyroid": "9b059c65a3229e06", "hard-edges": "2887c4f796d5f0ad",
    "terrain": "f376bedf0198d0b5", "thin-shells": "87108476a08f6775",
    "mirrored-uvs": "e4e7af2019e7a3c2", "two-parts": "60eaf9cbb4e0c8ae",
}  # fmt: skip
# Whose low-poly mesh has an atlas without overlaps.
FLAT = tuple(name for name in CASE_NAMES if name != "mirrored-uvs")


@cache
def made(name, count=8000):
    return made_case(name, count)


@pytest.fixture(params=CASE_NAMES)
def case(request):
    return made(request.param)


def test_the_high_poly_mesh_lies_on_its_surface(case):
    assert np.abs(case.surface.value(case.high.positions)).max() < 1e-6  # float32
    assert 7000 < case.high.n_faces < 9000 or case.name == "gyroid"
    middles = case.high.positions[case.high.faces].mean(axis=1)
    facing = np.einsum("ij,ij->i", face_normals(case.high), case.surface.normals(middles))
    # So few triangles show the pores of an orange and the tunnels of a bone badly.
    assert np.quantile(facing, 0.05) > (0.5 if case.name == "gyroid" else 0.85)
    assert facing.min() > 0.8 or case.name == "gyroid"


@pytest.mark.parametrize("name", FLAT)
def test_the_low_poly_mesh_has_an_atlas_of_its_own(name):
    low = made(name).low
    found = distortion(low, 512)
    assert found.n_mirrored == found.n_overlapping == found.n_collapsed == 0
    assert low.uvs.min() >= 0.0 and low.uvs.max() <= 1.0
    assert low.n_faces < 2000


def test_mirrored_halves_and_stacked_balls_share_their_texture_coordinates():
    low = made("mirrored-uvs").low
    corners = low.corner_uvs()
    quarter = low.n_faces // 4
    for part in range(1, 4):
        other = corners[part * quarter : (part + 1) * quarter]
        assert np.array_equal(corners[:quarter], other[:, ::-1] if part % 2 else other)
    assert distortion(low, 512).n_mirrored == 2 * quarter
    # The seam between the halves is one line of vertices, so that all programs shade it smoothly.
    assert len(np.unique(low.positions, axis=0)) == len(low.positions)


def test_the_surface_lies_within_reach_of_the_low_poly_mesh(case):
    probes = case.probes(2000)
    share = len(probes.faces) / 2000
    if case.name == "gyroid":
        assert 0.3 < share < 0.9  # tunnels
    elif case.name == "terrain":
        assert share == pytest.approx(1.0 / 1.06**2, abs=0.01)  # the low-poly mesh goes beyond it
    else:
        assert share == 1.0 and np.abs(probes.heights).max() < case.reach


@pytest.mark.parametrize("name", [*FLAT, "mirrored-uvs"])
def test_what_rays_meet_is_the_formula_and_the_mesh(name):
    """Rays at the mesh, cast by texbake, meet the same points: the march has lost no crossing."""
    case = made(name, 120_000)
    probes = case.probes(1500)
    points = probes.points + probes.heights[:, None] * probes.outward
    assert np.abs(case.surface.value(points)).max() < 1e-8
    frame = LocalFrame.around(case.high, case.low)
    starts = frame.to_local(probes.points + case.reach * probes.outward)
    n = len(starts)
    lengths = np.full(n, 2.0 * case.reach * frame.scale)
    rays = Rays(starts, np.ascontiguousarray(-probes.outward), lengths, np.zeros(n))
    hits = RayScene.build(case.high, frame).cast(rays)
    apart = hits.distances / frame.scale - (case.reach - probes.heights)
    # So far the triangles are from the formula; at the rim of a tunnel one may hit, the other not.
    is_near = (hits.faces >= 0) & (np.abs(apart) < 0.005)
    assert is_near.mean() > (0.85 if name == "gyroid" else 0.998)


def test_a_bone_has_a_tunnel_for_each_part_of_its_lattice():
    mesh = made("gyroid", 60_000).high
    edges = find_edges(mesh.faces)
    assert edges.closed
    # Four for each of its cells, but for those that the ball cuts.
    cells = 60_000 / 1500
    assert 2.0 * cells < genus(mesh.faces, edges, len(mesh.positions)) < 5.0 * cells
    assert 40_000 < mesh.n_faces < 80_000


def test_hard_edges_are_in_the_file(tmp_path):
    case = made("hard-edges")
    high = read_mesh(pair_files(case, tmp_path)["high"])
    assert len(np.unique(np.round(high.normals, 5) + 0.0, axis=0)) == 26
    assert find_edges(weld_rows(high.positions)[high.faces]).closed
    faced = np.einsum("ij,ij->i", face_normals(high), high.normals[high.normal_faces[:, 0]])
    assert faced.min() > 0.99999


@pytest.mark.parametrize("name", CASE_NAMES)
def test_cases_have_the_same_bytes_everywhere(name):
    """Recorded once; the formulas use nothing that rounds as the processor likes."""
    case = made_case(name, 2000)
    digest = hashlib.sha256()
    for mesh in case.high, case.low:
        digest.update(mesh.positions.astype("<f4").tobytes() + mesh.faces.astype("<i4").tobytes())
    digest.update(case.low.uvs.astype("<f8").tobytes())
    assert digest.hexdigest()[:16] == BYTES[name]


def test_any_number_of_triangles_can_be_unwrapped(case):
    for count in (500, 2000):
        mesh = case.build(count)
        assert mesh.uvs is None and 0.5 * count < mesh.n_faces < 4.0 * count


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
    assert case.surface is None and 0.05 < case.reach < 0.3
    flat = Mesh(positions=np.zeros((3, 3)), faces=np.array([[0, 1, 2]]), name="flat")
    with pytest.raises(MeshError, match="flat: no face has an area"):
        own_case(plane(), flat)
