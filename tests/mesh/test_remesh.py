"""Wrapped meshes: closed and manifold whatever is given, and as close as the voxels allow."""

from unittest.mock import patch

import numpy as np
import pytest

from tests.models import BROKEN, flipped, joined, model, moved, real
from texbake.core import core
from texbake.errors import MeshError, OptionError
from texbake.mesh.distance import surface_distance
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import degenerate_faces
from texbake.mesh.options import RemeshOptions, TransformOptions
from texbake.mesh.parametric.make import make
from texbake.mesh.remesh import remesh, remesh_with_report
from texbake.mesh.shapes import cube, icosphere, plane
from texbake.mesh.topology import duplicate_faces, face_components, find_edges, genus
from texbake.mesh.transform import transform


def holed(mesh, n, width):
    """The mesh without the faces next to n of its vertices."""
    centers = mesh.positions[mesh.faces].mean(axis=1)
    points = icosphere(1).positions[:n]
    distances = np.linalg.norm(centers[:, None] - points[None], axis=2).min(axis=1)
    return mesh.replace(faces=mesh.faces[distances > width / 2])


def soup(seed, n=60):
    random = np.random.default_rng(seed)
    corners = random.normal(size=(n, 1, 3)) + 0.4 * random.normal(size=(n, 3, 3))
    return Mesh(positions=corners.reshape(-1, 3), faces=np.arange(3 * n).reshape(-1, 3))


def volume(mesh):
    return np.linalg.det(mesh.positions[mesh.faces] - mesh.bounds[0]).sum() / 6.0


def wrapped(mesh, **options):
    """The wrapped mesh, whose surface is checked."""
    result = remesh(mesh, RemeshOptions(**{"resolution": 48, **options}))
    edges = find_edges(result.faces)
    assert edges.closed and not edges.misoriented.any()
    assert not core.has_pinched_vertex(result.n_vertices, result.faces)
    assert not duplicate_faces(result.faces).any() and not degenerate_faces(result).any()
    assert len(np.unique(result.faces)) == result.n_vertices
    assert volume(result) > 0.0
    return result


