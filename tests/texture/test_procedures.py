"""Tests shared by all procedures."""

import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.texture.procedures import evaluate
from texbake.texture.procedures.evaluation import PROCEDURES
from texbake.texture.procedures.options import (
    DEFAULT_RAMPS,
    PROCEDURE_DEFAULTS,
    PROCEDURE_NAMES,
    checked_parameters,
)

EACH = pytest.mark.parametrize("name", PROCEDURE_NAMES)
ODD = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e18, 1e9, -1e9, -0.0, 5e-324]


def test_they_are_those_of_the_options():
    assert tuple(PROCEDURES) == PROCEDURE_NAMES == tuple(DEFAULT_RAMPS)
    for name, procedure in PROCEDURES.items():
        assert procedure.name == name
        assert procedure.defaults == PROCEDURE_DEFAULTS[name]


@EACH
def test_shapes_and_range_and_values_at_odd_points_and_pixels(name):
    points = np.random.default_rng(0).uniform(-30, 30, (5000, 3))
    n_channels = 3 if name in ("marble", "wood", "granite") else 1
    assert PROCEDURES[name].n_channels == n_channels
    for rows, widths in (points, None), (points[:, :2], None), (points, np.full(5000, 0.3)):
        for scalar in (False, True):
            values = evaluate(name, rows, widths, scalar=scalar)
            assert values.dtype == np.float32
            assert values.shape == (5000, 1 if scalar else n_channels)
            assert values.min() >= 0.0 and values.max() <= 1.0
    assert evaluate(name, np.empty((0, 3))).shape == (0, n_channels)
    points = np.array([[x, y, 0.3] for x in ODD for y in ODD])
    widths = np.array([w for w in ODD for _ in ODD])
    assert np.isfinite(evaluate(name, points, widths)).all()
    assert np.isfinite(evaluate(name, points)).all()
    same = evaluate(name, [[np.nan, np.inf, 0.3], [0.0, 0.0, 0.3]])
    np.testing.assert_array_equal(same[0], same[1])


LARGE = ("frequency", "turbulence_frequency", "rings", "amount", "wobble", "octaves")


@pytest.mark.parametrize(
    ("name", "key"),
    [(name, key) for name in PROCEDURE_NAMES for key in LARGE if key in PROCEDURE_DEFAULTS[name]],
)
def test_extreme_parameters_have_values(name, key):
    points = np.array([[x, y, 0.3] for x in ODD for y in ODD])
    steep = {"octaves": 32, "lacunarity": 16.0, "gain": 1.0}
    for value in (0.0, 1e6):
        parameters = steep if key == "octaves" else {key: value}
        for widths in (None, np.full(len(points), 1e-3)):
            assert np.isfinite(evaluate(name, points, widths, parameters=parameters)).all()


@pytest.mark.parametrize("name", [n for n in PROCEDURE_NAMES if "seed" in PROCEDURE_DEFAULTS[n]])
def test_seeds_differ_and_repeat(name):
    points = np.random.default_rng(0).uniform(-3, 3, (2000, 3))
    first, other, again = (evaluate(name, points, parameters={"seed": seed}) for seed in (1, 2, 1))
    np.testing.assert_array_equal(first, again)
    assert (first != other).mean() > 0.8


@EACH
def test_no_pixel_is_a_pixel_without_width_and_points_have_any_order_of_memory(name):
    points = np.random.default_rng(0).uniform(-3, 3, (2000, 3))
    plain = evaluate(name, points)
    for widths in (np.zeros(2000), np.zeros((2000, 3)), np.full(2000, np.nan)):
        np.testing.assert_array_equal(evaluate(name, points, widths), plain)
    points = np.random.default_rng(0).uniform(-3, 3, (500, 3))
    expected = evaluate(name, points)
    np.testing.assert_array_equal(evaluate(name, np.asfortranarray(points)), expected)
    np.testing.assert_array_equal(evaluate(name, points.tolist()), expected)


@pytest.mark.parametrize(("name", "parameters", "words"), [
    ("marbel", {}, "procedure: 'marbel' is not known; it is one of checker, stripes"),
    ("checker", {"seed": 1}, r"checker\.seed: it is not a parameter of checker; those are dim"),
    ("noise", {"weight": "linear"}, r"noise\.weight: 'linear' is not known; give one of cub"),
    ("noise", {"weight": np.zeros(2)}, r"noise\.weight: array\(\[0\., 0\.\]\) is not known"),
    ("noise", {"seed": 1.5}, r"noise\.seed: 1\.5 is not a whole number; give one such as 7"),
    ("fractal", {"octaves": 0}, r"fractal\.octaves: 0 is not right; give a whole number from"),
    ("fractal", {"gain": float("nan")}, r"fractal\.gain: nan is not right; give a number from"),
    ("stripes", {"width": 1.0}, r"stripes\.width: 1\.0 is not right; give a number between 0"),
    ("stripes", {"direction": (0, 0, 0)}, r"stripes\.direction: \(0, 0, 0\) is not a dir"),
    ("wood", {"axis": (0, float("inf"), 0)}, r"wood\.axis: .* is not a direction"),
    ("wood", {"rings": -1}, r"wood\.rings: -1 is not right; give a number from 0 to 1e\+06"),
])  # fmt: skip
def test_wrong_parameters_are_one_clear_error(name, parameters, words):
    with pytest.raises(OptionError, match=words) as error:
        evaluate(name, [[0.0, 0.0, 0.0]], parameters=parameters)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("points", "footprint", "words"), [
    (np.zeros(3), None, r"points: the shape \(3,\)"),
    (np.zeros((2, 4)), None, r"points: the shape \(2, 4\)"),
    (np.zeros((2, 3)), np.zeros(3), r"footprint: the shape \(3,\) is not \(2,\)"),
    (np.zeros((2, 3)), np.zeros((2, 2)), r"footprint: the shape \(2, 2\)"),
])  # fmt: skip
def test_wrong_shapes_are_one_clear_error(points, footprint, words):
    with pytest.raises(OptionError, match=words):
        evaluate("noise", points, footprint)


def test_numbers_of_numpy_are_numbers():
    given = {"seed": np.int64(3), "octaves": np.int32(2), "gain": np.float32(0.5)}
    full = checked_parameters("fractal", given)
    assert (full["seed"], full["octaves"], full["gain"]) == (3, 2, 0.5)
    assert all(type(full[key]) in (int, float) for key in given)
