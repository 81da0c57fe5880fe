"""Open surfaces that stay one sheet, and bodies whose holes are filled."""

import numpy as np
import pytest

from tests.models import HAS_REAL, flipped, joined, model, moved
from texbake import Mesh, OptionError, RemeshOptions, make, remesh, surface_distance
from texbake.core import core
from texbake.errors import MeshError
from texbake.mesh.distance import face_areas
from texbake.mesh.remesh import looks_open, remesh_with_report
from texbake.mesh.remeshing.boundary import Loops, kind_of, require_topology
from texbake.mesh.shapes import cube, icosphere, plane
from texbake.mesh.topology import euler_characteristic, face_components, find_edges
from texbake.mesh.triangle_tree import TriangleTree
from texbake.mesh.weld import weld_rows


def heights(n, height, keep=lambda x, y: np.ones(x.shape, bool)):
    """A height field over a square, of the triangles whose centers are kept."""
    sheet = plane(n, n, lambda x, y: height(2.0 * x - 1.0, 2.0 * y - 1.0))
    positions = sheet.positions * [2.0, 2.0, 1.0] - [1.0, 1.0, 0.0]
    centers = positions[sheet.faces].mean(axis=1)
    return Mesh(positions=positions, faces=sheet.faces[keep(centers[:, 0], centers[:, 1])])


def rough(x, size, seed=0):
    return size * np.random.default_rng(seed).normal(size=x.shape)


def bumps(x, y):
    return 0.7 * np.sqrt(np.maximum(1.3 - x * x - y * y, 0.0)) + 0.2 * np.exp(-(x**2 + y**2) / 0.02)


def face_mask():
    return heights(140, lambda x, y: bumps(x, y) + rough(x, 0.002), lambda x, y: x**2 + y**2 < 0.97)


def range_scan():
    """A dome with a ragged boundary and 12 holes that a sensor left."""
    random = np.random.default_rng(2)
    edges, holes = random.uniform(0.88, 0.94, 60), random.uniform(-0.55, 0.55, (12, 2))

    def keep(x, y):
        angles = ((np.arctan2(y, x) / np.pi + 1.0) * 29.9).astype(int)
        kept = np.hypot(x, y) < edges[angles]
        for hole in holes:
            kept &= np.hypot(x - hole[0], y - hole[1]) > 0.05
        return kept

    return heights(120, lambda x, y: bumps(x, y) + rough(x, 0.001), keep)


def leaf(n=60):
    mesh = heights(n, lambda x, y: 0.2 * x**2 - 0.1 * y**2)
    x, y, z = mesh.positions.T
    return mesh.replace(positions=np.stack([x, y * (0.5 - 0.45 * x**2), z], axis=1))


def leaves():
    turns = np.random.default_rng(3)
    parts = []
    for _ in range(8):
        turn = np.linalg.qr(turns.normal(size=(3, 3)))[0]
        one = leaf(30)
        parts.append(
            moved(one.replace(positions=one.positions @ turn), by=0.6 * turns.normal(size=3))
        )
    return joined(*parts)


def tube():
    """A cylinder without its ends, whose first and last corners around it are at one place."""
    mesh = heights(80, lambda x, y: 0.0 * x)
    x, y, _ = mesh.positions.T
    rim = np.round([np.cos(np.pi * x), np.sin(np.pi * x)], 12).T
    return bare(mesh.replace(positions=np.column_stack([0.4 * rim, y])))


def layers():
    """Two sheets about a voxel apart, which face alike."""
    return joined(
        heights(60, lambda x, y: 0.0 * x),
        moved(heights(60, lambda x, y: 0.1 * x**2), by=[0.0, 0.0, 0.02]),
    )


def bare(mesh):
    return Mesh(positions=mesh.positions, faces=weld_rows(mesh.positions)[mesh.faces])


SHEETS = {
    "plane": lambda: plane(3, 3), "face mask": face_mask, "range scan": range_scan, "leaf": leaf,
    "leaves that cross": leaves,
    "cloth": lambda: heights(100, lambda x, y: 0.25 * np.sin(5 * x + 2 * np.sin(3 * y))),
    "terrain": lambda: heights(
        100, lambda x, y: 0.2 * np.sin(3 * x) + 0.1 * np.sin(7 * y - x) + rough(x, 0.002),
    ),
    "half a ball": lambda: part_of_ball(0.0), "tube": tube, "layers": layers,
}  # fmt: skip


def part_of_ball(height, level=5):
    ball = icosphere(level)
    return ball.replace(faces=ball.faces[ball.positions[ball.faces].mean(axis=1)[:, 2] > height])


