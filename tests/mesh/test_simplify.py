"""Simplified meshes: face counts, preserved attributes, and distances to the original."""

import math

import numpy as np
import pytest

from tests.mesh.test_shapes import open_edges, signed_volume
from tests.models import BROKEN, HAS_REAL, joined, level_surface, model, moved, real, soup_of
from texbake.core import portable_math as pm
from texbake.errors import MeshError, OptionError
from texbake.mesh.compose import excerpt, join_meshes
from texbake.mesh.decimate import gather, shading_length, weld_corners
from texbake.mesh.distance import surface_distance
from texbake.mesh.hard_edges import (
    has_hard_edges,
    inner_edges,
    is_flat_shaded,
    normals_jump,
    with_normals,
)
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import face_normals
from texbake.mesh.objects import face_objects, joined_objects, object_names
from texbake.mesh.options import QUALITIES
from texbake.mesh.parametric.make import make
from texbake.mesh.piecewise import bring_down
from texbake.mesh.reduction import APART, CUT
from texbake.mesh.shapes import cube, grid_sphere, icosphere, orange, plane, uv_sphere
from texbake.mesh.simplify import Trial, search_fewest, simplify, simplify_with_report
from texbake.mesh.topology import face_components, find_edges, genus
from texbake.mesh.triangle_tree import TriangleTree, with_source_hard_edges, with_source_normals

BOTH = pytest.mark.parametrize("quality", QUALITIES)


def divided(mesh, times):
    """Mesh with four triangles for each, again and again."""
    for _ in range(times):
        corners = mesh.positions[mesh.faces]
        middles = (corners + np.roll(corners, -1, axis=1)) / 2.0
        near = [np.stack([corners[:, i], middles[:, i], middles[:, i - 1]], 1) for i in range(3)]
        rows = np.concatenate([*near, middles]).reshape(-1, 3)
        positions, ids = np.unique(rows, axis=0, return_inverse=True)
        mesh = Mesh(positions=positions, faces=ids.reshape(-1, 3))
    return mesh


def rows(array):
    return {row.tobytes() for row in np.ascontiguousarray(array)}


def assert_clean(mesh):
    """No vertex unused, no face degenerate or twice."""
    assert np.array_equal(np.unique(mesh.faces), np.arange(mesh.n_vertices))
    a, b, c = mesh.faces.T
    assert not ((a == b) | (b == c) | (c == a)).any()
    turned = [np.roll(face, -int(face.argmin())) for face in mesh.faces]
    assert len(rows(turned)) == mesh.n_faces


def assert_same(a, b):
    fields = ("positions", "faces", "uvs", "uv_faces", "normals", "normal_faces", "face_groups")
    for field in (*fields, "colors"):
        left, right = getattr(a, field), getattr(b, field)
        assert (left is None) == (right is None)
        assert left is None or left.tobytes() == right.tobytes()


@BOTH
@pytest.mark.parametrize("n_faces", [4, 501])
def test_closed_meshes_reach_the_count_and_stay_closed(n_faces, quality):
    mesh = orange(6_000)
    low, report = simplify_with_report(mesh, n_faces, quality=quality)
    # Edges of a closed surface collapse two faces at a time.
    assert n_faces - 1 <= low.n_faces <= n_faces
    assert report.reached
    assert report.notes == ()
    assert_clean(low)
    assert not open_edges(low)
    assert signed_volume(low) > 0.0


def noise_surface(n, seed):
    """Surface of random blobs with tunnels and cavities, closed within a grid of n cells a side."""
    rng = np.random.default_rng(seed)
    field = rng.normal(size=(n, n, n))
    for axis in range(3):
        for _ in range(3):
            field = field + np.roll(field, 1, axis)
    field /= field.std()
    for axis in range(3):
        np.moveaxis(field, axis, 0)[[0, -1]] = 3.0
    return level_surface(field, 0.3)


def topology(mesh):
    """Parts and genus; checks that the mesh is a closed and oriented surface."""
    edges = find_edges(mesh.faces)
    assert edges.closed
    assert not edges.misoriented.any()
    n_parts = face_components(mesh.faces, mesh.n_vertices)[1]
    holes = genus(mesh.faces, edges, mesh.n_vertices)
    assert holes is not None, "two fans of faces touch at a vertex"
    return n_parts, holes


@BOTH
@pytest.mark.parametrize("seed", range(3))
def test_a_closed_surface_keeps_its_topology(seed, quality):
    mesh = noise_surface(24, seed)
    given = topology(mesh)
    assert given[1] > 0
    for share in (0.7, 0.4):
        low = simplify(mesh, round(share * mesh.n_faces), quality=quality)
        assert low.n_faces <= share * mesh.n_faces + 1
        assert_clean(low)
        assert topology(low) == given


@BOTH
def test_a_surface_stays_one_where_it_cannot_come_down(quality):
    mesh = noise_surface(24, 0)
    low, report = simplify_with_report(mesh, 10, quality=quality)
    assert not report.reached
    assert report.notes[-1] == (
        f"the topology does not allow fewer than {low.n_faces} faces: holes and tunnels stay"
    )
    assert 10 < low.n_faces < 0.2 * mesh.n_faces
    assert_clean(low)
    assert topology(low)[1] > 0


