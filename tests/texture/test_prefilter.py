"""Environments filtered for diffuse and rough reflections, and the split-sum table."""

import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.texture.cube_map import (
    CubeMap,
    resize_cube,
    sample_cube,
    solid_angles,
    texel_directions,
)
from texbake.texture.prefilter import irradiance, specular_levels, split_sum_table


def cube_of(function, size=64):
    return CubeMap(np.asarray(function(texel_directions(size).astype(np.float64)), np.float32))


def lamp(directions):
    """A small lamp over a dim room, with |its| gradient everywhere finite."""
    middle = np.array([0.6, 0.64, 0.48])
    return 0.2 + 50.0 * np.exp(-60.0 * (1.0 - directions @ middle))[..., None]


def rough_reference(cube, normals, roughness):
    """Mean over all texels, weighted by D (n·h) cos: what sampling the lobe comes to."""
    directions = texel_directions(cube.size).reshape(-1, 3).astype(np.float64)
    weights = np.tile(solid_angles(cube.size).ravel(), 6)
    cosines = normals @ directions.T
    half2 = (1.0 + cosines) / 2.0  # (n·h)², where the view is the normal
    lobe = weights * np.maximum(cosines, 0.0) / (half2 * (roughness**4 - 1.0) + 1.0) ** 2
    return lobe @ cube.faces.reshape(len(directions), -1) / lobe.sum(axis=1, keepdims=True)


def test_a_constant_environment_lights_constantly():
    value = np.array([0.1, 700.3, 1e-4], np.float32)
    cube = CubeMap(np.broadcast_to(value, (6, 40, 40, 3)))
    assert (irradiance(cube, size=5).faces == value).all()
    chain = specular_levels(cube, n_levels=4, size=16, samples=32)
    assert (chain.texels == value).all()
    assert chain.sizes.tolist() == [16, 8, 4, 2]


def test_irradiance_of_first_order_harmonics_is_two_thirds_of_them():
    """Ramamoorthi and Hanrahan: A0 = pi, A1 = 2 pi / 3, A2 = pi / 4."""

    def light(d):
        x, y, z = np.moveaxis(d, -1, 0)
        return np.stack([1 + x, 1 - y, 1 + x * z, 1 + (3 * z * z - 1) / 2], axis=-1)

    found = irradiance(cube_of(light), size=6).faces
    x, y, z = np.moveaxis(texel_directions(6), -1, 0)
    quarter = np.stack([x * z / 4, (3 * z * z - 1) / 8], axis=-1)
    np.testing.assert_allclose(found[..., 0], 1 + 2 / 3 * x, atol=5e-4)
    # The midpoint rule with h = 2/32 as above; sums over all texels cancel most of it.
    np.testing.assert_allclose(found[..., 1], 1 - 2 / 3 * y, atol=5e-4)
    np.testing.assert_allclose(found[..., 2:], 1 + quarter, atol=5e-4)


def test_irradiance_of_a_strong_small_sun_is_never_negative():
    faces = np.zeros((6, 64, 64, 1), np.float32)
    faces[2, 40, 21] = 1e5
    found = irradiance(CubeMap(faces), size=16)
    assert found.faces.min() >= 0.0
    assert (found.faces == 0).mean() > 0.4  # behind it there is none, which harmonics cannot say
    # In its direction: radiance times solid angle, over pi; the texel is spread over 2 x 2.
    direction = texel_directions(64)[2, 40, 21]
    peak = sample_cube(found, direction[None])[0, 0]
    assert peak == pytest.approx(1e5 * solid_angles(64)[40, 21] / np.pi, rel=0.01)


def test_level_0_is_the_mirror():
    cube = cube_of(lamp, 32)
    np.testing.assert_array_equal(specular_levels(cube, size=32).level(0).faces, cube.faces)
    smaller = specular_levels(cube, n_levels=1, size=8)
    np.testing.assert_array_equal(smaller.level(0).faces, resize_cube(cube, 8).faces)
    assert smaller.n_levels == 1


