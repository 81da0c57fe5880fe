"""Normals of FBX files without them: closed forms, corners joined one by one, and real files."""

import numpy as np
import pytest

from tests.fbx_writer import binary, layer, scene, shape
from texbake.mesh.files import read_mesh
from texbake.mesh.normals import shading_normals

# x, y, z from the bits of the index.
CUBE = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)], float) - 0.5
TOP, BOTTOM = [4, 5, 7, 6], [0, 2, 3, 1]
SIDES = [[0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]]
QUADS = np.array([TOP, BOTTOM, *SIDES])
POLYGONS = QUADS.copy()
POLYGONS[:, 3] = ~POLYGONS[:, 3]
POLYGONS = POLYGONS.ravel().astype(np.int32)
# Corners at which the edges start, each edge once.
_KEYS = np.sort(np.stack([QUADS.ravel(), np.roll(QUADS, -1, axis=1).ravel()], axis=1), axis=1)
EDGES = np.unique(_KEYS, axis=0, return_index=True)[1].astype(np.int32)
IS_OF_TOP = (_KEYS[EDGES] >= 4).all(axis=1)
TINY = 1e-12


@pytest.fixture
def read(tmp_path):
    def write_and_read(smoothing, mapping, edges=None, points=CUBE, polygons=POLYGONS, others=()):
        values = ("Smoothing", np.array(smoothing, np.int32))
        layers = [layer("LayerElementSmoothing", values, mapping), *others]
        if edges is not None:
            layers.append(("Edges", [np.array(edges, np.int32)], []))
        path = tmp_path / "a.fbx"
        path.write_bytes(binary(scene(geometry=shape(layers, points, polygons))))
        return read_mesh(path)

    return write_and_read


def by_edge(read, is_smooth, **others):
    return read(is_smooth, "ByEdge", EDGES, **others)


def test_no_hard_edge_makes_no_normals(read):
    assert by_edge(read, np.ones(12)).normals is None
    assert read([3, 1, 1, 1, 1, 1], "ByPolygon").normals is None
    assert read([1], "AllSame").normals is None


@pytest.mark.parametrize("mapping, n", [("ByEdge", 12), ("ByPolygon", 6), ("AllSame", 1)])
def test_zeros_make_the_polygons_flat(read, mapping, n):
    mesh = read(np.zeros(n), mapping, EDGES)
    corners = mesh.positions[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    found = mesh.normals[mesh.normal_faces]
    np.testing.assert_allclose(found, np.repeat(normals[:, None], 3, axis=1), atol=TINY)


@pytest.mark.parametrize(
    "mapping, values",
    [
        ("ByEdge", ~IS_OF_TOP),
        ("ByEdge", np.where(IS_OF_TOP, 0, -1)),
        ("ByPolygon", [0, 1, 1, 1, 1, 1]),
        ("ByPolygon", [2, 1, 1, 1, 1, 1]),
        ("ByPolygon", [2, 5, 5, 5, 1, 1]),
        ("ByPolygon", [-(2**31), 2**30, 2**30, 2**30, 2**30, 2**30]),
    ],
)
def test_a_lid_with_hard_edges(read, mapping, values):
    """The lid is flat; around its corners two sides share a normal, below three faces do."""
    mesh = read(values, mapping, EDGES)
    points, normals = mesh.positions[mesh.faces], mesh.normals[mesh.normal_faces]
    is_lid = (mesh.faces >= 4).all(axis=1)
    np.testing.assert_allclose(normals[is_lid], np.broadcast_to([0, 0, 1.0], (2, 3, 3)), atol=TINY)
    around = np.sign(points[~is_lid])
    around[..., 2] = np.minimum(around[..., 2], 0.0)
    around /= np.linalg.norm(around, axis=2, keepdims=True)
    np.testing.assert_allclose(normals[~is_lid], around, atol=TINY)


def test_an_edge_of_three_polygons_is_hard(read):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1.0]])
    fins = np.array([0, 1, ~2, 0, 1, ~3, 0, 1, ~4], np.int32)
    mesh = read([1, 1, 1], "ByPolygon", points=points, polygons=fins)
    flat = [[0, 0, 1.0], [0, 0, -1.0], [0, -1.0, 0]]
    found = mesh.normals[mesh.normal_faces]
    np.testing.assert_allclose(found, np.repeat(np.array(flat)[:, None], 3, axis=1), atol=TINY)


def test_normals_of_the_file_go_first(read):
    normals = layer("LayerElementNormal", ("Normals", np.tile([0, 0, 1.0], 24)))
    mesh = read(np.zeros(6), "ByPolygon", others=[normals])
    np.testing.assert_array_equal(np.unique(mesh.normals, axis=0), [[0, 0, 1.0]])


