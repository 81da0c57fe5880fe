"""A mesh traced in chunks against one ray tree over all of it: byte for byte the same."""

from contextlib import nullcontext

import numpy as np
import pytest

from texbake import BakeOptions, Mesh, OptionError, bake
from texbake.baking.memory import CORNERS_FACE, MOST_CHUNKS, TREE_FACE, bake_memory
from texbake.mesh.frame import LocalFrame
from texbake.mesh.shapes import plane, uv_sphere
from texbake.raycast.morton_tree import MortonTree
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayScene

MAPS = ("normal", "displacement", "vector-displacement", "position", "curvature", "opacity")


@pytest.fixture(scope="module")
def layered():
    """A bumpy sphere, some of its faces twice, some turned round, and another sphere through it."""
    ball = uv_sphere(60, 90, lambda theta, phi: 1 + 0.03 * np.sin(11 * theta) * np.sin(9 * phi))
    faces = [
        ball.faces, ball.faces[:1500, ::-1], ball.faces + ball.n_vertices, ball.faces[900:2400],
    ]  # fmt: skip
    other = ball.positions * 1.0001 + np.array([0.004, 0.0, 0.0])
    return Mesh(positions=np.vstack([ball.positions, other]), faces=np.vstack(faces))


@pytest.fixture(scope="module")
def frame(layered):
    return LocalFrame.around(layered)


