"""Layouts in the circle: no flips, whatever the shape is."""

import math

import numpy as np
import pytest

from texbake.mapping.areas import signed_areas
from texbake.mapping.atlas.flattening.patch import patch_of
from texbake.mapping.atlas.flattening.tutte import tutte_layout


def rough_sheet(seed, n=15, holes=()):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n * n, 3)) * [0.2, 0.2, 3.0]
    points[:, :2] += np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=-1).reshape(-1, 2)
    ids = np.arange(n * n).reshape(n, n)
    a, b, c, d = ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]
    faces = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])
    return points, np.delete(faces.reshape(-1, 3), list(holes), axis=0)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("holes", "n_holes"), [((), 0), ((60, 60 + 196), 1), ((60, 100), 2)])
def test_no_flips(seed, holes, n_holes):
    points, faces = rough_sheet(seed, holes=holes)
    patch = patch_of(faces, len(points))
    assert patch.is_disk
    assert len(patch.loops) == 1 + n_holes
    uvs = tutte_layout(points, patch)
    assert (signed_areas(uvs[faces]) > 0).all()
    outer = max(patch.loops, key=len)
    np.testing.assert_allclose(np.linalg.norm(uvs[outer], axis=1), 1, atol=1e-12)
    inner = np.setdiff1d(np.arange(len(points)), outer)
    assert (np.linalg.norm(uvs[inner], axis=1) < 1).all()


def test_wheel_closed_form():
    """A regular hexagon's middle comes to the middle of the circle."""
    turns = np.arange(6) * math.pi / 3
    points = np.array([[0, 0, 1], *((math.cos(t), math.sin(t), 0) for t in turns)])
    faces = np.array([[0, 1 + i, 1 + (i + 1) % 6] for i in range(6)])
    uvs = tutte_layout(points, patch_of(faces, 7))
    np.testing.assert_allclose(uvs[0], 0, atol=1e-9)
    corners = np.linalg.norm(uvs[1:] - np.roll(uvs[1:], -1, axis=0), axis=1)
    np.testing.assert_allclose(corners, 1, atol=1e-12)