def test_edges_and_polygons_that_are_not_there_count_for_nothing(read):
    edges = np.concatenate([[-1, 99, 2**31 - 1], EDGES])
    mesh = read(np.concatenate([[0, 0, 0], ~IS_OF_TOP]), "ByEdge", edges)
    expected = by_edge(read, ~IS_OF_TOP)
    np.testing.assert_array_equal(mesh.normals, expected.normals)
    assert read([0] * 12, "ByEdge").normals is None  # no edges
    lid_alone = read([1], "ByPolygon")  # the others have no value, so no group
    assert len(lid_alone.normals) == 6


@pytest.mark.parametrize("mapping", ["ByEdge", "ByPolygon"])
def test_corners_share_a_normal_where_smooth_edges_join_them(read, mapping):
    """A bumpy torus of quads with random hard edges, or random groups, joined edge by edge."""
    random = np.random.default_rng(9)
    n, m = 9, 7
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    radius = 3.0 + np.cos(v)
    torus = np.stack([radius * np.cos(u), radius * np.sin(u), np.sin(v)], axis=-1).reshape(-1, 3)
    ids = np.arange(n * m).reshape(n, m)
    after = np.roll(ids, -1, axis=0)
    quads = np.stack([ids, after, np.roll(after, -1, 1), np.roll(ids, -1, 1)], -1).reshape(-1, 4)
    starts, ends = quads.ravel(), np.roll(quads, -1, axis=1).ravel()
    keys = np.sort(np.stack([starts, ends], axis=1), axis=1)
    edges = np.unique(keys, axis=0, return_index=True)[1]
    values = random.integers(0, 4 if mapping == "ByPolygon" else 2, len(edges))
    if mapping == "ByPolygon":
        values = values[: len(quads)]
    first = list(range(quads.size))

    def root(corner):
        return corner if first[corner] == corner else root(first[corner])

    corner_at = {(start, end): i for i, (start, end) in enumerate(zip(starts, ends, strict=True))}
    for i, edge in enumerate(edges):
        there = corner_at[ends[edge], starts[edge]]
        groups = values[[edge // 4, there // 4]] if mapping == "ByPolygon" else ()
        if (groups[0] & groups[1]) if mapping == "ByPolygon" else values[i]:
            for a, b in ((edge, there // 4 * 4 + (there + 1) % 4),
                         (edge // 4 * 4 + (edge + 1) % 4, there)):  # fmt: skip
                low, high = sorted((root(a), root(b)))
                first[high] = low
    polygons = quads.copy()
    polygons[:, 3] = ~polygons[:, 3]
    bumpy = torus + 0.2 * random.normal(size=torus.shape)
    mesh = read(values, mapping, edges, points=bumpy, polygons=polygons.ravel().astype(np.int32))
    polygon_of = np.arange(mesh.n_faces) // 2  # two triangles each, whose corners follow
    places = np.argmax(quads[polygon_of][:, None] == mesh.faces[:, :, None], axis=2)
    roots = np.array([root(i) for i in range(quads.size)])[4 * polygon_of[:, None] + places]
    found = _first_equal(mesh)
    _, expected = np.unique(roots.ravel(), return_inverse=True)
    pairs = np.unique(np.stack([found, expected], axis=1), axis=0)
    assert len(pairs) == len(np.unique(found)) == len(np.unique(expected))


MARKS = (b"LayerElementNormal:", b"LayerElementSmoothing:", b"Edges:")


@pytest.mark.realdata
def test_normals_are_shared_where_those_of_the_file_are(data_dir, tmp_path):
    """Corners at a vertex have one normal, or several, as in the file with its normals."""
    without = tmp_path / "a.fbx"
    for file in sorted((data_dir / "fbx").glob("*ascii*.fbx")):
        data = file.read_bytes()
        # The normals of bad faces are wrong on purpose.
        if "bad_face" not in file.name and all(mark in data for mark in MARKS):
            without.write_bytes(data.replace(MARKS[0], b"LayerElementNothing:"))
            of_file, of_smoothing = (_first_equal(read_mesh(path)) for path in (file, without))
            assert not (of_file != of_smoothing).any(), file.name


def _first_equal(mesh):
    """First corner at the vertex of each corner that has its normal, up to rounding."""
    normals, rows = shading_normals(mesh)
    vertices = mesh.faces.ravel()
    # By vertex, then as in the file.
    order = np.argsort(vertices, kind="stable")
    directions = normals[rows].reshape(-1, 3)
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    firsts = np.empty(len(order), int)
    starts = np.flatnonzero(np.diff(vertices[order], prepend=-1))
    for corners in np.split(order, starts[1:]):
        apart = np.linalg.norm(directions[corners][:, None] - directions[corners], axis=2)
        firsts[corners] = corners[np.argmax(apart < 1e-3, axis=1)]
    return firsts
