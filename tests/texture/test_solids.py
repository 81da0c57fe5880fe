"""Marble, wood and granite: their formulas, and what wide pixels make of them."""

import numpy as np
import pytest

from texbake.texture.procedures import DEFAULT_RAMPS, evaluate, turbulence_sum
from texbake.texture.procedures.ramps import own_ramp

SOLIDS = pytest.mark.parametrize("name", ["marble", "wood", "granite"])


@pytest.fixture
def points():
    return np.random.default_rng(0).uniform(-20.0, 20.0, (40_000, 3))


def test_marble_is_the_formula(points):
    parameters = {"frequency": 3.0, "turbulence_frequency": 1.5, "amount": 4.0, "seed": 9}
    found = evaluate("marble", points, parameters=parameters, scalar=True)[:, 0]
    phase = 3.0 * points[:, 0] + 4.0 * turbulence_sum(1.5 * points, seed=9)
    np.testing.assert_allclose(found, 0.5 + 0.5 * np.sin(phase), atol=1e-6)


def test_marble_runs_across_its_direction(points):
    parameters = {"amount": 0.0, "direction": (0.0, 3.0, 4.0)}
    found = evaluate("marble", points, parameters=parameters, scalar=True)[:, 0]
    along = 0.6 * points[:, 1] + 0.8 * points[:, 2]
    np.testing.assert_allclose(found, 0.5 + 0.5 * np.sin(6.0 * along), atol=1e-6)


@pytest.mark.parametrize("width", [0.05, 0.3, 0.9])
def test_layers_of_marble_fade_with_the_mean_of_a_sine(points, width):
    parameters = {"amount": 0.0, "frequency": 2 * np.pi}
    found = evaluate(
        "marble", points, np.full(len(points), width), parameters=parameters, scalar=True
    )
    expected = 0.5 + 0.5 * np.sin(2 * np.pi * points[:, 0]) * np.sinc(width)
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-6)


def test_turbulence_that_fades_takes_contrast_of_the_veins_with_it():
    """Where only the turbulence varies, the mean over a wide pixel, from 200,000 points of it."""
    rng = np.random.default_rng(1)
    points = rng.uniform(0.0, 256.0, (200_000, 3))
    points[:, 0] = 0.25
    # x is held; the noise is taken from a plane that is not one of its lattice.
    parameters = {"frequency": 1e-3, "turbulence_frequency": 1.37, "amount": 3.0}
    exact = evaluate("marble", points, parameters=parameters, scalar=True).mean()
    faded = evaluate("marble", points[:1], [50.0], parameters=parameters, scalar=True)[0, 0]
    # The distribution of turbulence is skewed, not normal: two percent of the contrast.
    assert faded == pytest.approx(exact, abs=0.03)


def test_wood_without_wobble_and_grain_is_rings(points):
    parameters = {"wobble": 0.0, "grain": 0.0, "rings": 2.0}
    found = evaluate("wood", points, parameters=parameters, scalar=True)[:, 0]
    t = 2.0 * np.hypot(points[:, 0], points[:, 2]) % 1.0
    np.testing.assert_allclose(found, np.where(t < 0.8, t / 0.8, (1 - t) / 0.2), atol=1e-6)


def test_wood_turns_with_its_axis(points):
    turned = points[:, [2, 0, 1]]  # x to y, y to z, z to x
    parameters = {"wobble": 0.0, "grain": 0.0}
    np.testing.assert_allclose(
        evaluate("wood", turned, parameters=parameters | {"axis": (0.0, 0.0, 2.0)}),
        evaluate("wood", points, parameters=parameters),
        atol=1e-6,
    )


def test_fibers_of_wood_run_along_the_axis(points):
    here = 0.1 * points
    base = evaluate("wood", here, scalar=True)
    along = evaluate("wood", here + np.array([0.0, 0.02, 0.0]), scalar=True)
    across = evaluate("wood", here + np.array([0.02, 0.0, 0.0]), scalar=True)
    assert np.abs(along - base).mean() < 0.1 * np.abs(across - base).mean()


def test_granite_has_as_much_of_each_stop_as_of_any_other(points):
    values = evaluate("granite", points, scalar=True)[:, 0]
    shares = np.histogram(values, bins=8, range=(0.0, 1.0))[0] / len(values)
    # A sum of four octaves is only nearly normal: a fourth more or less of an eighth.
    np.testing.assert_allclose(shares, 1 / 8, atol=0.25 / 8)


@SOLIDS
def test_colors_are_those_of_the_ramp_at_the_value(points, name):
    values = evaluate(name, points, scalar=True)[:, 0]
    stops = np.array(DEFAULT_RAMPS[name])
    places = np.linspace(0, 1, len(stops))
    expected = np.stack([np.interp(values, places, channel) for channel in stops.T], axis=1)
    # Slopes of ramps up to 3 times float32 rounding of the value.
    np.testing.assert_allclose(evaluate(name, points), expected, atol=1e-6)


@SOLIDS
def test_means_do_not_change_with_the_pixel(points, name):
    exact = evaluate(name, points).mean(axis=0)
    value = evaluate(name, points, scalar=True).mean()
    for width in (0.01, 0.05, 0.2, 1.0, np.inf):
        widths = np.full(len(points), width)
        # Phases of veins and rings are even, values of granite nearly; see the tests above.
        np.testing.assert_allclose(evaluate(name, points, widths).mean(axis=0), exact, atol=0.012)
        assert evaluate(name, points, widths, scalar=True).mean() == pytest.approx(value, abs=0.012)


@SOLIDS
def test_wide_pixels_show_the_mean_color(points, name):
    found = evaluate(name, points, np.full(len(points), 1e3))
    mean = own_ramp(name, "sine" if name == "marble" else "even").mean
    np.testing.assert_allclose(found, np.tile(mean, (len(points), 1)), atol=1e-6)


@SOLIDS
def test_contrast_falls_as_pixels_grow(points, name):
    spread = [
        evaluate(name, points, np.full(len(points), width), scalar=True).std()
        for width in (0.0, 0.02, 0.05, 0.1, 0.2, 0.5, 2.0)
    ]
    assert (np.diff(spread) <= 1e-6).all()
    assert spread[-1] < 0.02
