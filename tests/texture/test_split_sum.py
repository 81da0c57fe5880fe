import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.texture.prefilter import split_sum_table


def integrated(roughness, n_v, n_theta=800, n_phi=400):
    """Scale and bias by plain summation over the light's hemisphere, after the BRDF of glTF 2.0.

    Polar about the mirrored direction, where the lobe is, finer toward it.
    """
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
def test_it_is_the_integral_of_the_brdf(row, column):
    expected = integrated((row + 0.5) / 64, (column + 0.5) / 64)
    # Evenly spread samples of a smooth integrand are off by some (ln n) / n, 0.01, times what the
    # integrand varies from stratum to stratum; a hundredth of that is allowed, and holds.
    np.testing.assert_allclose(split_sum_table()[row, column], expected, atol=2e-4)


def test_a_mirror_reflects_by_schlicks_fresnel():
    table = split_sum_table(64)
    n_v = (np.arange(64) + 0.5) / 64
    fresnel = (1 - n_v) ** 5
    # At the least roughness, 1/128, alpha is 6e-5; from the flattest views the lobe is cut.
    np.testing.assert_allclose(table[0, 2:, 0], 1 - fresnel[2:], atol=2e-3)
    np.testing.assert_allclose(table[0, 2:, 1], fresnel[2:], atol=2e-3)


def test_no_surface_reflects_more_than_falls_on_it():
    table = split_sum_table()
    assert table.min() >= 0.0
    assert table.sum(axis=2).max() <= 1.0 + 1e-6
    # Rougher is darker: light is lost between facets, from above.
    # From roughness 1/4 on that is more than the float32 rounding of a sum near 1.
    assert (np.diff(table[16:, -1].sum(axis=1)) < 0).all()


def test_it_is_computed_once_and_cannot_be_changed():
    assert split_sum_table() is split_sum_table()
    assert split_sum_table(2).shape == (2, 2, 2)
    with pytest.raises(ValueError, match="read-only"):
        split_sum_table()[0] = 1
    with pytest.raises(OptionError, match="size: 0"):
        split_sum_table(0)