BALL = icosphere(4)
SOLIDS = {
    "ball": BALL,
    "inside out": flipped(BALL),
    "half inside out": BALL.replace(
        faces=np.where(np.arange(BALL.n_faces)[:, None] % 2 == 0, BALL.faces, BALL.faces[:, ::-1])
    ),
    "doubled wall": joined(BALL, flipped(moved(BALL, scale=0.95))),
    "wall of the same side": joined(BALL, moved(BALL, scale=0.9)),
    "cavity": joined(BALL, flipped(moved(BALL, scale=0.5))),
    "parts inside": joined(BALL, moved(cube(), scale=0.2), moved(soup(5), scale=0.1)),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_all_that_looks_like_a_ball_becomes_one(name):
    result = wrapped(SOLIDS[name])
    edges = find_edges(result.faces)
    assert genus(result.faces, edges, result.n_vertices) == 0
    assert face_components(result.faces, result.n_vertices)[1] == 1
    # Vertices lie on the ball, but for a few whose faces would fold. Between them, a chord of a
    # cell's diagonal sinks in by the square of its half over twice the radius.
    voxel = 2.0 / 48.0
    radii = np.linalg.norm(result.positions, axis=1)
    assert np.abs(radii - 1.0).max() < 0.1 * voxel
    assert surface_distance(result, BALL).max < 0.1 * voxel + 3.0 * voxel**2 / 8.0


def test_holes_are_closed_up_to_their_width():
    ball = holed(icosphere(5), 6, 0.3)
    assert find_edges(ball.faces).boundary.any()
    closed = wrapped(ball, close=0.4)
    assert volume(closed) == pytest.approx(4.0 / 3.0 * np.pi, rel=0.02)
    assert genus(closed.faces, find_edges(closed.faces), closed.n_vertices) == 0
    # Those of a body are filled in any case, however little is to be closed.
    filled = wrapped(ball, close=0.0)
    assert volume(filled) == pytest.approx(4.0 / 3.0 * np.pi, rel=0.002)
    assert genus(filled.faces, find_edges(filled.faces), filled.n_vertices) == 0


BOX = transform(cube(), TransformOptions(rotate=(17.0, 29.0, 11.0)))
SIDES = np.ptp(cube().bounds, axis=0)
CAVITY = flipped(moved(BOX, scale=0.5))


def by_volume(mesh):
    """Volumes of the separate parts, the largest first; those of cavities are negative."""
    parts, n_parts = face_components(mesh.faces, mesh.n_vertices)
    dets = np.linalg.det(mesh.positions[mesh.faces])
    return np.sort(np.bincount(parts, dets, n_parts) / 6.0)[::-1]


# A mesh, and the volumes of its solid parts and of their cavities.
HOLLOW = {
    "ball": (joined(BALL, flipped(moved(BALL, scale=0.5))), [1.0, -0.125], 4.0 / 3.0 * np.pi),
    "box": (joined(BOX, CAVITY), [1.0, -0.125], np.prod(SIDES)),
    "inside out": (flipped(joined(BOX, CAVITY)), [1.0, -0.125], np.prod(SIDES)),
    "solid in a cavity": (
        joined(BOX, flipped(moved(BOX, scale=0.8)), moved(BOX, scale=0.4)),
        [1.0, 0.064, -0.512],
        np.prod(SIDES),
    ),
    "solid in a solid": (joined(BOX, moved(BOX, scale=0.5)), [1.0], np.prod(SIDES)),
    "solid box": (BOX, [1.0], np.prod(SIDES)),
}


@pytest.mark.parametrize("name", HOLLOW)
def test_cavities_are_kept_on_request_and_filled_otherwise(name):
    mesh, volumes, unit = HOLLOW[name]
    n_cavities = sum(volume < 0.0 for volume in volumes)
    result, report = remesh_with_report(mesh, RemeshOptions(resolution=64, keep_interior=True))
    assert by_volume(wrapped(mesh, resolution=64, keep_interior=True)) == pytest.approx(
        unit * np.array(volumes),
        rel=0.02,  # edges are cut by less than a voxel
    )
    assert (report.n_cavities_kept, report.n_cavities_filled) == (n_cavities, 0)
    assert report.n_components == len(volumes) - n_cavities
    assert surface_distance(result, mesh).a_to_b.max < report.voxel  # at edges
    filled, report = remesh_with_report(mesh, RemeshOptions(resolution=64))
    assert by_volume(filled) == pytest.approx([unit], rel=0.02)
    assert (report.n_cavities_kept, report.n_cavities_filled) == (0, n_cavities)
    with patch("texbake.mesh.remesh.winding_numbers") as measured:  # nobody asks how many there are
        unreported = wrapped(mesh, resolution=64)
    assert not measured.called
    assert unreported.positions.tobytes() == filled.positions.tobytes()


def test_a_cavity_of_a_torn_mesh_is_kept():
    inner = flipped(moved(holed(icosphere(5), 3, 0.2), scale=0.5))
    torn = joined(holed(icosphere(5), 6, 0.2), inner)
    result = wrapped(torn, resolution=64, close=0.3, keep_interior=True)
    assert by_volume(result) == pytest.approx(4.0 / 3.0 * np.pi * np.array([1.0, -0.125]), rel=0.05)


def test_the_walls_of_a_thin_shell_are_kept():
    shell = joined(BALL, flipped(moved(BALL, scale=0.95)))  # 1.2 voxels
    result, report = remesh_with_report(shell, RemeshOptions(resolution=48, keep_interior=True))
    wrapped(shell, keep_interior=True)
    assert report.n_cavities_kept == 1 and report.n_components == 1
    assert surface_distance(result, shell).max < 0.25 * report.voxel


def test_a_cavity_narrower_than_the_closed_gaps_is_filled():
    mesh, _, _ = HOLLOW["ball"]
    _, report = remesh_with_report(
        mesh, RemeshOptions(resolution=48, keep_interior=True, close=1.1)
    )
    assert (report.n_components, report.n_cavities_kept) == (1, 0)


def test_cavities_stay_with_their_parts():
    hollow, _, unit = HOLLOW["ball"]
    small = moved(hollow, scale=0.6, by=(2, 0, 0))
    inner = moved(BALL, scale=0.3)
    both = joined(small, hollow, inner)
    for components, shares in (
        ("largest", [1.0, -0.125]),
        (2, [1.0, 0.216, -0.027, -0.125]),
        ("all", [1.0, 0.216, 0.027, -0.027, -0.125]),
    ):
        result = wrapped(both, resolution=96, components=components, keep_interior=True)
        assert by_volume(result) == pytest.approx(unit * np.array(shares), rel=0.02)


def test_cavities_survive_simplification():
    mesh, volumes, unit = HOLLOW["ball"]
    result = wrapped(mesh, keep_interior=True, n_faces=600)
    assert 580 <= result.n_faces <= 600
    # Of the 600 faces, the cavity has about 120, and a ball of so few loses 8 % of its volume.
    assert by_volume(result) == pytest.approx(unit * np.array(volumes), rel=0.1)


def test_overlapping_boxes_become_one():
    boxes = joined(cube(), moved(cube(), by=(0.5, 0.3, 0.2)))
    result = wrapped(boxes, resolution=64)
    assert face_components(result.faces, result.n_vertices)[1] == 1
    size = np.ptp(cube().bounds, axis=0)
    overlap = np.prod(size - (0.5, 0.3, 0.2))
    assert volume(result) == pytest.approx(2.0 * np.prod(size) - overlap, rel=0.01)


@pytest.mark.parametrize(
    "mesh",
    [
        plane(3, 3),
        Mesh(positions=[[0, 0, 0], [1, 0, 0], [0.2, 0.7, 0.1]], faces=[[0, 1, 2]]),
        Mesh(positions=[[0, 0, 0], [1, 1, 1], [2, 2, 2]], faces=[[0, 1, 2]]),
        make("mobius", resolution=(48, 4)),
        soup(0),
        soup(1, 400),
    ],
    ids=["plane", "triangle", "line", "mobius", "soup", "thick soup"],
)
def test_sheets_are_wrapped_on_both_sides(mesh):
    one_sided = find_edges(mesh.faces).misoriented.any()
    surface = "auto" if one_sided else "closed"
    options = RemeshOptions(resolution=48, surface=surface)
    result, report = remesh_with_report(mesh, options)
    wrapped(mesh, surface=surface)
    away = surface_distance(result, mesh)
    assert away.a_to_b.max < 2.5 * report.voxel  # the ball and the shell around corners
    if mesh.n_faces < 400:  # of which some lie inside
        assert away.b_to_a.max < 1.75 * report.voxel


def test_triangles_that_are_lines_may_fill_the_grid():
    """Their boxes count, where there is no area to count."""
    ends = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
    inner = np.repeat(np.linspace(0.1, 0.9, 4000)[:, None], 3, axis=1)
    faces = np.stack([np.zeros(4000), np.ones(4000), 2 + np.arange(4000)], axis=1)
    mesh = Mesh(positions=np.concatenate([ends, inner]), faces=faces.astype(np.int32))
    with pytest.raises(MeshError, match="would take very long; use a `resolution` of"):
        remesh(mesh, RemeshOptions(resolution=1000))


@pytest.mark.parametrize("resolution", [24, 48, 96])
def test_the_distance_shrinks_with_the_voxels(resolution):
    mesh = make("torus", resolution=(160, 80))
    result, report = remesh_with_report(mesh, RemeshOptions(resolution=resolution))
    both = surface_distance(result, mesh)
    assert both.max < 0.5 * report.voxel and both.rms < 0.05 * report.voxel
    assert genus(result.faces, find_edges(result.faces), result.n_vertices) == 1


def test_the_largest_parts_are_kept():
    balls = joined(
        moved(BALL, scale=0.3), moved(BALL, scale=0.5, by=(2, 0, 0)), moved(BALL, by=(0, 3, 0))
    )
    for components, n_kept in (("all", 3), ("largest", 1), (2, 2)):
        options = RemeshOptions(resolution=64, components=components)
        result, report = remesh_with_report(balls, options)
        assert report.n_components == n_kept and report.n_dropped == 3 - n_kept
        assert len(report.notes) == (report.n_dropped > 0)
        assert result.bounds[1][1] > 3.9  # the largest is there


def test_colors_and_groups_come_from_the_nearest_points():
    colors = (BALL.positions + 1.0) / 2.0
    groups = (BALL.positions[BALL.faces].mean(axis=1)[:, 2] > 0.0).astype(np.int32)
    mesh = BALL.replace(colors=colors, face_groups=groups, group_names=("low", "high"))
    result = wrapped(mesh)
    assert np.abs(result.colors - (result.positions + 1.0) / 2.0).max() < 0.01
    above = result.positions[result.faces].mean(axis=1)[:, 2] > 0.05
    assert (result.face_groups[above] == 1).all()


def test_tunnels_that_need_more_faces_are_an_error():
    with pytest.raises(MeshError, match=r"4 triangles cannot be reached, .* `close`"):
        wrapped(make("torus"), n_faces=4)


def test_wrong_options_and_meshes_are_refused():
    for close in ("wide", "-1%", "nan", -0.5):
        with pytest.raises(OptionError, match=r"close: .* is not a width"):
            RemeshOptions(close=close)
    for bad in ({"resolution": 4}, {"components": 0}, {"components": "most"}, {"n_faces": 2}):
        with pytest.raises(OptionError, match=next(iter(bad))):
            RemeshOptions(**bad)
    with pytest.raises(OptionError, match="wider than 360 voxels"):
        remesh(BALL, RemeshOptions(resolution=512, close="60%"))
    point = Mesh(positions=np.ones((3, 3)), faces=[[0, 1, 2]])
    with pytest.raises(MeshError, match="all of its corners are at one point"):
        remesh(point)


@pytest.mark.parametrize(
    "name",
    [*BROKEN, "scan", "bracket", "sponge",
     *real("broken/VH_M_Blood_Vasculature_Heart.glb", "broken/cycloidal.ply",
           "broken/self_intersectA.obj", "meshes/mri_skin.ply", "meshes/maze.obj")],
)  # fmt: skip
def test_rough_and_broken_meshes_become_closed(name):
    assert wrapped(model(name), resolution=96).n_faces > 0


@pytest.mark.parametrize(("size", "n_crumbs"), [(0.2, 1), (4.0, 0)])
def test_a_part_smaller_than_a_voxel_is_a_crumb(size, n_crumbs):
    """A ball of 48 voxels, and another of a fifth of a voxel, or of four, beside it."""
    voxel = 2.0 / 48.0
    crumb = moved(icosphere(1), scale=0.5 * size * voxel, by=(0.9, 0.9, 0.0))
    result, report = remesh_with_report(joined(BALL, crumb), RemeshOptions(resolution=48))
    assert report.n_crumbs == n_crumbs
    assert report.n_components == 2 - n_crumbs
    assert len(by_volume(result)) == 2 - n_crumbs
    note = "separate parts smaller than a voxel are left out: 1;"
    assert any(note in text for text in report.notes) == (n_crumbs == 1)


HIDDEN = joined(soup(4, 200), BALL)
SAME = {
    "soup": (HIDDEN, {"resolution": 64}),
    "cavities": (HOLLOW["solid in a cavity"][0], {"resolution": 48, "keep_interior": True}),
    "sheet": (plane(9, 9, lambda x, y: 0.2 * np.sin(5 * x) * y), {"resolution": 48}),
    "sharp": (BOX, {"resolution": 32, "sharp_edges": True}),
}


@pytest.mark.parametrize("name", SAME)
def test_neither_threads_nor_size_change_anything(name):
    mesh, options = SAME[name]
    here = remesh(mesh, RemeshOptions(**options), threads=1)
    for threads, scale in ((2, 1.0), (3, 2.0**-40), (4, 2.0**40)):
        large = Mesh(positions=mesh.positions * scale, faces=mesh.faces)
        there = remesh(large, RemeshOptions(**options), threads=threads)
        assert np.array_equal(here.faces, there.faces)
        assert np.array_equal(here.positions * scale, there.positions)
        if here.normals is not None:
            assert np.array_equal(here.normals, there.normals)
