import numpy as np

from texbake.mesh.oklch import diverging, linear_from_oklch


def test_ends_of_lightness():
    # 1e-6: the matrices are published with ten digits.
    assert np.allclose(linear_from_oklch(1.0, 0.0, 0.0), 1.0, atol=1e-6)
    assert np.allclose(linear_from_oklch(0.0, 0.0, 0.0), 0.0)
    # Grays are cubes of their lightness.
    assert np.allclose(linear_from_oklch(0.5, 0.0, 123.0), 0.125, atol=1e-6)


def test_primaries_of_srgb():
    # Lightness, chroma and hue of red, green and blue from Ottosson's page.
    lch = np.array(
        [[0.62796, 0.25768, 29.234], [0.86644, 0.29483, 142.495], [0.452, 0.313, 264.05]]
    )
    colors = linear_from_oklch(*lch.T)
    assert np.allclose(colors, np.eye(3), atol=3e-3)  # the rounding of these digits


def test_a_scale_that_darkens_evenly_to_both_sides():
    levels = np.linspace(-1.0, 1.0, 41)
    colors = diverging(levels)
    luminance = colors @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(luminance[:21]) > 0.0).all() and (np.diff(luminance[20:]) < 0.0).all()
    assert np.ptp(colors[20]) < 1e-6
    low, high = colors[0], colors[-1]
    assert low.argmax() == 2  # blue ...
    assert high.argmax() == 0
    assert high[1] > 0.2 * high[0]  # ... and amber, which is no red
    assert np.array_equal(diverging([-9.0, 9.0]), colors[[0, -1]])