def test_a_large_mesh_in_pieces_keeps_its_topology_and_does_not_depend_on_threads():
    mesh = noise_surface(64, 0)
    assert mesh.n_faces > 2 * 62_500
    given = topology(mesh)
    stream = weld_corners(mesh)
    few, more = (bring_down(stream, 4, threads=threads) for threads in (1, 3))
    assert few.faces.tobytes() == more.faces.tobytes()
    assert few.points.tobytes() == more.points.tobytes()
    low = gather(mesh, few, few.faces)
    assert low.n_faces < 0.6 * mesh.n_faces
    assert topology(low) == given
    assert rows(low.positions) <= rows(mesh.positions)


def test_pieces_keep_seams_and_lose_next_to_nothing():
    mesh = uv_sphere(300, 400)
    stream = bring_down(weld_corners(mesh), 4)
    low = gather(mesh, stream, stream.faces)
    assert 12_500 <= low.n_faces <= 70_000
    assert rows(np.unique(low.uvs, axis=0)) <= rows(mesh.uvs)
    corners, uvs = low.positions[low.faces], low.corner_uvs()
    assert np.cos(np.pi * (1.0 - uvs[..., 1])) == pytest.approx(corners[..., 2], abs=1e-12)
    # No face reaches across the seam.
    assert (np.ptp(uvs[..., 0], axis=1) < 0.5).mean() > 0.99
    assert surface_distance(mesh, low, n_samples=20_000).rms_relative < 1e-4


@BOTH
def test_a_mesh_with_no_more_faces_is_returned_itself(quality):
    mesh = cube()
    low, report = simplify_with_report(mesh, 12, quality=quality)
    assert low is mesh
    assert report.method == "unchanged"
    assert report.distance.max == 0.0


@BOTH
@pytest.mark.parametrize("is_hard", [False, True])
def test_flat_parts_cost_nothing_and_hard_edges_keep_their_normals(is_hard, quality):
    # A finely cut box comes down to its 12 triangles and loses nothing.
    box = divided(cube(), 3)
    box = with_normals(box, "angle") if is_hard else box
    low, report = simplify_with_report(box, 12, quality=quality)
    assert low.n_faces == 12
    assert report.distance.max < 1e-6
    assert not open_edges(low)
    assert signed_volume(low) == pytest.approx(1.0, abs=1e-5)
    if is_hard:
        sides = np.repeat(face_normals(low)[:, None], 3, axis=1)
        np.testing.assert_allclose(low.normals[low.normal_faces], sides, atol=1e-6)


@BOTH
def test_a_short_boundary_stays_where_it_is(quality):
    sheet = plane(10, 10, lambda x, y: 0.1 * np.sin(6.0 * x) * np.cos(5.0 * y))
    sheet = sheet.replace(uvs=None, uv_faces=None)
    low = simplify(sheet, 160, quality=quality)  # the boundary has 40 edges
    assert low.n_faces <= 160

    def boundary(mesh):
        return rows(mesh.positions[np.unique(list(open_edges(mesh)))])

    if quality == "fast":
        assert boundary(low) == boundary(sheet)
    assert len(boundary(low)) == 40


@BOTH
def test_a_long_boundary_keeps_its_shape(quality):
    mesh = grid_sphere(100, 200, pole_margin=0.6)
    low, report = simplify_with_report(mesh, 300, quality=quality)
    assert low.n_faces <= 300
    edge = low.positions[np.unique(list(open_edges(low)))]
    # Rings at z = ± cos 0.6; the sag of 300 triangles on a unit sphere is about 0.02.
    assert np.abs(np.abs(edge[:, 2]) - np.cos(0.6)).max() < 0.02
    assert report.distance.max_relative < 0.02


@BOTH
def test_texture_coordinates_and_their_seam_are_kept(quality):
    mesh = uv_sphere(40, 80)
    low, report = simplify_with_report(mesh, 600, quality=quality)
    assert 570 < low.n_faces <= 600
    assert low.uvs is not None
    assert report.notes == ()
    corners = low.positions[low.faces]
    uvs = low.corner_uvs()
    # Every corner has the longitude and latitude of its place; the pole has any longitude. What has
    # moved is off by what a facet of the sphere, and later one of the result, differs from it.
    close = 1e-12 if quality == "fast" else 0.02
    heights = corners[..., 2] / np.linalg.norm(corners, axis=-1)
    assert np.cos(np.pi * (1.0 - uvs[..., 1])) == pytest.approx(heights, abs=close)
    off_pole = np.abs(heights) < (0.999 if quality == "fast" else 0.95)
    turns = np.arctan2(corners[..., 1], corners[..., 0]) / (2.0 * np.pi) - uvs[..., 0]
    assert np.abs(turns - np.round(turns))[off_pole].max() < close
    # And no triangle runs backwards across the seam.
    a, b, c = np.moveaxis(uvs, 1, 0)
    assert (np.linalg.det(np.stack([b - a, c - a], axis=1)) > 0.0).mean() > 0.98


def test_moved_vertices_come_closer_with_seams_and_flip_no_face_in_texture_space():
    mesh = uv_sphere(40, 80)
    for n_faces in (600, 120):
        fast = simplify_with_report(mesh, n_faces)[1]
        low, report = simplify_with_report(mesh, n_faces, quality="best")
        assert report.method == "moved vertices"
        assert report.distance.rms < 0.6 * fast.distance.rms
        a, b, c = np.moveaxis(low.corner_uvs(), 1, 0)
        assert (np.linalg.det(np.stack([b - a, c - a], axis=1)) > -1e-12).all()


