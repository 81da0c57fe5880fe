"""Points at the texels of an atlas, against their closed forms and against a bake."""

import numpy as np
import pytest

from texbake import BakeOptions, atlas_points, bake, unwrap
from texbake.errors import OptionError, UvError
from texbake.mesh.shapes import cube, icosphere, plane


def test_a_plane_has_its_texel_centers():
    points = atlas_points(plane(), (8, 4))
    x, y = np.meshgrid((np.arange(8) + 0.5) / 8, 1 - (np.arange(4) + 0.5) / 4)
    np.testing.assert_allclose(points.positions[..., 0], x, atol=1e-12)
    np.testing.assert_allclose(points.positions[..., 1], y, atol=1e-12)
    assert points.mask.all() and (points.normals == (0.0, 0.0, 1.0)).all()
    assert repr(points) == "<AtlasPoints: 8 x 4, 100% covered>"


@pytest.mark.parametrize("threads", [1, 3])
def test_points_lie_on_their_faces_with_their_weights(threads):
    mesh = unwrap(icosphere(2), size=128)
    points = atlas_points(mesh, 128, threads=threads)
    mask = points.mask
    assert 0.4 < mask.mean() < 1.0
    weights, faces = points.barycentrics[mask], points.faces[mask]
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-6)
    assert weights.min() >= -0.01  # corners are snapped to a grid
    corners = mesh.positions[mesh.faces[faces]]
    expected = (corners * weights[:, :, None]).sum(axis=1)
    np.testing.assert_allclose(points.positions[mask], expected, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(points.normals[mask], axis=1), 1.0, atol=1e-6)
    directions = points.positions[mask] / np.linalg.norm(points.positions[mask], axis=1)[:, None]
    assert (points.normals[mask] * directions).sum(axis=1).min() > 0.99
    for values in (points.positions, points.normals, points.barycentrics):
        assert (values[~mask] == 0).all()
    assert (points.faces[~mask] == -1).all()


def test_they_are_the_texels_of_a_bake():
    mesh = unwrap(cube(), size=64)
    points = atlas_points(mesh, 64)
    baked = bake(mesh, mesh, BakeOptions(maps=("position",), size=64, padding=0))
    np.testing.assert_array_equal(points.faces, baked.texel_faces)
    here = points.mask
    expected = baked.maps["position"].values[here]
    np.testing.assert_allclose(points.positions[here], expected, atol=1e-6)


def test_what_cannot_be_is_an_error():
    with pytest.raises(UvError, match="no texture coordinates"):
        atlas_points(cube().replace(uvs=None, uv_faces=None), 64)
    for size in (0, (64, -1), 4.5, (4, 4, 4), "4", 10**6, None):
        with pytest.raises(OptionError, match="size: "):
            atlas_points(plane(), size)
    assert atlas_points(plane(), np.int64(4)).mask.shape == (4, 4)
