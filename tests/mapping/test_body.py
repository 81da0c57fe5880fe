"""Whole bodies: one chart of a body, limbs cut off at necks, and the least cost of candidates."""

import math

import numpy as np
import pytest
from skimage.measure import marching_cubes

from texbake.core import core
from texbake.mapping.atlas.atlas import make_atlas
from texbake.mapping.atlas.charts import Charts
from texbake.mapping.atlas.choice import layout_cost, whole_bodies
from texbake.mapping.atlas.cutting.body import _Body, flatten_body
from texbake.mapping.atlas.cutting.cut import cut_charts, surface_of
from texbake.mapping.atlas.edge_weights import edge_weights
from texbake.mapping.atlas.flatten import face_energies
from texbake.mapping.atlas.halves import find_halves
from texbake.mapping.atlas.joining.necks import divide_at_necks
from texbake.mapping.atlas.joining.pieces import pieces_of
from texbake.mapping.corner_uvs import signed_areas
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.overlap import find_overlaps
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import icosphere
from texbake.mesh.symmetry import MirrorPlane
from texbake.progress import Stages


def grid(keep, n=24):
    """Faces of a grid of unit squares about the origin whose middles `keep` accepts, as a mesh."""
    xs = np.linspace(-1.0, 1.0, n + 1)
    points = np.array([(x, y, 0.0) for y in xs for x in xs])
    faces = []
    for j in range(n):
        for i in range(n):
            if keep((xs[i] + xs[i + 1]) / 2.0, (xs[j] + xs[j + 1]) / 2.0):
                a = j * (n + 1) + i
                faces += [(a, a + 1, a + n + 2), (a, a + n + 2, a + n + 1)]
    return Mesh(positions=points, faces=np.array(faces, dtype=np.int32), name="grid")


def torus(n_around, n_across):
    """A torus of quads halved into triangles, with one handle."""
    a = 2.0 * np.pi * np.arange(n_around)[:, None] / n_around
    b = 2.0 * np.pi * np.arange(n_across)[None] / n_across
    radii = 1.0 + 0.35 * np.cos(b)
    points = np.stack([radii * np.cos(a), radii * np.sin(a), 0.35 * np.sin(b) + 0.0 * a], axis=2)
    i, j = np.meshgrid(np.arange(n_around), np.arange(n_across), indexing="ij")
    corner = [
        ((i + u) % n_around) * n_across + (j + v) % n_across
        for u, v in ((0, 0), (1, 0), (1, 1), (0, 1))
    ]
    quads = np.stack(corner, axis=2).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    return Mesh(positions=points.reshape(-1, 3), faces=faces, name="torus")


def body_of(mesh):
    surface = surface_of(mesh)
    corners, _, opposite = surface.joints
    points = surface.points[corners]
    return flatten_body(points, opposite, edge_weights(surface).weights.ravel())


def test_distances_grow_by_each_edge_and_later_sources_only_lower_them():
    # A path 0 - 1 - 2 - 3 - 4 with edges of 1, 2, 3, 4, and one edge that is no way.
    tails, heads = np.array([0, 1, 2, 3, 0]), np.array([1, 2, 3, 4, 4])
    costs = np.array([1.0, 2.0, 3.0, 4.0, math.inf])
    starts = np.concatenate([tails, heads])
    order = np.argsort(starts, kind="stable")
    rows = np.searchsorted(starts[order], np.arange(6))
    ends = np.concatenate([heads, tails])[order].astype(np.int32)
    steps = np.concatenate([costs, costs])[order]
    distances, before = np.full(5, np.inf), np.full(5, -1, dtype=np.int32)
    core.find_shortest_paths(rows, ends, steps, np.array([0], np.int32), -1, distances, before)
    assert distances.tolist() == [0.0, 1.0, 3.0, 6.0, 10.0]
    core.find_shortest_paths(rows, ends, steps, np.array([4], np.int32), -1, distances, before)
    assert distances.tolist() == [0.0, 1.0, 3.0, 4.0, 0.0]
    assert before.tolist() == [-1, 0, 1, 4, -1]


@pytest.mark.parametrize("mesh", [icosphere(3), torus(24, 12)], ids=["sphere", "torus"])
def test_a_body_becomes_one_disk_of_little_stretch(mesh):
    body = body_of(mesh)
    assert body is not None
    uvs = body.flat.uvs[body.faces]
    assert (signed_areas(uvs) > 0.0).all()
    assert body.flat.energy / 4.0 < 1.15
    # A disk has one more vertex and face together than edges.
    edges = np.sort(np.stack([body.faces, np.roll(body.faces, -1, axis=1)], axis=2), axis=2)
    n_edges = len(np.unique(edges.reshape(-1, 2), axis=0))
    assert len(body.flat.uvs) + len(body.faces) - n_edges == 1