def test_moved_vertices_share_what_their_sides_shared():
    """A barrel with a hard rim, where its texture goes on."""
    barrel = make("cylinder", resolution=(48, 12), caps=True)
    x, y, z = barrel.positions.T
    mesh = Mesh(
        positions=np.stack([(1.3 - 0.3 * y**2) * x, y, (1.3 - 0.3 * y**2) * z], axis=1),
        faces=barrel.faces,
        uvs=np.stack([x, z], axis=1) * (2.0 + y[:, None]) / 6.0,
        uv_faces=barrel.faces,
    )
    low, report = simplify_with_report(with_normals(mesh, "angle"), 300, quality="best")
    assert (report.method, report.notes) == ("moved vertices", ())

    def n_pairs(ids):
        return len(np.unique(np.stack([low.faces.ravel(), ids.ravel()]), axis=1).T)

    # Without a seam in the texture there is one coordinate for a place; normals differ at the rim.
    assert n_pairs(low.uv_faces) == low.n_vertices < n_pairs(low.normal_faces)
    assert np.linalg.norm(low.normals, axis=1) == pytest.approx(1.0)
    at_top = (low.normals[low.normal_faces] @ [0.0, 1.0, 0.0] > 0.999).all(axis=1)
    assert 10 < at_top.sum() < low.n_faces
    assert np.ptp(low.positions[low.faces[at_top]][..., 1]) == pytest.approx(0.0, abs=1e-3)


@BOTH
def test_the_rim_of_a_thin_plate_does_not_recede(quality):
    size = np.array([10.0, 10.0, 0.01])
    sphere = grid_sphere(120, 240)
    # A sphere pressed flat: its rim is narrow, and what recedes there costs next to no area.
    plate = sphere.replace(positions=sphere.positions * size)
    low = simplify(plate, 400, quality=quality)
    assert np.ptp(low.positions, axis=0)[:2] == pytest.approx(2.0 * size[:2], rel=0.01)
    a, b, c = np.moveaxis(low.positions[low.faces], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0
    assert area == pytest.approx(2.0 * np.pi * 100.0, rel=0.02)


@BOTH
def test_thin_spikes_stay_to_their_tips(quality):
    ball = icosphere(6)
    axes = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.6, 0.0, 0.8]])
    # Cones of half the radius in height; their areas are too small to count in a sum of errors.
    heights = np.clip(1.0 - (1.0 - ball.positions @ axes.T) / 0.004, 0.0, 1.0).sum(axis=1)
    mesh = ball.replace(positions=ball.positions * (1.0 + 0.5 * heights)[:, None])
    low, report = simplify_with_report(mesh, 100, quality=quality)
    assert (low.positions @ axes.T).max(axis=0) == pytest.approx([1.5] * 3, abs=0.06)
    assert report.distance.max_relative < 0.06


@BOTH
def test_seams_are_kept_or_dropped_as_asked(quality):
    # Every face its own island in texture space: no edge is free to collapse.
    mesh = icosphere(4)
    uvs = np.random.default_rng(1).uniform(size=(3 * mesh.n_faces, 2))
    mesh = mesh.replace(uvs=uvs, uv_faces=np.arange(3 * mesh.n_faces).reshape(-1, 3))
    auto, of_auto = simplify_with_report(mesh, 100, quality=quality)
    assert auto.n_faces == 100 and auto.uvs is None
    assert of_auto.notes == ("too few faces to keep the texture coordinates",)
    kept, of_kept = simplify_with_report(mesh, 100, quality=quality, seams="keep")
    assert kept.uvs is not None and kept.n_faces > 100 and not of_kept.reached
    assert of_kept.notes == (
        f"texture coordinates and topology do not allow fewer than {kept.n_faces} faces",
    )
    dropped, of_dropped = simplify_with_report(mesh, 2000, quality=quality, seams="drop")
    assert dropped.n_faces == 2000 and dropped.uvs is None and of_dropped.notes == ()
    with pytest.raises(OptionError, match="auto, keep, drop"):
        simplify(mesh, 100, seams="none")


@pytest.mark.parametrize("radius", [0.1, 0.2, 0.3])
def test_texture_coordinates_go_before_parts(radius):
    # Each face of the small balls is its own island: they could only stay or go.
    ball, small = icosphere(4), icosphere(2)
    ball = ball.replace(uvs=ball.positions[:, :2].copy(), uv_faces=ball.faces)
    islands = np.arange(3 * small.n_faces, dtype=np.int32).reshape(-1, 3)
    uvs = np.random.default_rng(1).uniform(size=(islands.size, 2))
    places = np.random.default_rng(2).normal(size=(12, 3))
    places *= 1.2 / np.linalg.norm(places, axis=1)[:, None]
    balls = (
        small.replace(positions=radius * small.positions + place, uvs=uvs, uv_faces=islands)
        for place in places
    )
    low, report = simplify_with_report(join_meshes([ball, *balls]), 300)
    assert report.notes == ("too few faces to keep the texture coordinates",)
    assert face_components(low.faces, low.n_vertices)[1] == 13


