"""Secondary rays: each hits what a test against every triangle finds, on any build of the core."""

import numpy as np
import pytest

from texbake.mesh.compose import join_meshes
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, icosphere, uv_sphere
from texbake.raycast.morton_tree import MortonTree
from texbake.raycast.rays import DEPTH, OPEN, Hemispheres, OcclusionRange
from texbake.raycast.scene import RayScene


def soup(n):
    """Triangles of all sizes, anywhere, with slivers, copies and triangles without area."""
    rng = np.random.default_rng(2)
    corners = rng.normal(size=(n, 1, 3)) + rng.exponential(0.3, (n, 1, 1)) * rng.normal(
        size=(n, 3, 3)
    )
    corners[::7, 2] = 0.5 * (corners[::7, 0] + corners[::7, 1]) + 1e-9 * corners[::7, 2]
    corners[5::50] = corners[4::50]
    return Mesh(positions=corners.reshape(-1, 3), faces=np.arange(3 * n).reshape(-1, 3))


def steps():
    """Sheets at right angles to the axes, along which many rays run."""
    whole = cube()
    moved = [
        whole.replace(positions=0.25 * whole.positions + np.array([i, j, (i * j) % 3]) / 4)
        for i in range(4)
        for j in range(4)
    ]
    return join_meshes(moved)


MESHES = {
    "soup": lambda: soup(600), "one triangle": lambda: soup(1), "steps": steps,
    "ball": lambda: icosphere(4), "poles": lambda: uv_sphere(12, 100),
}  # fmt: skip


def single_rays(mesh, n, *, seed=1):
    """Hemispheres of one ray each, in any direction, some along axes or at corners."""
    rng = np.random.default_rng(seed)
    frame = LocalFrame.around(mesh)
    corners = frame.to_local(mesh.positions)
    points = rng.uniform(-0.6, 0.6, (n, 3))
    directions = rng.normal(size=(n, 3))
    directions[::5] = np.eye(3)[rng.integers(3, size=len(directions[::5]))]
    at = slice(1, None, 3)
    directions[at] = corners[rng.integers(len(corners), size=len(directions[at]))] - points[at]
    # A hemisphere about +z: its frame is the world's, so its direction is the same in both.
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    axes = np.tile(np.float32([0, 0, 1]), (n, 1))
    nowhere = np.zeros((n, 3), dtype=np.float32)  # a plane that mirrors nothing
    sets = directions.astype(np.float32)[:, np.newaxis]
    assert n & (n - 1) == 0
    return frame, Hemispheres(points, axes, nowhere, np.arange(n, dtype=np.uint32)), sets


