import numpy as np
import pytest

from texbake.texture.procedures import evaluate, fractal_sum, signed_noise, turbulence_sum
from texbake.texture.procedures.noise import WEIGHTS


@pytest.fixture
def points():
    return np.random.default_rng(0).uniform(-50.0, 50.0, (20_000, 3))


def test_fractal_and_turbulence_are_their_sums(points):
    shift = np.array([37, 17, 59])
    expected = sum(signed_noise(points * 2.0**i + i * shift, seed=5) / 2.0**i for i in range(6))
    np.testing.assert_allclose(fractal_sum(points, seed=5), expected, atol=1e-15)
    expected = sum(np.abs(signed_noise(points * 2.0**i, seed=5)) / 2.0**i for i in range(6))
    np.testing.assert_allclose(turbulence_sum(points, seed=5), expected, atol=1e-15)


def test_octaves_of_a_fractal_do_not_add_up_about_the_origin():
    """Next to the origin the slopes of all octaves are those of six different lattice points."""
    steps = 1e-6 * np.eye(3)
    for seed in range(5):
        shift = np.array([37, 17, 59])
        slopes = [signed_noise(steps + i * shift, seed=seed) / 1e-6 for i in range(6)]
        assert np.linalg.norm(np.sum(slopes, axis=0)) < 4.8  # 6 where they are all the same
        found = fractal_sum(steps, seed=seed) / 1e-6
        # Second-order terms of noise, 1e-6 times curvatures that double with each octave.
        np.testing.assert_allclose(found, np.sum(slopes, axis=0), atol=1e-3)


def test_lacunarity_and_gain(points):
    expected = signed_noise(points) + 0.7 * signed_noise(points * 1.9 + np.array([37, 17, 59]))
    found = fractal_sum(points, octaves=2, lacunarity=1.9, gain=0.7)
    np.testing.assert_allclose(found, expected, atol=1e-15)
    np.testing.assert_array_equal(fractal_sum(points, gain=0.0), signed_noise(points))


@pytest.mark.parametrize("weight", ["cubic", "quintic"])
def test_values_are_the_sums_scaled_to_0_and_1(points, weight):
    bound = WEIGHTS[weight].bound
    size = bound * sum(0.25**i for i in range(6)) ** 0.5
    pairs = [
        ("noise", 0.5 + signed_noise(points, weight=weight) / (2 * bound)),
        ("fractal", 0.5 + fractal_sum(points, weight=weight) / (2 * size)),
        ("turbulence", turbulence_sum(points, weight=weight) / size),
    ]
    for name, expected in pairs:
        found = evaluate(name, points, parameters={"weight": weight})
        np.testing.assert_allclose(found[:, 0], np.clip(expected, 0, 1), atol=1e-7)


def test_a_pixel_of_a_quarter_cell_changes_nothing_and_of_a_cell_leaves_the_mean(points):
    np.testing.assert_array_equal(
        signed_noise(points, np.full(len(points), 0.25)), signed_noise(points)
    )
    assert (signed_noise(points, np.ones(len(points))) == 0.0).all()
    size = WEIGHTS["cubic"].size[1]
    faded = turbulence_sum(points, np.full(len(points), np.inf), octaves=3)
    np.testing.assert_allclose(faded, size * 1.75, rtol=1e-12)


def test_octaves_fade_from_the_finest(points):
    """In a pixel of half a unit the octaves of 1/2 unit and finer are gone; the others are not."""
    width = np.full(len(points), 0.5)
    kept = 1.0 - (lambda t: t * t * (3.0 - 2.0 * t))((0.5 - 0.25) / 0.75)
    np.testing.assert_allclose(fractal_sum(points, width), kept * signed_noise(points), atol=1e-15)


@pytest.mark.parametrize("n_columns", [2, 3])
@pytest.mark.parametrize("weight", ["cubic", "quintic"])
@pytest.mark.parametrize("name", ["noise", "fractal", "turbulence"])
def test_means_do_not_change_with_the_pixel(points, name, weight, n_columns):
    plain = evaluate(name, points[:, :n_columns], parameters={"weight": weight}).mean()
    for width in (0.1, 0.5, 10.0):
        filtered = evaluate(
            name, points[:, :n_columns], np.full(len(points), width), parameters={"weight": weight}
        ).mean()
        # One seed differs from the mean of all by up to 5 percent of a mean of 0.3, in the plane.
        assert filtered == pytest.approx(plain, abs=0.015)


@pytest.mark.parametrize("width", [0.3, 0.5, 0.8])
def test_fading_is_between_the_point_and_the_mean_of_the_pixel(width):
    """Against a mean over the pixel's square in a tilted plane: never more contrast than that."""
    rng = np.random.default_rng(2)
    centers = rng.uniform(-100, 100, (2000, 3))
    across = rng.normal(size=(2000, 3))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    up = np.cross(across, rng.normal(size=(2000, 3)))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    steps = width * ((np.arange(8) + 0.5) / 8 - 0.5)
    grid = (
        centers[:, None, None]
        + steps[:, None, None] * across[:, None, None]
        + steps[:, None] * up[:, None, None]
    )
    exact = signed_noise(grid.reshape(-1, 3)).reshape(2000, 64).mean(axis=1)
    faded = signed_noise(centers, np.full(2000, width))
    assert np.std(faded) < 1.05 * np.std(exact)
    assert np.corrcoef(faded, exact)[0, 1] > 0.95
    if width <= 0.5:  # closer to the mean over the pixel than the point itself
        assert np.abs(faded - exact).mean() < 0.2 * np.abs(exact).mean()


def test_bad_widths_are_no_widths(points):
    plain = signed_noise(points)
    for odd in (0.0, -1.0, np.nan, -np.inf):
        np.testing.assert_array_equal(signed_noise(points, np.full(len(points), odd)), plain)


def test_signed_sums_check_their_parameters():
    with pytest.raises(ValueError, match=r"fractal\.octave: it is not a parameter"):
        fractal_sum([[0.0, 0.0, 0.0]], octave=3)