@pytest.mark.parametrize("seams", ["auto", "keep"])
def test_kept_texture_coordinates_outlive_hard_edges(seams):
    mesh = icosphere(3)
    # A flat normal for every other face, on a surface that is not flat-shaded as a whole.
    corners = np.where((np.arange(mesh.n_faces) % 2 == 0)[:, None], mesh.faces[:, :1], mesh.faces)
    mesh = mesh.replace(
        normals=mesh.positions, normal_faces=corners, uvs=mesh.positions[:, :2], uv_faces=mesh.faces
    )
    low, report = simplify_with_report(mesh, 100, seams=seams)
    assert (low.n_faces, low.normals) == (100, None)
    assert low.uvs is not None
    assert report.notes == ("too few faces to keep the hard edges",)


@pytest.mark.parametrize(
    ("n_charts", "n_faces", "seams", "is_kept"),
    [(200, 700, "auto", False), (200, 700, "keep", True), (100, 600, "auto", True)],
)
def test_texture_coordinates_go_where_their_seams_flatten_the_surface(
    n_charts, n_faces, seams, is_kept
):
    """Small charts at one pole of a ball take nearly all vertices."""
    ball = icosphere(5)
    heights = 1.0 - 0.3 * (np.arange(n_charts) + 0.5) / n_charts
    angles = np.arange(n_charts) * math.pi * (3.0 - math.sqrt(5.0))
    around = np.stack([np.cos(angles), np.sin(angles)]) * np.sqrt(1.0 - heights**2)
    centers = ball.positions[ball.faces].mean(axis=1)
    charts = (centers @ np.vstack([around, heights])).argmax(axis=1) + 1
    charts[centers[:, 2] < 0.68] = 0
    corners = np.stack([ball.faces, np.repeat(charts[:, None], 3, axis=1)], axis=-1).reshape(-1, 2)
    rows, uv_faces = np.unique(corners, axis=0, return_inverse=True)
    uvs = 0.5 * ball.positions[rows[:, 0], :2] + rows[:, 1:]
    mesh = ball.replace(uvs=uvs, uv_faces=uv_faces.reshape(-1, 3).astype(np.int32))
    low, report = simplify_with_report(mesh, n_faces, seams=seams, quality="fast")
    assert low.n_faces == n_faces
    assert (low.uvs is not None) == is_kept
    assert report.notes == (() if is_kept else ("too few faces to keep the texture coordinates",))
    if seams == "auto":
        assert report.distance.rms < 0.005 * mesh.diagonal


@pytest.mark.parametrize("seams", ["auto", "drop"])
@pytest.mark.parametrize(("n_faces", "is_hard"), [(200, False), (800, True)])
def test_hard_edges_go_where_they_take_the_vertices_from_the_surface(seams, n_faces, is_hard):
    ball = icosphere(5)
    cells = np.random.default_rng(4).normal(size=(50, 3))
    cells /= np.linalg.norm(cells, axis=1)[:, None]
    cell = (ball.positions[ball.faces].mean(axis=1) @ cells.T).argmax(axis=1)
    corners = np.stack([ball.faces, np.repeat(cell[:, None], 3, axis=1)], axis=-1).reshape(-1, 2)
    rows, normal_faces = np.unique(corners, axis=0, return_inverse=True)
    smooth = ball.replace(uvs=ball.positions[:, :2], uv_faces=ball.faces)
    mesh = smooth.replace(
        normals=ball.positions[rows[:, 0]] + 0.3 * cells[rows[:, 1]],
        normal_faces=normal_faces.reshape(-1, 3),
    )
    low, report = simplify_with_report(mesh, n_faces, seams=seams)
    assert low.n_faces == n_faces
    assert (low.normals is not None, low.uvs is not None) == (is_hard, seams == "auto")
    assert report.notes == (() if is_hard else ("too few faces to keep the hard edges",))
    of_smooth = simplify_with_report(smooth, n_faces, seams=seams)[1].distance
    assert of_smooth.rms <= report.distance.rms < 1.6 * of_smooth.rms


@BOTH
def test_groups_and_colors_follow(quality):
    mesh = icosphere(4)
    centers = mesh.positions[mesh.faces].mean(axis=1)
    mesh = mesh.replace(
        face_groups=(centers[:, 2] > 0.0).astype(int),
        group_names=("south", "north"),
        colors=0.5 + 0.5 * mesh.positions,
    )
    low = simplify(mesh, 400, quality=quality)
    assert low.group_names == ("south", "north")
    heights = low.positions[low.faces].mean(axis=1)[:, 2]
    # The border is a zigzag about z = 0 of the width of a triangle.
    assert np.array_equal(
        low.face_groups[np.abs(heights) > 0.1], heights[np.abs(heights) > 0.1] > 0
    )
    # float32, and for `best` the nearest point: a vertex may lie off the facets by their sag.
    assert low.colors == pytest.approx(0.5 + 0.5 * low.positions, abs=0.02)


