"""Meshes as text: what is packed is what a page draws."""

import base64
import json
import struct
import zlib

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as npst

from texbake.mapping.seams import border_edges
from texbake.mesh.frame import LocalFrame
from texbake.mesh.normals import shading_normals
from texbake.mesh.shapes import plane, uv_sphere
from texbake.mesh.tangents import corner_tangents
from texbake.pages.viewer import DIRECTION_STEPS, octahedral, pack, packed_mesh

INTS = npst.arrays(np.int32, st.tuples(st.integers(0, 6), st.integers(1, 3)))


def unpack(text):
    """What `unpack` in page.js does, written once more from the description of the format."""
    data = zlib.decompress(base64.b64decode(text))
    (n_head,) = struct.unpack_from("<I", data)
    head = json.loads(data[4 : 4 + n_head])
    at, arrays = 4 + n_head, {}
    for name, (count, width) in head["arrays"].items():
        planes = np.frombuffer(data, np.uint8, 4 * count * width, at).reshape(width, 4, count)
        at += planes.size
        codes = (planes.astype(np.uint64) << np.array([0, 8, 16, 24], np.uint64)[:, None]).sum(1)
        steps = (codes >> np.uint64(1)).astype(np.int64) ^ -(codes & np.uint64(1)).astype(np.int64)
        arrays[name] = steps.cumsum(axis=1).astype(np.int32).T
    assert at == len(data)
    return head, arrays


def directions(codes):
    xy = codes / DIRECTION_STEPS
    z = 1.0 - np.abs(xy).sum(axis=1)
    folded = (1.0 - np.abs(xy[:, ::-1])) * np.where(xy < 0.0, -1.0, 1.0)
    found = np.column_stack([np.where(z[:, None] < 0.0, folded, xy), z])
    return found / np.linalg.norm(found, axis=1, keepdims=True)


@given(st.dictionaries(st.sampled_from("abc"), INTS), st.integers())
def test_whole_numbers_come_back(arrays, value):
    # Differences of int32 wrap around, and wrap back.
    head, found = unpack(pack(arrays, {"more": value}))
    assert head["more"] == value
    assert found.keys() == arrays.keys()
    for name, values in arrays.items():
        np.testing.assert_array_equal(found[name], values)


def test_directions_come_back():
    vectors = np.random.default_rng(0).normal(size=(5000, 3))
    vectors[:7] = np.vstack([np.eye(3), -np.eye(3), [[1, 1, -1]]])
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    off = np.linalg.norm(directions(octahedral(vectors)) - vectors, axis=1)
    # Half a step in x and y, a whole one in z, seen from 1 / sqrt(3) away at the nearest.
    assert off.max() <= np.sqrt(3.0) * np.sqrt(6.0) * 0.5 / DIRECTION_STEPS
    assert octahedral(np.zeros((1, 3))).tolist() == [[0, 0]]


@pytest.mark.parametrize("mesh", [uv_sphere(7, 9), plane(3, 2)], ids=["sphere", "plane"])
def test_corners_come_back(mesh):
    frame = LocalFrame.around(mesh)
    head, found = unpack(packed_mesh(mesh, frame))
    corners = found["index"][:, 0]
    points = head["low"] + found["position"][corners] * head["step"]
    expected = frame.to_local(mesh.positions[mesh.faces.ravel()])
    assert np.abs(points - expected).max() <= 0.5 * head["step"] + 1e-12
    uvs = found["uv"][corners] / head["uvSteps"]
    assert np.abs(uvs - mesh.corner_uvs().reshape(-1, 2)).max() <= 0.5 / head["uvSteps"]
    normals, normal_faces = shading_normals(mesh)
    tangents = corner_tangents(mesh).reshape(-1, 4)
    np.testing.assert_array_equal(found["tangent"][corners, 2], tangents[:, 3])
    for codes, vectors in (
        (found["normal"], normals[normal_faces.ravel()]),
        (found["tangent"][:, :2], tangents[:, :3]),
    ):
        assert np.abs(directions(codes[corners]) - vectors).max() < 1e-3
    bits = (found["borders"] >> np.arange(3)) & 1
    np.testing.assert_array_equal(bits.astype(bool), border_edges(mesh))
    # Vertices are numbered as they are used, which keeps differences small.
    assert (np.diff(np.unique(corners, return_index=True)[1]) > 0).all()


def test_a_mesh_without_coordinates_has_none():
    mesh = plane(2, 2).replace(uvs=None, uv_faces=None)
    head, found = unpack(packed_mesh(mesh, LocalFrame.around(mesh)))
    assert set(found) == {"index", "position", "normal"}
    assert head["arrays"]["position"] == [9, 3]


def test_a_mesh_far_from_the_origin_loses_nothing():
    mesh = uv_sphere(8, 8)
    far = mesh.replace(positions=mesh.positions * 1024.0 + 2.0**30)
    near, moved = (unpack(packed_mesh(m, LocalFrame.around(m)))[1] for m in (mesh, far))
    # 2^30 costs the sphere's coordinates 2^-23 of its size, far below a step of the grid.
    assert np.abs(near["position"] - moved["position"]).max() <= 1


def test_the_browser_unpacks_the_same(browser, page):
    text = page.read_text(encoding="utf-8")
    packed = text.split('id="mesh-low">')[1].split("<")[0]
    _, expected = unpack(packed)
    browser.open(page)
    for name, values in expected.items():
        found = browser.value(f"texbake.mesh('mesh-low').then(m => Array.from(m.{name}))")
        assert found == values.ravel().tolist()