def figures(mesh):
    """Separate parts and Euler number of a mesh whose vertices at one place are one."""
    faces = weld_rows(mesh.positions)[mesh.faces]
    edges = find_edges(faces)
    assert not edges.non_manifold.any() and not edges.misoriented.any()
    return face_components(faces, mesh.n_vertices)[1], euler_characteristic(faces, edges)


def boundary(mesh):
    loops = Loops.of(mesh.positions, weld_rows(mesh.positions)[mesh.faces])
    return Mesh(positions=mesh.positions, faces=loops.edges[:, [0, 1, 1]])


@pytest.mark.parametrize(("name", "resolution"), [
    *((name, 96) for name in SHEETS), *((name, 160) for name in ("plane", "range scan", "layers")),
])  # fmt: skip
def test_open_surfaces_stay_sheets_with_their_boundary(name, resolution):
    mesh = SHEETS[name]()
    result, report = remesh_with_report(mesh, RemeshOptions(resolution=resolution, close=0.0))
    assert report.surface == "open"
    assert figures(result) == figures(mesh)
    areas = [face_areas(one.positions, one.faces).sum() for one in (result, mesh)]
    assert areas[0] == pytest.approx(areas[1], rel=0.02)
    away = surface_distance(result, mesh)
    assert away.a_to_b.max < report.voxel and away.b_to_a.max < report.voxel
    old, new = boundary(mesh), boundary(result)
    points = new.positions[np.unique(new.faces)]
    assert nearest(points, old).mean() < 0.2 * report.voxel
    assert nearest(points, old).max() < report.voxel


def nearest(points, mesh):
    return TriangleTree.build(mesh.positions, mesh.faces).closest_points(points)[0]


def test_simplified_and_sharp_sheets_keep_their_boundary():
    mesh = face_mask()
    low, report = remesh_with_report(mesh, RemeshOptions(resolution=96, n_faces=600))
    assert low.n_faces <= 600 and figures(low) == (1, 1) and report.n_boundaries == 1
    box = cube()
    box = box.replace(
        faces=box.faces[(box.positions[box.faces][:, :, 2] < box.bounds[1][2]).any(1)]
    )
    options = RemeshOptions(resolution=64, surface="open", sharp_edges=True)
    result, report = remesh_with_report(box, options)
    assert figures(result) == (1, 1)
    assert surface_distance(result, box).max < 0.4 * report.voxel


def test_holes_of_sheets_are_filled_up_to_a_width():
    mesh = range_scan()
    result, report = remesh_with_report(mesh, RemeshOptions(resolution=128, close=0.4))
    assert report.surface == "open" and report.n_holes_filled >= 10
    assert figures(result) == (1, 1) and report.n_boundaries == 1
    # Smoothly: the dome over the hole, and not its chord.
    dome = heights(120, bumps)
    assert surface_distance(result, dome).a_to_b.max < 0.5 * report.voxel


def pricked(mesh):
    """20 small holes, and a large one."""
    x, y, _ = mesh.positions[mesh.faces].mean(axis=1).T
    kept = np.hypot(x - 0.2, y + 0.2) > 0.25
    for k in range(20):
        angle, distance = 2.4 * k, 0.6 + 0.2 * (k % 2)
        hole = distance * np.array([np.cos(angle), np.sin(angle)])
        kept &= np.hypot(x - hole[0], y - hole[1]) > 0.03
    return mesh.replace(faces=mesh.faces[kept])


@pytest.mark.parametrize(("resolution", "close", "n_left"), [
    (96, 0.0, 22), (96, 0.15, 2), (48, 0.0, None),  # whose voxels are too wide for some holes
])  # fmt: skip
def test_only_holes_up_to_a_width_are_filled(resolution, close, n_left):
    mesh = pricked(heights(160, bumps, lambda x, y: x**2 + y**2 < 0.97))
    result, report = remesh_with_report(mesh, RemeshOptions(resolution=resolution, close=close))
    assert report.n_holes_filled == 22 - report.n_boundaries
    if n_left is None:
        assert report.n_holes_filled > 0
    else:
        assert report.n_boundaries == n_left and figures(result) == (1, 2 - n_left)


def vase():
    ball = part_of_ball(0.0)
    x, y, z = ball.positions.T
    swell = 1.0 + 0.8 * np.sin(np.pi * z) - 0.5 * (1.0 - z) ** 4
    return ball.replace(positions=np.stack([x * swell, y * swell, -3.0 * z], axis=1))


