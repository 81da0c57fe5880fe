"""Denoised maps: less noise against closed forms, and edges that stay as they are."""

import dataclasses

import numpy as np
import pytest

from texbake import BakeOptions, Mesh, bake
from texbake.baking.maps import MAPS
from texbake.baking.texel_values import denoised
from texbake.mesh.compose import join_meshes
from texbake.mesh.shapes import plane

RAW = BakeOptions(
    size=64, maps=("ao",), front=0.05, back=0.05, padding=0, denoise=False, on_miss="neutral"
)
CLEAN = dataclasses.replace(RAW, denoise=True)


def field(values, *, charts=None, has_data=None, rays=64, name="ao", threads=None):
    """A filtered map of one channel."""
    values = np.asarray(values, dtype=np.float32)
    charts = np.zeros(values.shape, np.int32) if charts is None else charts
    has_data = np.ones(values.shape, np.bool_) if has_data is None else has_data
    options = BakeOptions(secondary_rays=rays, threads=threads)
    return denoised(values[..., np.newaxis].copy(), MAPS[name], charts, has_data, options)[..., 0]


@pytest.mark.parametrize("rays", [64, 1024])
def test_noise_falls_and_larger_edges_stay(rays):
    rng = np.random.default_rng(1)
    limit = 4.5 * 1.3 * rays**-0.75 * 0.5  # of two values with the mean 0.5
    noise = rng.normal(0.0, 0.1 * limit, (300, 70))
    # 21 weights that fall to 4/9 of the first one reduce noise as much as 17 equal ones.
    assert field(0.5 + noise, rays=rays).std() < 0.3 * noise.std()
    edge = (0.5 + 0.505 * limit * np.where(np.arange(70) < 35, -1, 1)) * np.ones((300, 1))
    np.testing.assert_array_equal(field(edge, rays=rays), edge.astype(np.float32))
    spot = np.full((9, 9), 0.5)
    spot[4, 4] += 1.05 * limit
    np.testing.assert_array_equal(field(spot, rays=rays), spot.astype(np.float32))


def test_no_value_leaves_the_range_of_its_neighbors_and_a_slope_stays():
    values = np.random.default_rng(2).uniform(0, 1, (40, 40))
    filtered = field(values)
    assert np.abs(filtered - values).max() < 4.5 * 1.3 * 64**-0.75 * 0.5
    slope = np.linspace(0.2, 0.8, 60) * np.ones((60, 1))
    inner = (slice(2, -2), slice(2, -2))
    np.testing.assert_allclose(field(slope)[inner], slope[inner], atol=1e-4)


def test_charts_and_misses_are_not_mixed():
    rng = np.random.default_rng(3)
    values = rng.normal(0.5, 0.01, (30, 40)).astype(np.float32)
    charts = (np.arange(40) >= 20).astype(np.int32) * np.ones((30, 1), np.int32)
    has_data = rng.uniform(size=(30, 40)) < 0.8
    other = np.where(charts == 1, values + 0.02, values)
    other[~has_data] = 0.51
    filtered = [field(some, charts=charts, has_data=has_data) for some in (values, other)]
    mine = (charts == 0) & has_data
    np.testing.assert_array_equal(filtered[0][mine], filtered[1][mine])
    np.testing.assert_array_equal(filtered[1][~has_data], other[~has_data])


def test_thickness_is_filtered_in_proportion_to_itself():
    noise = np.random.default_rng(4).normal(1.0, 0.01, (300, 50))
    small, large = (field(scale * noise, name="thickness") for scale in (0.5, 8.0))
    np.testing.assert_array_equal(16.0 * small, large)
    assert small.std() < 0.3 * 0.5 * noise.std()


@pytest.mark.parametrize("rays", [1, 4, 16, 64])
@pytest.mark.parametrize("share", [0.004, 0.996])
def test_rare_hits_are_averaged_with_neighbors_that_have_none(rays, share):
    """The neighbors are equal, all 0 or all 1, where the noise of shares is 0."""
    values = np.random.default_rng(6).binomial(rays, share, (200, 200)) / rays
    filtered = field(values, rays=rays)
    rare = min(share, 1.0 - share)
    assert 0.7 * rare < np.abs(filtered - np.round(share)).mean() < 1.1 * rare
    assert filtered.std() < 0.7 * values.std()


def wall(height):
    """The unit square under a wall across its middle, 50 units to either side."""
    corners = [[0.5, -50, 0], [0.5, 50, 0], [0.5, 50, height], [0.5, -50, height]]
    upright = Mesh(positions=corners, faces=[[0, 1, 2], [0, 2, 3]])
    return join_meshes([plane(8, 8).replace(uvs=None, uv_faces=None), upright])


@pytest.mark.parametrize("height", [0.05, 0.4])
def test_the_foot_of_a_wall_has_its_closed_form(height):
    x = np.abs((np.arange(64) + 0.5) / 64 - 0.5)
    expected = 0.5 + 0.5 * x / np.hypot(x, height) * np.ones((64, 1))
    raw, clean = (
        bake(wall(height), plane(), options).maps["ao"].values[..., 0] - expected
        for options in (RAW, CLEAN)
    )
    assert np.sqrt(np.square(clean).mean()) < 0.75 * np.sqrt(np.square(raw).mean())
    # The texels at the foot, where ao changes by a third from one to the next at the low wall.
    foot = slice(31, 33)
    # It is smoothed by less than the standard error of one texel.
    assert abs(clean[:, foot].mean()) < 0.5 * 1.3 * 64**-0.75
