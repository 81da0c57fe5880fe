"""The classical rasterizer against the one that evaluates everything anew at each sample."""

import numpy as np
import pytest

from texbake.mesh.shapes import cube, grid_sphere, icosphere
from texbake.rendering.camera import Camera
from texbake.rendering.fragments import fragment_rows, weights_at
from texbake.rendering.options import RenderOptions
from texbake.rendering.rasterize import CULL_BACK, SHOW_BACK, joined, rasterize, rasterize_scanlines

WIDTH, HEIGHT = 200, 150


def both(mesh, view, mode, fov=35.0):
    options = RenderOptions(view=view, fov=fov)
    matrix = Camera.framing(mesh, options=options).clip_from_world(WIDTH / HEIGHT)
    world = joined([(mesh.positions, mesh.faces)])
    modes = np.array([mode], np.uint8)
    expected = rasterize(world, matrix, WIDTH, HEIGHT, modes=modes)
    visibility, weights = rasterize_scanlines(world, matrix, WIDTH, HEIGHT, modes=modes)
    rows = fragment_rows(expected.face_ids, world, (0, HEIGHT), side=1)
    computed, _, _ = weights_at(world, matrix, WIDTH, HEIGHT, rows.faces, rows.places)
    return expected, visibility, weights, computed


@pytest.mark.parametrize("mode", [CULL_BACK, SHOW_BACK])
@pytest.mark.parametrize("view", [(0.0, 0.0), (33.0, 21.0), (200.0, -60.0), (20.0, 5.0, 0.3)])
@pytest.mark.parametrize("mesh", [cube(), icosphere(3), grid_sphere(40, 60)], ids=lambda m: m.name)
def test_both_rasterizers_see_the_same(mesh, view, mode):
    expected, visibility, weights, computed = both(mesh, view, mode)
    covered = expected.face_ids >= 0
    # Which samples are covered is decided by whole numbers in both.
    np.testing.assert_array_equal(visibility.face_ids >= 0, covered)
    same = visibility.face_ids[covered] == expected.face_ids[covered]
    # Where triangles meet in front of one another depths may round differently.
    assert same.size == 0 or same.mean() > 0.999
    np.testing.assert_allclose(visibility.depths[covered], expected.depths[covered], rtol=1e-5)
    # Both step in float64. One clamps weights beyond an edge to 0 and shares out the rest, which
    # for needles thinner than a step of the grid (at the poles) is all there is of them.
    apart = np.abs(weights[covered][same] - computed[same])
    assert apart.size == 0 or np.quantile(apart, 0.999) < 0.02


def test_a_plane_to_the_horizon_is_correct_in_perspective():
    from texbake.mesh.shapes import plane

    mesh = plane(1, 1)
    _, visibility, weights, computed = both(mesh, (30.0, 25.0, 0.9), SHOW_BACK)
    covered = visibility.face_ids >= 0
    assert covered.sum() > 5000
    # Two large triangles: 1e-9 is what rounding gathers over the longest span.
    inside = (computed.min(axis=1) > 1e-6) & (computed.sum(axis=1) < 1 - 1e-6)
    assert np.abs(weights[covered] - computed)[inside].max() < 1e-9
