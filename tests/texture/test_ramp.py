import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.texture.lookup import WRAPS, ramp_lookup

STOPS = np.array([[0.0, 1.0], [2.0, 0.5], [3.0, 4.0], [-1.0, 0.0]], np.float32)


def at(values, **options):
    return ramp_lookup(STOPS, np.asarray(values, np.float32), **options)


def test_stops_are_evenly_spaced_from_0_to_1():
    np.testing.assert_allclose(at([0, 1 / 3, 2 / 3, 1]), STOPS, atol=1e-6)


def test_between_stops_it_is_what_numpy_interpolates():
    values = np.random.default_rng(0).random(1000).astype(np.float32)
    expected = np.stack([np.interp(values, np.arange(4) / 3, c) for c in STOPS.T], axis=1)
    np.testing.assert_allclose(at(values), expected, atol=1e-6)


@pytest.mark.parametrize("wrap", WRAPS)
def test_outside_it_goes_on_as_its_wrap_mode_says(wrap):
    values = np.random.default_rng(0).uniform(-3, 4, 1000).astype(np.float32)
    inside = {
        "clamp": np.clip(values, 0, 1),
        "repeat": values.astype(np.float64) % 1.0,
        "mirror": 1.0 - abs(values.astype(np.float64) % 2.0 - 1.0),
        "border": np.clip(values, 0, 1),
    }[wrap]
    expected = at(inside)
    if wrap == "border":
        expected[(values < 0) | (values > 1)] = (7.0, 8.0)
    # Coordinates up to 4 are rounded differently here and there.
    np.testing.assert_allclose(at(values, wrap=wrap, border=(7.0, 8.0)), expected, atol=5e-6)


def test_both_ends_belong_to_a_ramp_with_a_border():
    np.testing.assert_array_equal(at([0.0, 1.0], wrap="border", border=9.0), STOPS[[0, -1]])


def test_one_stop_is_the_color_of_everything():
    odd = np.array([-1.0, 0.0, 0.5, 1.0, np.nan, np.inf, -np.inf], np.float32)
    for wrap in "clamp", "repeat", "mirror":
        assert (ramp_lookup(STOPS[1:2], odd, wrap=wrap) == STOPS[1]).all()


@pytest.mark.parametrize("wrap", WRAPS)
def test_odd_values_read_no_stop_that_is_not_there(wrap):
    odd = np.array([np.nan, np.inf, -np.inf, 1e38, -1e38, -1e-45, 1.0], np.float32)
    same = np.full((3, 1), np.float32(0.1))
    assert (ramp_lookup(same, odd, wrap=wrap, border=np.float32(0.1)) == np.float32(0.1)).all()
    assert at([np.nan], wrap=wrap).tolist() == [STOPS[0].tolist()]


def test_threads_change_nothing():
    values = np.random.default_rng(0).random(600_000).astype(np.float32)
    assert at(values, threads=1).tobytes() == at(values, threads=2).tobytes()


def test_wrong_input_is_an_error():
    with pytest.raises(OptionError, match="stops: the shape"):
        ramp_lookup(np.zeros(3), np.zeros(2))
    with pytest.raises(OptionError, match="stops: the shape"):
        ramp_lookup(np.zeros((0, 3)), np.zeros(2))
    with pytest.raises(OptionError, match="values: the shape"):
        ramp_lookup(STOPS, np.zeros((2, 2)))
    with pytest.raises(OptionError, match="wrap: 'tile'"):
        ramp_lookup(STOPS, np.zeros(2), wrap="tile")