def rays_at(mesh, frame, n, seed):
    """Half of them at vertices and edges, where float32 errs most."""
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet([1.0, 1.0, 1.0], n)
    weights[: n // 4] = [1.0, 0.0, 0.0]
    weights[n // 4 : n // 2, 2] = 0.0
    weights /= weights.sum(axis=1, keepdims=True)
    corners = frame.to_local(mesh.positions).astype(np.float32)[mesh.faces].astype(np.float64)
    targets = np.einsum("nk,nkx->nx", weights, corners[rng.integers(0, mesh.n_faces, n)])
    inward = -targets / np.linalg.norm(targets, axis=1, keepdims=True)
    directions = inward + 0.3 * rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return Rays(targets - 0.1 * directions, directions, np.full(n, 1.5), np.full(n, 0.1))


@pytest.mark.parametrize(("n_chunks", "cull"), [(2, True), (3, False), (7, True), (100, False)])
def test_chunks_find_what_one_tree_finds(layered, frame, n_chunks, cull):
    rays = rays_at(layered, frame, 20_000, seed=n_chunks)
    size = -(-layered.n_faces // n_chunks)
    scenes = (
        RayScene.build(layered, frame),
        RayScene.build(layered, frame, chunk_faces=size, threads=2),
    )
    whole, parts = (scene.cast(rays, cull_back_faces=cull) for scene in scenes)
    for one, other in zip(whole.arrays(), parts.arrays(), strict=True):
        assert np.array_equal(one, other)
    assert (whole.faces != NO_HIT).mean() > 0.5


def test_of_faces_that_are_there_twice_the_first_is_hit():
    square = plane()
    several = Mesh(positions=square.positions, faces=np.vstack([square.faces] * 50))
    frame = LocalFrame.around(several)
    rays = rays_at(several, frame, 5000, seed=3)
    down = np.tile([0.0, 0.0, -1.0], (5000, 1))
    rays = Rays(rays.origins + 0.1 * (rays.directions - down), down, rays.lengths, rays.fronts)
    for size in None, 9:
        hits = RayScene.build(several, frame, chunk_faces=size).cast(rays)
        assert set(np.unique(hits.faces)) - {NO_HIT} == {0, 1}


def test_rays_that_end_at_the_side_of_a_chunk_hit_what_lies_there():
    sheet = plane(8, 8)
    frame = LocalFrame.around(sheet)
    targets = frame.to_local(sheet.positions[sheet.faces].mean(axis=1))
    n = len(targets)
    down = np.tile([0.0, 0.0, -1.0], (n, 1))
    rays = Rays(targets - 0.25 * down, down, np.full(n, 0.25), np.full(n, 0.25))
    for size in None, 16:
        hits = RayScene.build(sheet, frame, chunk_faces=size).cast(rays)
        assert hits.faces.tolist() == list(range(n))


@pytest.fixture(scope="module")
def pair():
    high = uv_sphere(100, 160, lambda theta, phi: 1 + 0.02 * np.sin(9 * theta) * np.sin(8 * phi))
    return high, uv_sphere(10, 16)


def limit(pair, options, n_chunks):
    n, n_texels = pair[0].n_faces, options.width_px * options.height_px
    whole = bake_memory(n, pair[1].n_faces, n_texels, options.maps)
    return whole - TREE_FACE * (n - -(-n // n_chunks))


@pytest.mark.parametrize("n_chunks", [2, 3, 7])
def test_a_bake_has_the_same_bytes(pair, n_chunks, monkeypatch):
    options = BakeOptions(maps=MAPS, size=128, samples=4, keep_hits=True, padding=2)
    whole = bake(*pair, options)
    made: list[int] = []
    trees = RayScene.trees

    def spy(scene):
        made.append(len(list(trees(scene))))
        return trees(scene)

    monkeypatch.setattr(RayScene, "trees", spy)
    most = limit(pair, options, n_chunks)
    parts = bake(*pair, BakeOptions(**{**vars(options), "max_memory": most}))
    assert set(made) == {n_chunks}
    for one, other in zip(whole.hits.arrays(), parts.hits.arrays(), strict=True):
        assert (one is None and other is None) or np.array_equal(one, other)
    for name in MAPS:
        assert np.array_equal(whole.maps[name].values, parts.maps[name].values)
    assert (whole.report.front, whole.report.back) == (parts.report.front, parts.report.back)
    assert whole.report.counts == parts.report.counts


def test_adaptive_samples_in_chunks(pair):
    options = BakeOptions(size=64, samples="adaptive", padding=1)
    whole = bake(*pair, options)
    parts = bake(*pair, BakeOptions(**{**vars(options), "max_memory": 1}))
    assert np.array_equal(whole.maps["normal"].values, parts.maps["normal"].values)


def test_size_of_chunks():
    maps = ("normal", "curvature")
    whole = bake_memory(1_000_000, 1000, 1024**2, maps)
    for memory, expected in (
        (None, None), (whole, None), (whole - 1, 999_999), (whole - TREE_FACE * 1000, 999_000),
        (1, 1_000_000 // MOST_CHUNKS), ("1G", None), ("250M", 1_000_000 // MOST_CHUNKS),
    ):  # fmt: skip
        options = BakeOptions(size=1024, maps=maps, max_memory=memory)
        assert options.chunk_faces(1_000_000, 1000) == expected


def test_the_estimate_holds_the_tree_and_what_it_is_sorted_with(pair):
    tree = MortonTree.build(pair[0], LocalFrame.around(pair[0]), threads=1)
    n = pair[0].n_faces
    held = tree.ids.nbytes + tree.nodes.nbytes
    order = n * np.dtype(np.uint64).itemsize
    assert 0.8 * TREE_FACE * n < held + order <= TREE_FACE * n
    assert 0.9 * CORNERS_FACE * n < tree.leaves.nbytes <= CORNERS_FACE * n


def test_a_cage_takes_as_much_memory_as_a_low_poly_mesh(pair):
    high, low = pair
    cage = low.replace(positions=1.1 * low.positions)
    for n_low, fits in (2 * low.n_faces, True), (2 * low.n_faces - 1, False):
        most = bake_memory(high.n_faces, n_low, 16 * 16, ("normal",))
        options = BakeOptions(size=16, on_miss="closest", max_memory=most)
        with nullcontext() if fits else pytest.raises(OptionError, match="traced in chunks"):
            bake(high, low, options, cage=cage)


def test_wrong_settings(pair):
    with pytest.raises(OptionError, match="max_memory: 'much' is not an amount of memory"):
        BakeOptions(max_memory="much")
    with pytest.raises(OptionError, match="need all of it at once"):
        bake(*pair, BakeOptions(maps=("ao",), size=16, max_memory=1))
