"""Samples to fragments, with sets and dictionaries as the second opinion."""

import numpy as np
import pytest

from texbake import Material, RenderOptions, Scene, SceneObject
from texbake.core import core
from texbake.mesh.shapes import cube, plane, uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.fragments import fragment_rows
from texbake.rendering.rasterize import World


def world_of(n_faces, starts):
    return World(np.zeros((1, 3)), np.zeros((n_faces, 3), np.int32), np.array(starts, np.int64))


def random_ids(height, width, n_faces, seed):
    """Blobs of triangles, so that pixels are plain, split and empty."""
    rng = np.random.default_rng(seed)
    coarse = rng.integers(-1, n_faces, (height // 3 + 1, width // 3 + 1))
    fine = np.repeat(np.repeat(coarse, 3, 0), 3, 1)[:height, :width]
    noise = rng.random((height, width)) < 0.1
    return np.where(noise, rng.integers(-1, n_faces, (height, width)), fine).astype(np.int32)


@pytest.mark.parametrize("side", [1, 2, 3, 4])
@pytest.mark.parametrize("rows", [(0, 6), (2, 5), (3, 3)])
def test_fragments_are_those_of_a_count_by_hand(side, rows):
    starts = [0, 3, 3, 7, 12]
    ids = random_ids(6 * side, 9 * side, 12, seed=side)
    found = fragment_rows(ids, world_of(12, starts), rows, side=side, wants_samples=True)
    expected = {}
    for j in range(rows[0] * side, rows[1] * side):
        for i in range(9 * side):
            if ids[j, i] >= 0:
                key = (j // side) * 9 + i // side, ids[j, i]
                expected.setdefault(key, []).append((i, j))
    assert len(found.faces) == len(expected) == found.starts[-1]
    keys = list(zip(found.pixels.tolist(), found.faces.tolist(), strict=True))
    assert set(keys) == set(expected)
    for k, key in enumerate(keys):
        places = np.array(expected[key])
        assert found.counts[k] == len(places)
        middle = (places.mean(axis=0) + 0.5) / side
        np.testing.assert_allclose(found.places[k], middle, rtol=1e-6)
        for i, j in places:
            assert found.of_samples[j - rows[0] * side, i] == k
    # Object after object, and within one in the order of pixels.
    owners = np.searchsorted(starts, found.faces, side="right") - 1
    np.testing.assert_array_equal(np.bincount(owners, minlength=4), np.diff(found.starts))
    assert all(
        (np.diff(found.pixels[a:b]) >= 0).all()
        for a, b in zip(found.starts[:-1], found.starts[1:], strict=True)
    )
    inside = ids[rows[0] * side : rows[1] * side]
    np.testing.assert_array_equal(found.of_samples < 0, inside < 0)
    assert found.counts.sum() == (inside >= 0).sum()


def test_without_merging_each_sample_is_a_fragment_of_its_own():
    ids = random_ids(12, 18, 7, seed=4)
    world = world_of(7, [0, 2, 7])
    found = fragment_rows(ids, world, (0, 4), side=3, merges=False, wants_samples=True)
    assert len(found.faces) == (ids >= 0).sum()
    assert (found.counts == 1.0).all()
    own = found.of_samples[ids >= 0]
    assert sorted(own) == list(range(len(own)))  # no two samples share one
    np.testing.assert_array_equal(found.faces[own], ids[ids >= 0])
    rows, columns = np.nonzero(ids >= 0)
    np.testing.assert_allclose(
        found.places[own], np.stack([columns, rows], 1) / 3 + 1 / 6, rtol=1e-6
    )


def test_a_triangle_seen_again_after_many_others_loses_no_sample():
    # 16 x 16 samples that see 40 triangles in turn: more than a pixel remembers.
    ids = (np.arange(256) % 40).reshape(16, 16).astype(np.int32)
    found = fragment_rows(ids, world_of(40, [0, 40]), (0, 1), side=16, wants_samples=True)
    assert found.counts.sum() == 256
    assert found.counts.max() <= 256
    np.testing.assert_array_equal(found.faces[found.of_samples], ids)


@pytest.mark.parametrize("mesh", [plane(3, 3), cube(), uv_sphere(8, 16)])
def test_multisampling_is_supersampling_where_color_is_flat(mesh):
    objects = tuple(
        SceneObject(
            mesh=mesh.replace(positions=mesh.positions * (1 - 0.2 * i) + (0.6 * i, 0.1 * i, 0)),
            material=Material(shading="unlit", base_color=color),
        )
        for i, color in enumerate([(1.0, 0.5, 0.25), (0.1, 0.2, 0.9)])
    )
    scene = Scene(objects=objects)
    pictures = []
    for edges in "multisample", "supersample":
        options = RenderOptions(width=61, height=47, supersampling=4, edges=edges)
        camera = Camera.framing(*(item.mesh for item in objects), options=options)
        frame = draw(prepare(scene, options), camera)
        pictures.append((frame.color, frame.coverage))
    # Sums of up to 16 float32 values in another order.
    np.testing.assert_allclose(pictures[0][0], pictures[1][0], atol=1e-6)
    np.testing.assert_array_equal(pictures[0][1], pictures[1][1])
    assert 0.0 < (pictures[0][1] % 1.0 > 0).mean() < 0.5


def test_weights_and_motions_on_a_piece_become_those_on_its_triangle():
    rng = np.random.default_rng(0)
    faces, weights = rng.integers(0, 9, 50).astype(np.int32), rng.random((50, 2))
    changes = rng.normal(size=(50, 4)).astype(np.float32)
    corners = rng.random((9, 3, 2)).astype(np.float32)
    found, found_changes = np.empty((50, 2)), np.empty((50, 4), np.float32)
    core.move_to_base(faces, weights, changes, corners, found, found_changes)
    edges = (corners[:, 1:] - corners[:, :1])[faces].astype(np.float64)
    expected = corners[faces, 0] + np.einsum("nk,nki->ni", weights, edges)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    moved = np.einsum("nxk,nki->nxi", changes.reshape(-1, 2, 2), edges)
    np.testing.assert_allclose(found_changes, moved.reshape(-1, 4), atol=1e-6)
