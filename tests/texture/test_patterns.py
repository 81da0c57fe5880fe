"""Checker, stripes, marble, wood and granite: closed forms at points, means over pixels."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake.core import core
from texbake.texture.procedures import evaluate
from texbake.texture.procedures.noise import WEIGHTS
from texbake.texture.procedures.options import DEFAULT_RAMPS
from texbake.texture.procedures.patterns import HARD, RAMP, SINE, own_ramp


def mean_of_pulse(pattern, width, phase, span):
    """The value of a stripe at one point, in a pixel so many periods wide."""
    points, out = np.array([[phase]]), np.empty((1, 1), dtype=np.float32)
    core.fill_stripes(
        points, np.array([[span]], dtype=np.float32), np.eye(3)[0], out, pattern, width, 0, 1
    )
    return out[0, 0]


def pattern_at(pattern, width, phase):
    """The three patterns as their module describes them."""
    t = phase - np.floor(phase)
    first = t < width
    along = np.where(first, t / width, (1 - t) / (1 - width))
    if pattern == HARD:
        return first.astype(float)
    if pattern == SINE:
        return 0.5 + np.where(first, 0.5, -0.5) * np.sin(np.pi * along)
    return along


@pytest.mark.parametrize("pattern", [HARD, SINE, RAMP])
@settings(max_examples=80)
@given(
    width=st.floats(0.05, 0.95),
    phase=st.floats(-1000, 1000),
    span=st.floats(0.015625, 20.0, width=32),
)
def test_the_mean_of_a_pulse_is_the_mean_over_the_interval(pattern, width, phase, span):
    n = 20_000
    places = phase + span * ((np.arange(n) + 0.5) / n - 0.5)
    brute = pattern_at(pattern, width, places).mean()
    # The sum has an error of one step, 1 / n, at each of up to 42 edges; smooth ones far less.
    assert mean_of_pulse(pattern, width, phase, span) == pytest.approx(brute, abs=42 / n)


@pytest.mark.parametrize("pattern", [HARD, SINE, RAMP])
def test_without_a_span_it_is_the_value(pattern):
    for phase in np.random.default_rng(0).uniform(-9, 9, 200):
        value = mean_of_pulse(pattern, 0.3, phase, 0.0)
        # Moved by 2^-30 where it is hard, on which no random point lies. Values are float32.
        assert value == pytest.approx(pattern_at(pattern, 0.3, phase), abs=1e-7)


def grid(n_columns, seed=0, n=400):
    return np.random.default_rng(seed).uniform(-20, 20, (n, n_columns))


@pytest.mark.parametrize("n_columns", [2, 3])
def test_checker_is_the_parity_of_its_cells(n_columns):
    points = grid(n_columns)
    parity = np.floor(points).sum(axis=1) % 2
    np.testing.assert_array_equal(evaluate("checker", points)[:, 0], 1.0 - parity)


def test_a_plane_checker_of_points_with_three_coordinates():
    points = grid(3)
    flat = evaluate("checker", points, parameters={"dimensions": 2})
    np.testing.assert_array_equal(flat, evaluate("checker", points[:, :2]))


@pytest.mark.parametrize("n_columns", [2, 3])
@pytest.mark.parametrize("width", [0.2, 0.9, 1.7, 3.1])
def test_filtered_checker_is_the_mean_over_the_pixel(n_columns, width):
    points = grid(n_columns, n=30)
    n = 48
    steps = width * ((np.arange(n) + 0.5) / n - 0.5)
    offsets = np.stack(np.meshgrid(*[steps] * n_columns), axis=-1).reshape(-1, n_columns)
    for point, found in zip(
        points, evaluate("checker", points, np.full(30, width))[:, 0], strict=True
    ):
        brute = evaluate("checker", point + offsets).mean()
        # Along each axis up to four edges, each wrong by half a step at most: 2 / n of a share.
        assert found == pytest.approx(brute, abs=n_columns * 2 / n)


def test_a_width_along_each_axis():
    points, widths = grid(3, n=20), np.array([0.7, 0.0, 1.3])
    steps = (np.arange(400) + 0.5) / 400 - 0.5
    x, z = np.meshgrid(widths[0] * steps, widths[2] * steps)
    offsets = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)
    found = evaluate("checker", points, np.tile(widths, (20, 1)))[:, 0]
    brute = [evaluate("checker", point + offsets).mean() for point in points]
    np.testing.assert_allclose(found, brute, atol=4 / 400)


def test_a_face_between_two_layers_shows_one_of_them_whatever_rounding_does():
    z = 1.0 + np.array([-2.0, -1.0, 0.0, 1.0, 2.0]) * 2.0**-50
    points = np.stack([np.full(5, 0.5), np.full(5, 0.5), z], axis=1)
    assert np.ptp(evaluate("checker", points)) == 0.0
    assert np.ptp(evaluate("checker", points, np.tile([0.1, 0.1, 0.0], (5, 1)))) == 0.0
    assert evaluate("checker", points, np.tile([0.1, 0.1, 0.0], (5, 1)))[0, 0] == 0.0


SOLIDS = pytest.mark.parametrize("name", ["marble", "wood", "granite"])


@pytest.fixture
def points():
    return np.random.default_rng(0).uniform(-20.0, 20.0, (40_000, 3))


def test_marble_is_the_formula(points):
    parameters = {"frequency": 3.0, "turbulence_frequency": 1.5, "amount": 4.0, "seed": 9}
    parameters["direction"] = (0.0, 3.0, 4.0)
    found = evaluate("marble", points, parameters=parameters, scalar=True)[:, 0]
    size = WEIGHTS["cubic"].bound * sum(0.25**i for i in range(6)) ** 0.5
    turbulence = evaluate("turbulence", 1.5 * points, parameters={"seed": 9})[:, 0]
    phase = 3.0 * points @ (0.0, 0.6, 0.8) + 4.0 * size * turbulence
    np.testing.assert_allclose(found, 0.5 + 0.5 * np.sin(phase), atol=2e-6)


@pytest.mark.parametrize(("procedure", "parameters", "widths"), [
    ("stripes", {"profile": "sine"}, (0.3, 1.0, 2.5)),
    ("marble", {"amount": 0.0, "frequency": 2 * np.pi}, (0.05, 0.3, 0.9)),
])  # fmt: skip
def test_sines_fade_with_their_mean(points, procedure, parameters, widths):
    for width in widths:
        step = np.full(len(points), width)
        found = evaluate(procedure, points, step, parameters=parameters, scalar=True)[:, 0]
        expected = 0.5 + 0.5 * np.sin(2 * np.pi * points[:, 0]) * np.sinc(width)
        np.testing.assert_allclose(found, expected, atol=1e-6)


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


def test_granite_has_as_much_of_each_stop_as_of_any_other(points):
    values = evaluate("granite", points, scalar=True)[:, 0]
    shares = np.histogram(values, bins=8, range=(0.0, 1.0))[0] / len(values)
    # A sum of four octaves is only nearly normal: a fourth more or less of an eighth.
    np.testing.assert_allclose(shares, 1 / 8, atol=0.25 / 8)


@SOLIDS
def test_colors_of_solids_are_those_of_the_ramp_at_the_value(points, name):
    values = evaluate(name, points, scalar=True)[:, 0]
    stops = np.array(DEFAULT_RAMPS[name])
    places = np.linspace(0, 1, len(stops))
    expected = np.stack([np.interp(values, places, channel) for channel in stops.T], axis=1)
    # Slopes of ramps up to 3 times float32 rounding of the value.
    np.testing.assert_allclose(evaluate(name, points), expected, atol=1e-6)


@SOLIDS
def test_means_of_solids_do_not_change_with_the_pixel_and_wide_ones_show_it(points, name):
    exact = evaluate(name, points).mean(axis=0)
    value = evaluate(name, points, scalar=True).mean()
    for width in (0.01, 0.05, 0.2, 1.0, np.inf):
        widths = np.full(len(points), width)
        # Phases of veins and rings are even, values of granite nearly; see the tests above.
        np.testing.assert_allclose(evaluate(name, points, widths).mean(axis=0), exact, atol=0.012)
        assert evaluate(name, points, widths, scalar=True).mean() == pytest.approx(value, abs=0.012)
    found = evaluate(name, points, np.full(len(points), 1e3))
    mean = own_ramp(name, "sine" if name == "marble" else "even").mean
    np.testing.assert_allclose(found, np.tile(mean, (len(points), 1)), atol=1e-6)


def test_wood_turns_with_its_axis(points):
    turned = points[:, [2, 0, 1]]  # x to y, y to z, z to x
    parameters = {"wobble": 0.0, "grain": 0.0}
    np.testing.assert_allclose(
        evaluate("wood", turned, parameters=parameters | {"axis": (0.0, 0.0, 2.0)}),
        evaluate("wood", points, parameters=parameters),
        atol=1e-6,
    )