def mirrored_ball():
    """A ball with a mirror plane, no seam, and edges that cost ten times their length."""
    surface = surface_of(icosphere(2))
    corners, _, opposite = surface.joints
    plane = MirrorPlane(np.array([1.0, 0.0, 0.0]), 0.0, 0.0)
    return _Body(surface.points[corners], opposite, np.full(len(opposite), 10.0), plane)


def test_a_path_of_one_vertex_has_no_mirror_image():
    body = mirrored_ball()
    body.cut_image([3])
    assert not body.has_seam


def test_a_dart_beside_the_plane_is_cut_where_a_seam_runs_along_the_plane():
    body = mirrored_ball()
    low, high = (int(np.argmin(sign * body.points[:, 1])) for sign in (1.0, -1.0))
    body.cut_along(body.mirror.path_at_plane(np.array([low], dtype=np.int32), high))
    vertex = int(np.where(body.distances > 0.0, body.distances, np.inf).argmin())
    body.seam_lengths[vertex] *= 10.0  # as if the way along the surface were long
    assert body.distances[body.mirror.at_plane(vertex, float(body.seam_lengths[vertex]))] == 0.0
    assert body.cut_to(vertex)
    assert body.distances[vertex] == 0.0


def test_energies_are_those_of_singular_values():
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]] * 3, dtype=float)
    uvs = np.array(
        [[[0, 0], [2, 0], [0, 0.5]], [[0, 0], [0, 1], [-1, 0]], [[0, 0], [0, 1], [1, 0]]]
    )
    assert face_energies(corners, uvs.astype(float)).tolist() == [2.125, 1.0, 1.0]


def test_limbs_are_cut_off_where_they_are_narrow():
    mesh = grid(lambda x, y: abs(x) < 0.2 or abs(y) < 0.2)  # a cross
    surface = surface_of(mesh)
    opposite = surface.opposite(np.ones(mesh.n_faces, dtype=bool))
    cross = Charts(
        faces=mesh.faces,
        uvs=mesh.positions[:, :2].copy(),
        chart_ids=np.zeros(mesh.n_vertices, dtype=np.int32),
    )
    (piece,) = pieces_of(surface, cross, opposite)
    side, weights = math.sqrt(piece.area), edge_weights(surface).weights
    limbs = divide_at_necks([piece], opposite, weights, least_gain=0.06, side=side)
    assert len(limbs) > 1
    assert sum(limb.waste for limb in limbs) < piece.waste
    assert len(divide_at_necks([piece], opposite, weights, least_gain=99.0, side=side)) == 1


def test_a_cut_of_one_half_is_followed_by_its_mirror_image_in_the_other():
    """Seams on the right are so dear that no cut there pays by itself."""
    mesh = grid(lambda x, y: abs(x) > 0.1 and (abs(y) < 0.2 or abs(x) < 0.35))  # two letters T
    surface = surface_of(mesh)
    opposite = surface.opposite(np.ones(mesh.n_faces, dtype=bool))
    charts = Charts(
        faces=mesh.faces,
        uvs=mesh.positions[:, :2].copy(),
        chart_ids=np.zeros(mesh.n_vertices, dtype=np.int32),
    )
    pieces = pieces_of(surface, charts, opposite)
    side = math.sqrt(sum(piece.area for piece in pieces))
    is_right = mesh.positions[mesh.faces].mean(axis=1)[:, 0] > 0.0
    weights = np.where(is_right, 100.0, 1.0)[:, None] * np.ones(3)
    plane = MirrorPlane(np.array([1.0, 0.0, 0.0]), 0.0, 0.0)

    def areas(plane):
        found = divide_at_necks(pieces, opposite, weights, least_gain=0.06, side=side, plane=plane)
        right = [bool(is_right[piece.face_ids[0]]) for piece in found]
        return [
            sorted(
                piece.area for piece, of_right in zip(found, right, strict=True) if of_right == half
            )
            for half in (False, True)
        ]

    left, right = areas(None)
    assert len(left) > 1 and len(right) == 1
    left, right = areas(plane)
    assert len(left) > 1
    np.testing.assert_allclose(left, right, rtol=1e-4)  # points are snapped to a grid


def test_whole_bodies_cover_each_face_once_and_overlap_nowhere():
    mesh = torus(40, 20)
    surface = surface_of(mesh)
    others = cut_charts(mesh, surface)
    found = whole_bodies(surface, others, edge_weights(surface).weights)
    assert found and found[0].n_charts < others.n_charts
    for charts in found:
        assert charts.solid.all()
        corners, ids = charts.uvs[charts.faces], charts.chart_ids[charts.faces[:, 0]]
        assert (signed_areas(corners) > 0.0).all()
        for chart in range(charts.n_charts):
            assert not find_overlaps(corners[ids == chart]).overlapping.any()