@pytest.mark.parametrize(("surface", "euler"), [("open", 1), ("closed", 2), ("auto", 2)])
def test_a_vase_keeps_its_mouth_only_if_it_is_open(surface, euler):
    mesh = vase()
    result, report = remesh_with_report(mesh, RemeshOptions(resolution=96, surface=surface))
    assert figures(result) == (1, euler) and report.n_holes_filled == euler - 1
    assert surface_distance(result, mesh).b_to_a.max < report.voxel
    # With neither an inner wall nor a second one.
    areas = [face_areas(one.positions, one.faces).sum() for one in (result, mesh)]
    assert areas[0] == pytest.approx(areas[1], rel=0.01 if euler == 1 else 0.1)


def holed(mesh, n_holes, width):
    centers = mesh.positions[mesh.faces].mean(axis=1)
    chosen = np.random.default_rng(1).choice(len(centers), n_holes, replace=False)
    kept = np.ones(len(centers), bool)
    for hole in centers[chosen]:
        kept &= ((centers - hole) ** 2).sum(axis=1) > width * width / 4.0
    return mesh.replace(faces=mesh.faces[kept])


def statue(level):
    ball = icosphere(level)
    x, y, z = ball.positions.T
    swell = 1.0 + 0.15 * np.sin(6 * x) * np.sin(5 * y) * np.cos(4 * z)
    return ball.replace(positions=ball.positions * swell[:, None] * [1.0, 1.6, 0.9])


def half_turned(mesh):
    turned = np.arange(mesh.n_faces)[:, None] % 2 == 0
    return mesh.replace(faces=np.where(turned, mesh.faces, mesh.faces[:, ::-1]))


# Level of a statue, or none of a torus, and what is torn out of it.
BODIES = {
    "statue": (6, lambda mesh: holed(mesh, 278, 0.05)),
    "torus": (None, lambda mesh: holed(mesh, 20, 0.15)),
    "inside out": (5, lambda mesh: flipped(holed(mesh, 40, 0.1))),
    "half inside out": (5, lambda mesh: half_turned(holed(mesh, 40, 0.1))),
    "inner wall": (
        5, lambda mesh: joined(holed(mesh, 40, 0.1), holed(moved(mesh, scale=0.9), 40, 0.1)),
    ),
}  # fmt: skip


def body(name):
    """A body, it with its holes, and its handles."""
    level, torn = BODIES[name]
    whole = statue(level) if level else bare(make("torus", resolution=(160, 80)))
    return whole, torn(whole), int(level is None)


@pytest.mark.parametrize("name", BODIES)
def test_holes_of_bodies_are_filled(name):
    whole, torn, n_handles = body(name)
    result, report = remesh_with_report(torn, RemeshOptions(resolution=96))
    assert report.surface == "closed" and report.n_holes_filled >= 10
    assert find_edges(result.faces).closed and figures(result) == (1, 2 - 2 * n_handles)
    assert not core.has_pinched_vertex(result.n_vertices, result.faces)
    assert surface_distance(result, whole).max < 0.5 * report.voxel


@pytest.mark.parametrize(
    ("n_holes", "opening", "share"), [(6, 10.0, 0.001), (6, 17.0, 0.001), (1, 60.0, 0.067)]
)
def test_small_holes_of_a_ball_are_filled_to_a_ball_and_wide_ones_flat(n_holes, opening, share):
    """A flat disk is (1 - cos(opening / 2)) / 2 of the diameter off: 6.7 % at 60°, 0.5 % at 17°."""
    ball = icosphere(5)
    centers = ball.positions[ball.faces].mean(axis=1)
    along = np.concatenate([centers, -centers], axis=1)[:, :n_holes].max(axis=1)
    kept = along < np.cos(np.radians(opening / 2)) * np.sqrt((centers**2).sum(axis=1))
    torn = ball.replace(faces=ball.faces[kept])
    result, report = remesh_with_report(torn, RemeshOptions(resolution=96, surface="closed"))
    assert report.n_holes_filled == n_holes and figures(result) == (1, 2)
    assert surface_distance(result, ball).max < share * 2.0
    areas = [face_areas(one.positions, one.faces).sum() for one in (result, ball)]
    assert areas[0] == pytest.approx(areas[1], rel=0.02)  # no inner wall


@pytest.mark.parametrize(
    "name", sorted(set(SHEETS) - {"plane", "range scan", "leaves that cross", "layers"})
)
def test_sheets_are_closed_on_request(name):
    result, report = remesh_with_report(
        SHEETS[name](), RemeshOptions(resolution=96, surface="closed")
    )
    assert report.surface == "closed" and find_edges(result.faces).closed
    assert figures(result) == (1, 2)


