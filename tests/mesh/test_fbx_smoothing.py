"""Normals of FBX files without them: a cube whose hard edges have closed forms, and real files."""

import os
from pathlib import Path

import numpy as np
import pytest

from tests.hard_cases.fbx_writer import binary, layer, scene, shape
from texbake.mesh.files import read_mesh
from texbake.mesh.normals import shading_normals

DATA = Path(os.environ.get("TEXBAKE_DATA", Path(__file__).parents[3] / "shared" / "data")) / "fbx"
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


def test_a_hard_edge_that_ends_within_a_smooth_surface_splits_no_normal(read):
    is_first = np.arange(12) == 0
    mesh = by_edge(read, ~is_first)
    expected = np.sign(mesh.positions[mesh.faces]) / np.sqrt(3.0)
    np.testing.assert_allclose(mesh.normals[mesh.normal_faces], expected, atol=TINY)


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
    assert len(lid_alone.normals) == 24


MARKS = (b"LayerElementNormal:", b"LayerElementSmoothing:", b"Edges:")


def _has_all(data):
    return all(mark in data for mark in MARKS)


def smoothed_files():
    """Text files with normals and smoothing, but for one whose normals are wrong on purpose."""
    files = (file for file in sorted(DATA.glob("*ascii*.fbx")) if "bad_face" not in file.name)
    return [pytest.param(file, id=file.stem) for file in files if _has_all(file.read_bytes())]


@pytest.mark.skipif(not DATA.is_dir(), reason=f"the meshes of {DATA} are not there")
@pytest.mark.parametrize("file", smoothed_files())
def test_normals_are_shared_where_those_of_the_file_are(file, tmp_path):
    """Corners at a vertex have one normal, or several, as in the file with its normals."""
    without = tmp_path / "a.fbx"
    without.write_bytes(file.read_bytes().replace(b"LayerElementNormal:", b"LayerElementNothing:"))
    mesh, made = read_mesh(file), read_mesh(without)
    of_file, of_smoothing = (_first_equal(m) for m in (mesh, made))
    differ = of_file != of_smoothing
    assert not differ.any()


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