def nearest_of_all(corners, origins, directions):
    """Distance of each ray's first hit, from volumes of tetrahedra, and whether it is certain."""
    p, q, r = (corners[np.newaxis, :, k] - origins[:, np.newaxis] for k in range(3))
    along = directions[:, np.newaxis]
    volumes = np.stack([(along * np.cross(a, b)).sum(-1) for a, b in ((r, q), (p, r), (q, p))])
    total = volumes.sum(axis=0)
    sizes = [np.linalg.norm(x, axis=-1) for x in (p, q, r)]
    doubt = 1e-14 * max(size.max() for size in sizes) ** 2
    inside = (volumes > doubt).all(axis=0) | (volumes < -doubt).all(axis=0)
    outside = (volumes > doubt).any(axis=0) & (volumes < -doubt).any(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        weights = volumes / total
        distances = sum((weights[k] * (along * c).sum(-1)) for k, c in enumerate((p, q, r)))
    ahead = inside & (distances >= 0.0)
    return np.where(ahead, distances, np.inf).min(axis=1), (inside | outside).all(axis=1)


@pytest.mark.parametrize("compact", [False, True], ids=["plain", "compact"])
@pytest.mark.parametrize("name", MESHES)
def test_hits_are_as_with_each_triangle_tested(name, compact):
    mesh = MESHES[name]()
    frame, domes, sets = single_rays(mesh, 512)
    corners = frame.to_local(mesh.positions)[mesh.faces]
    bands = [slice(k, k + 64) for k in range(0, 512, 64)]
    found = [nearest_of_all(corners, domes.points[b], sets[b, 0].astype(float)) for b in bands]
    nearest, sure = (np.concatenate(column) for column in zip(*found, strict=True))
    scene = RayScene.build(mesh, frame, compact=compact)
    assert sure.mean() > 0.6
    for length in (0.3, 3.0):
        met = scene.cast_hemispheres(domes, sets, OcclusionRange(0.0, length, length))
        # Inner rays go the other way.
        back = scene.cast_hemispheres(domes, -sets, OcclusionRange(0.0, length, length))
        is_open = nearest > length
        np.testing.assert_array_equal(met[sure, OPEN] == 1.0, is_open[sure])
        expected = np.minimum(nearest, length)[sure]
        # The distance of a sliver is as uncertain as its volume is small.
        close = np.isclose(back[sure, DEPTH], expected, rtol=1e-6, atol=1e-6)
        assert close.mean() > 0.998
        np.testing.assert_array_equal(back[:, DEPTH] < np.float32(length), met[:, OPEN] == 0.0)


@pytest.mark.parametrize("side", [1, -1])
def test_a_ray_along_an_axis_that_starts_level_with_an_edge_finds_its_distance(side):
    """Along the other axes it is at the border of the triangle's box all the way."""
    mesh = Mesh(positions=[[side, -1, 0], [side, 1, 0], [-side, 0, 0]], faces=[[0, 1, 2]])
    frame = LocalFrame.around(mesh)
    point = frame.to_local(mesh.positions)[:2].mean(axis=0) - [0, 0, 0.25]
    up = np.float32([[0, 0, 1]])
    domes = Hemispheres(np.array([point]), up, 0 * up, np.zeros(1, dtype=np.uint32))
    scene = RayScene.build(mesh, frame)
    for direction in (up, -up):  # inner rays go the other way
        met = scene.cast_hemispheres(domes, direction[np.newaxis], OcclusionRange(0.0, 1.0, 1.0))
        is_ahead = direction[0, 2] > 0
        assert met[0, OPEN] == (0.0 if is_ahead else 1.0)
        assert met[0, DEPTH] == (1.0 if is_ahead else 0.25)


@pytest.mark.parametrize("name", MESHES)
def test_neither_the_tree_nor_the_neighbors_of_a_ray_change_what_it_hits(name):
    mesh = MESHES[name]()
    frame, domes, sets = single_rays(mesh, 4096, seed=3)
    reach = OcclusionRange(1e-7, 1.0, np.sqrt(3.0))
    plain = RayScene.build(mesh, frame).cast_hemispheres(domes, sets, reach)
    scene = RayScene.build(mesh, frame, compact=True, threads=2)
    assert scene.cast_hemispheres(domes, sets, reach).tobytes() == plain.tobytes()
    order = np.random.default_rng(0).permutation(len(domes))
    assert (
        scene.cast_hemispheres(domes.where(order), sets, reach).tobytes() == plain[order].tobytes()
    )


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e300])
def test_rays_that_are_not_finite_hit_nothing_outside_the_tree(value):
    """The last nodes of a level have children that do not exist."""
    mesh = icosphere(4)
    frame, domes, sets = single_rays(mesh, 512)
    scene = RayScene.build(mesh, frame)
    reach = OcclusionRange(1e-7, 1.0, 1.0)
    sound = scene.cast_hemispheres(domes, sets, reach)
    domes.points[::4, 0] = value
    with np.errstate(over="ignore"):
        domes.axes[1::4, 1] = value
    met = scene.cast_hemispheres(domes, sets, reach)
    assert (met[::4, OPEN] == 1.0).all() and (met[1::4, OPEN] == 1.0).all()
    rest = np.arange(512) % 4 > 1
    np.testing.assert_array_equal(met[rest], sound[rest])
    assert (sound[rest, OPEN] < 1.0).any()
    boxes = MortonTree.build(mesh, frame, threads=1).nodes[-1]
    np.testing.assert_array_equal(np.isinf(boxes), np.tile(boxes[0] > boxes[3], (6, 1)))


@pytest.mark.parametrize("level", [1, 4])
def test_no_ray_leaves_a_closed_mesh_through_a_vertex(level):
    """Aimed exactly at every vertex and the middle of every edge, from one point."""
    mesh = icosphere(level)
    frame = LocalFrame.around(mesh)
    corners = frame.to_local(mesh.positions)
    edges = np.concatenate([mesh.faces[:, [k, (k + 1) % 3]] for k in range(3)])
    targets = np.concatenate([corners, corners[edges].mean(axis=1)])
    n = 1 << (len(targets) - 1).bit_length()
    targets = np.resize(targets, (n, 3))
    middle = np.full(3, 1.0 / 64.0)
    # Exact in float32: the ray's line is moved onto the target instead.
    directions = (targets - middle).astype(np.float32)
    points = targets - directions.astype(float)
    axes = np.tile(np.float32([0, 0, 1]), (n, 1))
    domes = Hemispheres(points, axes, np.zeros_like(axes), np.arange(n, dtype=np.uint32))
    scene = RayScene.build(mesh, frame, compact=True)
    met = scene.cast_hemispheres(domes, directions[:, np.newaxis], OcclusionRange(0.0, 4.0, 0.0))
    assert (met[:, OPEN] == 0.0).all()


def test_a_compact_tree_holds_the_same_triangles_in_smaller_boxes():
    mesh = uv_sphere(150, 200)
    frame = LocalFrame.around(mesh)
    trees = [
        MortonTree.build(mesh, frame, compact=compact, threads=threads)
        for compact, threads in ((False, 1), (True, 1), (True, 2))
    ]
    plain, compact, again = trees
    for name in "ids", "nodes", "starts", "box", "leaves":
        assert getattr(compact, name).tobytes() == getattr(again, name).tobytes()
    np.testing.assert_array_equal(np.sort(plain.ids, axis=None), np.sort(compact.ids, axis=None))

    def surface(tree):
        low, high = np.split(tree.nodes[: tree.starts[1]].astype(float), 2, axis=1)
        size = np.maximum(high - low, 0.0)
        return (size * np.roll(size, 1, axis=1)).sum()

    assert surface(compact) < 0.8 * surface(plain)