@pytest.mark.parametrize(
    ("make_mesh", "is_open"),
    [(one, True) for one in SHEETS.values()]
    + [(lambda name=name: body(name)[1], False) for name in BODIES]
    + [(lambda: part_of_ball(-0.6), False), (lambda: part_of_ball(0.2), True), (icosphere, False)]
    + [(lambda: make("mobius", resolution=(48, 4)), False)]
    + [
        (lambda name=name: model(name), is_open)
        for name, is_open in (
            ("meshes/mountain.obj", True),
            ("meshes/maze.obj", True),
            ("broken/inverted_triangles.obj", True),
            ("meshes/spothead.obj", False),
            ("broken/VH_M_Heart.glb", False),
            ("broken/cycloidal.ply", False),
            ("broken/self_intersectA.obj", False),
        )
        if HAS_REAL
    ],
)
def test_open_surfaces_are_distinguished_from_bodies(make_mesh, is_open):
    assert looks_open(make_mesh()) == is_open


def test_wrong_results_are_errors():
    mobius = make("mobius", resolution=(48, 4))
    with pytest.raises(MeshError, match="one side only; use `surface=closed`"):
        remesh(mobius, RemeshOptions(surface="open", resolution=48))
    _, report = remesh_with_report(mobius, RemeshOptions(resolution=48))
    assert report.surface == "closed" and report.n_handles_made == 0
    with pytest.raises(OptionError, match="keep_interior: an open surface has no interior"):
        RemeshOptions(surface="open", keep_interior=True)
    # Two halves that hang together by less than a voxel.
    halves = heights(60, lambda x, y: 0.0 * x, lambda x, y: abs(x) > 0.3)
    ends = [np.abs(halves.positions - [x, 0.4333, 0.0]).sum(axis=1).argmin() for x in (-0.3, 0.3)]
    positions = np.concatenate([halves.positions, [[0.0, 0.434, 0.0]]])
    bridge = np.array([[*ends, halves.n_vertices]])
    narrow = Mesh(positions=positions, faces=np.concatenate([halves.faces, bridge]))
    with pytest.raises(MeshError, match="2 separate parts and the mesh 1; use a greater"):
        remesh(narrow, RemeshOptions(resolution=32, close=0.0))
    largest = RemeshOptions(resolution=32, close=0.0, components="largest")
    assert figures(remesh(narrow, largest))[0] == 1


@pytest.mark.parametrize(
    ("n_handles", "n_boundaries", "made"),
    [(0, 2, "1 hole"), (1, 1, "1 handle"), (2, 1_204, "1,203 holes and 2 handles")],
)
def test_handles_and_holes_of_a_sheet_are_named(n_handles, n_boundaries, made):
    mesh = plane(3, 3)
    kind = kind_of(20.0 * mesh.positions, mesh.faces)
    with pytest.raises(MeshError, match=f"m: the sheet has {made} that the mesh does not have;"):
        require_topology("m", kind, 1, 1, n_handles, n_boundaries, may_be_pierced=False)
    assert require_topology("m", kind, 1, 1, 0, 1, may_be_pierced=False) == 0


@pytest.mark.parametrize("resolution", [48, 80, 128])
def test_thin_blades_are_not_pierced(resolution):
    """Between a voxel and nothing thick, and in no direction of the grid."""
    ball = icosphere(5)
    x, y, z = ball.positions.T
    blade = np.stack([x + 0.6 * z, 0.3 * y, z + 0.3 * y], axis=1) * [1.0, 0.02, 1.0]
    turned = blade @ np.array([[0.8, 0.36, 0.48], [-0.6, 0.48, 0.64], [0.0, -0.8, 0.6]])
    result = remesh(ball.replace(positions=turned), RemeshOptions(resolution=resolution))
    assert figures(result) == (1, 2) and find_edges(result.faces).closed


def test_handles_that_closed_gaps_make_are_reported():
    ring = bare(make("torus", resolution=(96, 24)))
    angles = np.arctan2(ring.positions[:, 2], ring.positions[:, 0])
    # A ring opened by a gap, a bent bar whose ends are capped.
    kept = ~(np.abs(angles[ring.faces]) < 0.1).any(axis=1)
    bar = ring.replace(faces=ring.faces[kept])
    for close, n_made in ((0.5, 1), (0.01, 0)):
        _, report = remesh_with_report(bar, RemeshOptions(resolution=96, close=close))
        assert report.surface == "closed" and report.n_holes_filled == 2
        assert report.n_handles_made == n_made == len(report.notes)