def bent_panels(is_cut):
    """Two flat panels beside a narrow, winding bevel; with normals of their own if it is cut."""
    n = 96
    along, across = np.meshgrid(np.linspace(-1.0, 1.0, n + 1), np.linspace(-1.0, 1.0, n + 1))
    turn = np.clip((across - 0.1 * np.sin(6.0 * along)) / 0.06, -1.0, 1.0) * np.radians(15.0)
    slopes = np.tan(turn[1:]) + np.tan(turn[:-1])
    height = np.concatenate([np.zeros((1, n + 1)), -np.cumsum(slopes, axis=0) / n])
    positions = np.stack([along, across, height], axis=2).reshape(-1, 3)
    normals = np.stack([0.0 * turn, np.sin(turn), np.cos(turn)], axis=2).reshape(-1, 3)
    ids = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = (ids[i : n + i, j : n + j].ravel() for i, j in ((0, 0), (0, 1), (1, 1), (1, 0)))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    uvs = positions[:, :2] / 2.0 + 0.5
    rows = faces
    if is_cut:
        is_far = (positions[faces][..., 1].mean(axis=1) > 0.0)[:, np.newaxis]
        normals = np.concatenate([normals, normals + np.array([0.0, 0.1, 0.0])])
        rows = np.where(is_far, faces + len(positions), faces)
    return Mesh(
        positions=positions, faces=faces, normals=normals, normal_faces=rows, uvs=uvs,
        uv_faces=faces,
    )  # fmt: skip


@pytest.mark.parametrize("is_cut", [False, True])
def test_where_normals_count_a_bevel_keeps_its_edges(is_cut):
    mesh, off = bent_panels(is_cut), []
    wanted = mesh.normals[mesh.normal_faces].mean(axis=1)
    for shades in (0.0, shading_length(mesh)):
        low, _ = simplify_with_report(mesh, 100, quality="best", seams="keep", shades=shades)
        if shades:
            assert rows(low.normals) <= rows(mesh.normals)
        else:
            low = with_source_normals(low, mesh)
        tree = TriangleTree.build(low.positions, low.faces)
        _, nearest, weights = tree.closest_points(mesh.positions[mesh.faces].mean(axis=1))
        found = pm.vecmat(weights, low.normals[low.normal_faces[nearest]])
        off.append(np.linalg.norm(found - wanted, axis=1).mean())
    assert off[1] < 0.8 * off[0]


def test_smooth_normals_go_and_the_surface_gives_them_again():
    mesh = icosphere(4)
    mesh = mesh.replace(normals=mesh.positions, normal_faces=mesh.faces)
    assert simplify(mesh, 200).normals is None


BALL = icosphere(3)
REPEATED = BALL.replace(faces=np.concatenate([BALL.faces, BALL.faces[:50], [[0, 0, 1], [2, 2, 2]]]))


@BOTH
@pytest.mark.parametrize("mesh", [soup_of(BALL), REPEATED], ids=["soup", "repeated faces"])
def test_vertices_at_one_place_are_joined_and_repeated_faces_go(mesh, quality):
    low = simplify(mesh, 300, quality=quality)
    assert low.n_faces == 300
    assert_clean(low)
    assert not open_edges(low)


@BOTH
def test_vertices_that_differ_by_rounding_leave_no_crack(quality):
    ball = icosphere(4)
    x = ball.positions[ball.faces, 0].mean(axis=1)
    halves = [excerpt(ball, x < 0.0), excerpt(ball, x >= 0.0)]
    halves[1] = halves[1].replace(positions=halves[1].positions * (1.0 + 1e-15))
    low = simplify(joined(*halves), 200, quality=quality)
    assert low.n_faces == 200 and not open_edges(low)


@BOTH
def test_where_parts_must_go_most_faces_are_left_to_the_large_ones(quality):
    places = np.random.default_rng(5).uniform(-2.0, 2.0, size=(200, 3))
    crumbs = (moved(icosphere(1), scale=0.01, by=place) for place in places)
    mesh = joined(icosphere(4), *crumbs)
    low, report = simplify_with_report(mesh, 400, quality=quality)
    parts, n_parts = face_components(low.faces, low.n_vertices)
    assert report.notes == (f"{201 - n_parts} of 201 separate parts were dropped",)
    assert 396 <= low.n_faces <= 400
    # The crumbs could take up all faces, as tetrahedra.
    assert np.bincount(parts).max() >= 300


@BOTH
@pytest.mark.parametrize("mesh", [icosphere(4), plane(30, 30), orange(70_000)])
def test_the_winding_of_faces_changes_nothing_and_goes_with_them(mesh, quality):
    mesh = mesh.replace(uvs=None, uv_faces=None)
    turned = np.random.default_rng(3).uniform(size=mesh.n_faces) < 0.5
    mixed = mesh.replace(faces=np.where(turned[:, None], mesh.faces[:, [0, 2, 1]], mesh.faces))
    low, report = simplify_with_report(mixed, 300, quality=quality)
    assert report.notes == ()
    alike = simplify(mesh, 300, quality=quality)
    corners = [m.positions[m.faces].tolist() for m in (low, alike)]
    triangles = [{frozenset(map(tuple, face)) for face in faces} for faces in corners]
    assert triangles[0] == triangles[1]
    assert find_edges(low.faces).misoriented.any()


@BOTH
@pytest.mark.parametrize("seams", ["auto", "keep"])
def test_points_of_a_palette_stay(quality, seams):
    mesh = icosphere(4)
    is_upper = mesh.positions[mesh.faces, 2].mean(axis=1) > 0.0
    uv_faces = np.repeat(is_upper[:, None], 3, axis=1).astype(np.int32)
    mesh = mesh.replace(uvs=[[0.1, 0.1], [0.9, 0.1]], uv_faces=uv_faces)
    low, report = simplify_with_report(mesh, 300, quality=quality, seams=seams)
    assert low.n_faces == 300 and report.notes == ()
    assert np.array_equal(
        low.corner_uvs()[:, :, 0] > 0.5,
        np.repeat(low.positions[low.faces, 2].mean(axis=1, keepdims=True) > 0.0, 3, axis=1),
    )