def test_levels_are_the_integrals_of_their_lobes():
    cube = cube_of(lamp)
    chain = specular_levels(cube, n_levels=6, size=64)
    previous = cube.faces.max()
    for index in range(1, 6):
        level = chain.level(index)
        some = slice(None, None, max(level.size // 2, 1))
        normals = texel_directions(level.size).reshape(-1, 3)[some].astype(np.float64)
        expected = rough_reference(cube, normals, index / 5)
        error = level.faces.reshape(-1, 1)[some] - expected
        # Each sample represents a part of the lobe and is read from a level that wide, which blurs
        # what is sharper: some percent of the peak, least where samples are most.
        assert np.sqrt(np.mean(error**2)) < 0.015 * expected.max()
        assert np.abs(error).max() < 0.08 * expected.max()
        assert expected.max() < previous
        previous = expected.max()


def test_numbers_out_of_range():
    cube = CubeMap(np.ones((6, 2, 2, 1), np.float32))
    for name, value in ("n_levels", 0), ("size", 0), ("samples", 15):
        with pytest.raises(OptionError, match=f"{name}: {value} is too small"):
            specular_levels(cube, **{name: value})
    with pytest.raises(OptionError, match="size: 0"):
        irradiance(cube, size=0)
    # The fewest samples, the smallest sizes: still a number everywhere.
    chain = specular_levels(cube, n_levels=9, size=3, samples=16)
    assert chain.sizes.tolist() == [3, 1, 1, 1, 1, 1, 1, 1, 1]
    assert (chain.texels == 1).all()


def integrated(roughness, n_v, n_theta=800, n_phi=400):
    """Scale and bias by summation over the hemisphere, finer at the lobe, as glTF 2.0 has it."""
    alpha2 = roughness**4
    view = np.array([np.sqrt(1 - n_v**2), 0.0, n_v])
    mirrored = np.array([-view[0], 0.0, n_v])
    u = (np.arange(n_theta) + 0.5) / n_theta
    theta, d_theta = np.pi * u**3, 3 * np.pi * u**2 / n_theta
    phi = (np.arange(n_phi) + 0.5) / n_phi * 2 * np.pi
    theta, phi = np.meshgrid(theta, phi, indexing="ij")
    side = np.array([mirrored[2], 0.0, -mirrored[0]])
    light = (
        np.cos(theta)[..., None] * mirrored
        + (np.sin(theta) * np.cos(phi))[..., None] * side
        + (np.sin(theta) * np.sin(phi))[..., None] * np.array([0.0, 1.0, 0.0])
    )
    half = light + view
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    n_l, n_h, v_h = light[..., 2], half[..., 2], half @ view
    distribution = alpha2 / (np.pi * (n_h**2 * (alpha2 - 1) + 1) ** 2)
    lit = n_l > 0
    n_l = np.where(lit, n_l, 1.0)
    visibility = 0.5 / (
        n_l * np.sqrt(n_v**2 * (1 - alpha2) + alpha2)
        + n_v * np.sqrt(n_l**2 * (1 - alpha2) + alpha2)
    )
    weight = np.where(lit, distribution * visibility * n_l, 0.0) * np.sin(theta)
    weight *= d_theta[:, None] * 2 * np.pi / n_phi
    fresnel = (1 - v_h) ** 5
    return (weight * (1 - fresnel)).sum(), (weight * fresnel).sum()


@pytest.mark.parametrize(("row", "column"), [(10, 60), (20, 5), (31, 31), (50, 20), (63, 63)])
def test_split_sum_is_the_integral_of_the_brdf(row, column):
    expected = integrated((row + 0.5) / 64, (column + 0.5) / 64)
    # Evenly spread samples of a smooth integrand are off by some (ln n) / n, 0.01, times what the
    # integrand varies from stratum to stratum; a hundredth of that is allowed, and holds.
    np.testing.assert_allclose(split_sum_table()[row, column], expected, atol=2e-4)


def test_no_surface_reflects_more_than_falls_on_it():
    table = split_sum_table()
    assert table.min() >= 0.0 and table.sum(axis=2).max() <= 1.0 + 1e-6
    # Rougher is darker: light is lost between facets, from above.
    # From roughness 1/4 on that is more than the float32 rounding of a sum near 1.
    assert (np.diff(table[16:, -1].sum(axis=1)) < 0).all()