def body_of_capsules(capsules, n):
    """A closed surface about capsules, each the ends of its axis and a radius, by a grid of n³."""
    ticks = np.linspace(-1.2, 1.2, n)
    points = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), axis=-1)
    total = np.zeros((n, n, n))
    for start, end, radius in capsules:
        axis = np.subtract(end, start)
        along = np.clip(((points - start) * axis).sum(axis=-1) / (axis @ axis), 0.0, 1.0)
        gaps = np.sqrt(((points - start - along[..., None] * axis) ** 2).sum(axis=-1)) - radius
        total += np.exp(-gaps / 0.06)  # blends them
    vertices, faces, *_ = marching_cubes(-np.log(total), 0.0)
    points = ticks[0] + vertices * (ticks[1] - ticks[0])
    return Mesh(positions=points, faces=faces.astype(np.int32), name="body")


_TORSO = ((0.0, -0.5, 0.0), (0.0, 0.3, 0.0), 0.4), ((0.0, 0.75, 0.05), (0.0, 0.8, 0.1), 0.25)
_WINGS = [((s * 0.35, 0.3, 0.0), (s * 0.65, -0.4, 0.0), 0.1) for s in (-1, 1)]
_FEET = [((s * 0.2, -0.85, 0.0), (s * 0.2, -1.0, 0.3), 0.12) for s in (-1, 1)]
_TRUNK = ((0.0, 0.0, -0.6), (0.0, 0.0, 0.5), 0.3), ((0.0, 0.35, 0.75), (0.0, 0.3, 0.95), 0.2)
_LEGS = [((s * 0.2, -0.1, z), (s * 0.22, -0.9, z), 0.11) for s in (-1, 1) for z in (-0.55, 0.45)]


@pytest.mark.parametrize(
    "capsules", [[*_TORSO, *_WINGS, *_FEET], [*_TRUNK, *_LEGS]], ids=["bird", "quadruped"]
)
def test_parts_of_bodies_are_joined_again_without_splinters_or_crushed_faces(capsules):
    mesh = body_of_capsules(capsules, 28)
    surface = surface_of(mesh)
    halves = find_halves(surface)
    weights = edge_weights(surface, hide=0.5, plane=halves.plane).weights
    for charts in whole_bodies(surface, cut_charts(mesh, surface), weights, halves):
        corners, uvs = surface.points[surface.faces], charts.uvs[charts.faces]
        assert charts.n_charts <= 3
        assert np.bincount(charts.chart_ids[charts.faces[:, 0]]).min() > 0.02 * mesh.n_faces
        assert face_energies(corners, uvs).max() < 5.0


@pytest.mark.parametrize("mesh", [icosphere(3), torus(24, 12)], ids=["sphere", "torus"])
def test_best_costs_no_more_than_good(mesh):
    costs = {}
    for quality in ("good", "best"):
        options = UnwrapOptions(quality=quality, size=128)
        (atlas,) = make_atlas([mesh], options, Stages(None), seams=[None], protected=[None])
        fill = float(signed_areas(atlas.corners).sum())
        weights = edge_weights(surface_of(mesh), hide=0.5).weights
        costs[quality] = layout_cost([mesh], [atlas.charts], [weights], fill)
    assert costs["best"] <= costs["good"]


def test_seams_that_are_taken_back_leave_no_trace():
    mesh = icosphere(3)
    surface = surface_of(mesh)
    corners, _, opposite = surface.joints
    body = _Body(surface.points[corners], opposite, edge_weights(surface).weights.ravel())
    body.cut_along([0, int(body.graph.ends[0])])
    before = body.seams()
    assert body.cut_to(int(body.distances.argmax()))
    body.restore(before)
    for now, then in zip(body.seams(), before, strict=True):
        np.testing.assert_array_equal(now, then)


@pytest.mark.parametrize("n_cuts", range(3))
def test_a_dart_that_costs_more_than_it_saves_is_taken_back(monkeypatch, n_cuts):
    """All darts after the first ones seem dear: their seams are not in the result."""
    lengths = []

    def cost(body, flat):
        lengths.append(int(np.count_nonzero(body.cut)))
        return float(len(lengths)) if len(lengths) > n_cuts + 1 else -float(len(lengths))

    monkeypatch.setattr("texbake.mapping.atlas.cutting.body._cost", cost)
    laid = body_of(icosphere(4))
    edges = np.sort(
        np.stack([laid.faces.ravel(), np.roll(laid.faces, -1, axis=1).ravel()], axis=1), axis=1
    )
    n_border = np.count_nonzero(np.unique(edges, axis=0, return_counts=True)[1] == 1)
    assert n_border == lengths[n_cuts]
    # Each later trial starts from the same seams, and has one dart more.
    surface = surface_of(icosphere(4))
    assert max(lengths) - n_border < len(surface.points) ** 0.5 * 4