@BOTH
def test_mirrored_texture_coordinates_change_sides_where_they_did(quality):
    hill = plane(40, 40, lambda x, y: 0.2 * np.sin(7.0 * x + 1.0) * np.cos(5.0 * y))
    x, y, _ = hill.positions.T
    uvs = np.stack([np.abs(x - 0.5), y], axis=1)
    low, report = simplify_with_report(
        hill.replace(uvs=uvs, uv_faces=hill.faces), 300, quality=quality
    )
    assert low.n_faces == 300 and report.notes == ()
    sides = low.positions[low.faces, 0] - 0.5
    assert (sides.min(axis=1) > -1e-3).sum() + (sides.max(axis=1) < 1e-3).sum() == low.n_faces


def test_simplified_meshes_get_the_hard_edges_of_their_source():
    tube = with_normals(make("cylinder", resolution=(64, 8), caps=True), "angle", angle=30.0)
    low = with_source_hard_edges(simplify(tube.replace(normals=None, normal_faces=None), 60), tube)
    one, other = inner_edges(low)
    heights = low.positions[low.faces][..., 1].mean(axis=1)
    is_cap = np.ptp(low.positions[low.faces][..., 1], axis=1) < 1e-9
    is_rim = is_cap[one // 3] != is_cap[other // 3]
    assert is_rim.sum() > 10 and np.ptp(heights) > 1.0
    assert np.array_equal(normals_jump(low, one, other), is_rim)
    ball = icosphere(1)
    assert not has_hard_edges(with_source_hard_edges(ball, icosphere(4)))


@BOTH
@pytest.mark.parametrize("n_materials", [1, 2])
@pytest.mark.parametrize("n_faces", [400, 36])
def test_objects_that_touch_stay_apart_with_their_names(quality, n_materials, n_faces):
    fine = divided(cube(), 3)
    bricks = join_meshes([moved(fine, by=(i, 0, 0)).replace(name=f"brick{i}") for i in range(3)])
    upper = (bricks.positions[bricks.faces].mean(axis=1)[:, 1] > 0) & (n_materials > 1)
    bricks = bricks.replace(
        face_groups=2 * bricks.face_groups + upper,
        group_names=tuple(f"{name}/{end}" for name in bricks.group_names for end in "ab"),
        group_objects=(0, 0, 1, 1, 2, 2),
    )
    low = simplify(bricks, n_faces, quality=quality)
    names = np.array(object_names(low))[low.face_groups]
    assert low.n_faces <= n_faces
    assert len(np.unique(low.face_groups)) == 3 * n_materials
    # The faces of each come in a row, for Blender reads a name that comes again as another object.
    assert np.count_nonzero(np.diff(low.face_groups)) == 3 * n_materials - 1
    for i in range(3):
        reach = low.positions[low.faces[names == f"brick{i}"]][..., 0]
        assert (
            np.abs([reach.min() - i + 0.5, reach.max() - i - 0.5]).max() < 1e-5
        )  # quadrics are solved approximately
    assert len(np.unique(face_objects(low))) == 3
    as_one = simplify(joined_objects(bricks), n_faces, quality=quality)
    # Where only corners are left, moved vertices of bricks that came apart stay apart.
    assert as_one.n_vertices < low.n_vertices + (quality == "best" and n_faces == 36)


@BOTH
def test_walls_between_cubes_come_apart(quality):
    # Every edge has four faces, and none collapses.
    places = np.stack(np.meshgrid(*3 * [np.arange(8.0)]), axis=-1).reshape(-1, 3)
    mesh = joined(*(moved(cube(), by=place) for place in places))
    low, report = simplify_with_report(mesh, 1000, quality=quality)
    assert 0 < low.n_faces <= 1000
    assert report.notes[0] == CUT and not report.is_whole
    assert report.distance.max < 2.0
    # Where no part may be dropped, nothing is cut either.
    kept, report = simplify_with_report(mesh, 1000, quality=quality, shades=shading_length(mesh))
    assert kept.n_faces > 1000 and CUT not in report.notes


@BOTH
@pytest.mark.parametrize(("n_faces", "note"), [(96, APART), (60, CUT)])
def test_surfaces_that_touch_stay_closed_and_get_no_new_bad_edges(n_faces, note, quality):
    bricks = [moved(divided(cube(), 3), by=(i + 50, -i, 0)) for i in range(8)]
    mesh = joined(*bricks, *(noise_surface(24, 0),) * (note == CUT))
    n_bad = np.count_nonzero(find_edges(weld_corners(mesh).faces).non_manifold)
    assert n_bad == 7 * 8
    low, report = simplify_with_report(mesh, n_faces, quality=quality)
    assert report.is_close_to_count and report.notes[0] == note
    assert [each.endswith("parts were dropped") for each in report.notes[1:]] == [True] * (
        note == CUT
    )
    assert report.is_whole == (note == APART)
    edges = find_edges(low.faces)
    assert not (edges.n_faces % 2).any() and (2 * edges.n_forward == edges.n_faces).all()
    assert np.count_nonzero(edges.non_manifold) <= n_bad


@pytest.mark.parametrize("n_faces", [28, 32])
def test_a_long_rod_outlives_small_bricks_where_parts_may_vanish(n_faces):
    bricks = [moved(divided(cube(), 3), by=(i, -i, 0)) for i in range(8)]
    rod = divided(cube(), 3)
    rod = rod.replace(positions=rod.positions * [30.0, 0.2, 0.2] + [0.0, 20.0, 0.0])
    low, report = simplify_with_report(joined(*bricks, rod), n_faces, quality="best")
    assert report.n_faces <= n_faces and report.notes[0] == CUT
    assert np.ptp(low.positions[low.positions[:, 1] > 15.0][:, 0]) > 29.0


@BOTH
def test_nothing_but_degenerate_faces_is_an_error(quality):
    mesh = Mesh(positions=np.eye(3), faces=[[0, 0, 1]] * 10)
    with pytest.raises(MeshError, match="three distinct corners"):
        simplify(mesh, 5, quality=quality)


def measured_anew(mesh, low):
    """Their distance at other and more points than `simplify` measured it at."""
    return surface_distance(mesh, low, n_samples=200_000, seed=7).max


@BOTH
def test_an_error_is_a_distance_that_no_point_exceeds(quality):
    mesh, share = orange(8_000), 0.004
    low, report = simplify_with_report(mesh, error=f"{100 * share}%", quality=quality)
    limit = share * mesh.diagonal
    assert report.error_asked == pytest.approx(limit)
    assert report.distance.max == surface_distance(mesh, low).max <= limit
    assert measured_anew(mesh, low) <= 1.01 * limit  # between the points of one measurement
    assert report.notes == ()
    # Close to as few as fit: the greatest distance goes up and down with the number of faces.
    assert low.n_faces < 0.9 * mesh.n_faces
    fewer = simplify(mesh, int(0.7 * low.n_faces), quality=quality)
    assert surface_distance(mesh, fewer).max > limit


def test_of_a_count_and_an_error_the_first_stops():
    mesh = orange(8_000)
    by_count, report = simplify_with_report(mesh, 3_000, error="1%")
    assert report.reached
    assert_same(by_count, simplify(mesh, 3_000))
    limit = 0.002 * mesh.diagonal
    by_error, report = simplify_with_report(mesh, 100, error=limit)
    assert not report.reached
    assert report.distance.max <= limit
    assert report.notes == (
        f"fewer than {by_error.n_faces} faces would lie further from it than allowed",
    )


def test_an_error_gives_up_neither_seams_nor_parts():
    # Every face its own island in texture space: no edge is free to collapse.
    mesh = icosphere(3)
    corner_ids = np.arange(3 * mesh.n_faces).reshape(-1, 3)
    uvs = np.random.default_rng(0).uniform(size=(3 * mesh.n_faces, 2))
    mesh = mesh.replace(uvs=uvs, uv_faces=corner_ids)
    low, report = simplify_with_report(mesh, error="50%")
    assert low is mesh
    assert report.method == "unchanged"


@BOTH
@pytest.mark.parametrize("name", ["crossing figures", *real("meshes/fish.obj")])
def test_crossing_parts_stay_within_an_error(name, quality):
    mesh = model(name)
    low, _ = simplify_with_report(mesh, error="0.5%", quality=quality)
    assert low.n_faces < mesh.n_faces
    assert measured_anew(mesh, low) <= 1.01 * 0.005 * mesh.diagonal


@BOTH
@pytest.mark.parametrize("name", [*BROKEN, *real("mikktspace/rancid_geometry.obj")])
def test_broken_meshes_are_simplified(name, quality):
    mesh = model(name)
    low, report = simplify_with_report(mesh, 500, quality=quality)
    assert 0 < low.n_faces <= 500
    assert report.reached
    assert np.isfinite(low.positions).all()
    assert_clean(low)
    if quality == "fast":
        assert rows(low.positions) <= rows(mesh.positions)


@pytest.mark.parametrize(
    ("name", "n_faces"), [("bumpy figure", 2000), *(("pairs/koala/high.obj", 7116),) * HAS_REAL]
)
def test_best_beats_fast(name, n_faces):
    mesh = model(name)
    rms = {}
    for quality in QUALITIES:
        low = simplify(mesh, n_faces, quality=quality)
        assert low.n_faces == n_faces
        rms[quality] = surface_distance(mesh, low, n_samples=20_000).rms_relative
    assert rms["best"] < 0.65 * rms["fast"]
    assert rms["fast"] < 0.0015


@BOTH
@pytest.mark.parametrize("target", [{"n_faces": 400}, {"error": "0.3%"}], ids=["count", "error"])
def test_threads_change_nothing(quality, target):
    mesh = orange(5_000)
    one, three = (simplify(mesh, **target, quality=quality, threads=n) for n in (1, 3))
    assert_same(one, three)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n_faces": 3}, "it must be 4 or more"),
        ({"n_faces": 10, "quality": "worst"}, "fast, best"),
        ({}, "neither is given"),
        ({"n_faces": 20.9}, r"^n_faces: .* is not a whole number$"),
        ({"n_faces": True}, r"^n_faces: .* is not a whole number$"),
        *(
            ({"error": wrong}, "error: .* is not a distance")
            for wrong in (-1.0, "far", "nan", "-2%")
        ),
        # A sphere of radius 1 has a diagonal of about 3.4.
        ({"error": 5.0}, r"error: .* is 3\.\d+ model units across.*nothing of it"),
        ({"error": "51%"}, r"error: .* is 3\.\d+ model units across.*nothing of it"),
    ],
)
def test_wrong_options_are_errors(options, message):
    with pytest.raises(OptionError, match=message):
        simplify(icosphere(2), **options)


# If all normals of a mesh are those of its facets, no edge is hard.


def with_facet_normals(mesh, facet_of_face=None):
    """The mesh with one normal for each triangle, or for each group of triangles."""
    facets = np.arange(mesh.n_faces) if facet_of_face is None else facet_of_face
    a, b, c = (mesh.positions[mesh.faces[:, corner]] for corner in range(3))
    normals = np.zeros((facets.max() + 1, 3))
    np.add.at(normals, facets, np.cross(b - a, c - a))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normal_faces = np.repeat(facets[:, None], 3, axis=1).astype(np.int32)
    return mesh.replace(normals=normals, normal_faces=normal_faces)


QUADS = grid_sphere(24, 48)


@pytest.mark.parametrize(
    ("mesh", "is_flat"),
    [
        (with_facet_normals(icosphere(4)), True),
        (with_facet_normals(QUADS, np.arange(QUADS.n_faces) // 2), True),
        (with_facet_normals(cube()), False),  # built of flat sides
        (with_facet_normals(plane(8, 8)), False),
        (BALL.replace(normals=BALL.positions, normal_faces=BALL.faces), False),
        (BALL, False),
    ],
    ids=["triangles", "quads", "cube", "plane", "smooth", "no normals"],
)
def test_a_curved_surface_with_a_normal_for_each_facet_is_flat_shaded(mesh, is_flat):
    assert is_flat_shaded(mesh) == is_flat


def test_no_edge_of_a_facet_is_hard():
    sphere = icosphere(4).replace(normals=None, normal_faces=None)
    for quality in ("fast", "best"):
        low, report = simplify_with_report(with_facet_normals(sphere), 300, quality=quality)
        assert_same(low, simplify(sphere, 300, quality=quality))
        assert "facets" in " ".join(report.notes)


# The search for the fewest faces within an error.


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("wanted", [5, 77, 1_000, 90_000])
def test_the_fewest_are_found_in_a_few_tries(power, wanted):
    tried = []

    def attempt(n):
        tried.append(n)
        return Trial(n, n**-power)

    found = search_fewest(attempt, wanted**-power * (1.0 + 1e-12), 4, 100_000, 2_000)
    assert wanted <= found <= 1.021 * wanted + 1
    assert len(tried) <= 12
    assert len(set(tried)) == len(tried)


@pytest.mark.parametrize(
    ("error", "limit", "found"), [(1.0, 0.0, 5_000), (math.inf, 1.0, 5_000), (0.0, 0.0, 4)]
)
def test_where_nothing_fits_all_stay_and_where_everything_fits_the_least(error, limit, found):
    assert search_fewest(lambda n: Trial(n, error), limit, 4, 5_000, 1_000) == found


def test_no_more_tries_where_fewer_are_not_possible():
    tried = []

    def attempt(n):
        tried.append(n)
        return Trial(max(n, 300), 0.1)

    assert search_fewest(attempt, 0.5, 4, 5_000, 1_000) <= 300
    assert sum(n < 290 for n in tried) == 1


@pytest.mark.parametrize("quality", ["fast", "best"])
def test_faces_that_are_there_twice_count_once(quality):
    ball = icosphere(4)
    twice = ball.replace(faces=np.concatenate([ball.faces, np.roll(ball.faces, 1, axis=1)]))
    one, other = (simplify(mesh, 300, quality=quality) for mesh in (ball, twice))
    assert np.array_equal(one.positions[one.faces], other.positions[other.faces])


@pytest.mark.parametrize("quality", QUALITIES)
def test_what_counts_less_gets_fewer_triangles(quality):
    ball = icosphere(5)
    waves = 1.0 + 0.1 * np.sin(5.0 * ball.positions).sum(axis=1, keepdims=True)
    left = ball.replace(positions=waves * ball.positions)
    mesh = join_meshes([left, left.replace(positions=left.positions + np.array([9.0, 0.0, 0.0]))])
    is_left = np.arange(mesh.n_vertices) < left.n_vertices
    results = []
    for least in (1.0, 0.02):
        importance = np.where(is_left, 1.0, least)
        low, report = simplify_with_report(mesh, 600, quality=quality, importance=importance)
        own = excerpt(low, low.positions[low.faces[:, 0], 0] < 4.5)
        assert report.n_faces <= 600
        results.append((own.n_faces, surface_distance(left, own).rms))
    (n_alike, alike), (n_more, closer) = results
    assert n_alike == pytest.approx(300, rel=0.1)
    assert n_more > 1.2 * n_alike and closer < 0.8 * alike
    same, _ = simplify_with_report(mesh, 600, quality=quality, importance=np.ones(mesh.n_vertices))
    none, _ = simplify_with_report(mesh, 600, quality=quality)
    assert same.positions.tobytes() == none.positions.tobytes()
