"""Lookups in images, volumes and ramps: interpolation, wrap modes, and any coordinates."""

import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.texture.lookup import (
    VOLUME_FILTERS,
    WRAPS,
    lookup,
    ramp_lookup,
    texel_coordinates,
    volume_lookup,
)


@pytest.fixture
def image():
    return np.random.default_rng(3).random((5, 7, 3)).astype(np.float32)


PADDED = {"repeat": "wrap", "mirror": "symmetric", "clamp": "edge", "border": "constant"}


def padded(image, wrap, by):
    """An image or volume with what lies around it, as numpy has it."""
    sides = ((by, by),) * (image.ndim - 1) + ((0, 0),)
    border = {"constant_values": 0.25} if wrap == "border" else {}
    return np.pad(image, sides, mode=PADDED[wrap], **border)


@pytest.mark.parametrize("wrap", WRAPS)
@pytest.mark.parametrize("size", [(5, 7), (1, 1), (1, 4), (2, 1)])
def test_outside_it_agrees_with_the_padding_of_numpy(wrap, size):
    height, width = size
    image = np.random.default_rng(1).random((*size, 2)).astype(np.float32)
    points = np.random.default_rng(2).uniform(-4.0, 5.0, (3000, 2))
    places = texel_coordinates(points, width, height) - 0.5
    first = np.floor(places).astype(int)
    along = (places - first)[..., None]
    around = padded(image, wrap, 64).astype(np.float64)
    expected = np.zeros((len(points), 2))
    for right in 0, 1:
        for down in 0, 1:
            weight = (along[:, 0] if right else 1 - along[:, 0]) * (
                along[:, 1] if down else 1 - along[:, 1]
            )
            expected += weight * around[first[:, 1] + 64 + down, first[:, 0] + 64 + right]
    found = lookup(image, points, wrap=wrap, border=0.25)
    # Differences of float32 texels and the result are rounded to float32.
    np.testing.assert_allclose(found, expected, atol=2e-7)


def test_a_border_has_one_value_or_one_per_channel(image):
    outside = np.array([[-3.0, 0.5], [0.5, 7.0]])
    found = lookup(image, outside, wrap="border", border=(1.0, 2.0, 3.0))
    np.testing.assert_array_equal(found, [[1.0, 2.0, 3.0]] * 2)
    assert (lookup(image, outside, wrap="border") == 0.0).all()
    with pytest.raises(OptionError, match=r"border: .* is not one number or 3"):
        lookup(image, outside, wrap="border", border=(1.0, 2.0))


def random_volume(depth, height, width, n_channels=2):
    return np.random.default_rng(0).random((depth, height, width, n_channels), dtype=np.float32)


@pytest.mark.parametrize("wrap", WRAPS)
@pytest.mark.parametrize("size", [(4, 3, 5), (1, 1, 1), (1, 2, 1)])
@pytest.mark.parametrize("name", VOLUME_FILTERS)
def test_a_volume_outside_agrees_with_the_padding_of_numpy(name, size, wrap):
    volume = random_volume(*size)
    points = np.random.default_rng(1).uniform(-2.0, 3.0, (3000, 3))
    around = padded(volume, wrap, 16)
    # In texels; t goes up and rows go down.
    s, t, r = points.T
    places = np.stack([r * size[0], (1 - t) * size[1], s * size[2]], axis=1)
    if name == "nearest":
        expected = around[tuple(np.floor(places).astype(int).T + 16)]
    else:
        first = np.floor(places - 0.5).astype(int)
        along = places - 0.5 - first
        expected = np.zeros((len(points), 2))
        for corner in np.ndindex(2, 2, 2):
            weight = np.where(corner, along, 1 - along).prod(axis=1)
            expected += weight[:, None] * around[tuple((first + corner).T + 16)]
    found = volume_lookup(volume, points, filter=name, wrap=wrap, border=0.25)
    np.testing.assert_allclose(found, expected, atol=5e-7)


ODD = [np.nan, np.inf, -np.inf, 1e300, -1e300, -1e-300, 1e18, -1e9, 0.0, 0.4, 1.0]


@pytest.mark.parametrize("wrap", WRAPS)
@pytest.mark.parametrize("size", [(1, 1), (1, 4), (6, 5), (3, 4, 2)])
def test_a_constant_stays_exactly_constant_wherever_it_is_read(size, wrap):
    value = np.float32(0.1)
    points = np.stack(np.meshgrid(*[ODD] * len(size)), axis=-1).reshape(-1, len(size))
    points = np.concatenate([points, np.random.default_rng(0).uniform(-2, 2, (2000, len(size)))])
    source, read = np.full((*size, 1), value), lookup if len(size) == 2 else volume_lookup
    for options in [{}] if read is lookup else [{"filter": name} for name in VOLUME_FILTERS]:
        assert (read(source, points, wrap=wrap, border=value, **options) == value).all()


STOPS = np.array([[0.0, 1.0], [2.0, 0.5], [3.0, 4.0], [-1.0, 0.0]], np.float32)


def test_a_ramp_between_stops_agrees_with_interpolation_in_numpy():
    values = np.random.default_rng(0).uniform(-1, 2, 1000).astype(np.float32)
    expected = np.stack([np.interp(values, np.arange(4) / 3, c) for c in STOPS.T], axis=1)
    np.testing.assert_allclose(ramp_lookup(STOPS, values), expected, atol=1e-6)


def test_one_stop_is_the_color_of_everything():
    odd = np.array([-1.0, 0.0, 0.5, 1.0, -1e-45, np.inf, -np.inf, np.nan], np.float32)
    assert (ramp_lookup(STOPS[1:2], odd) == STOPS[1]).all()
    ends = ramp_lookup(STOPS, odd[-3:])
    np.testing.assert_array_equal(ends, STOPS[[-1, 0, 0]])


@pytest.mark.parametrize(("function", "source", "points", "options", "message"), [
    (lookup, (2, 2, 3), (1, 2), {"wrap": "tile"}, "'tile' is not known"),
    (lookup, (4, 4), (1, 2), {}, "shape"),
    (volume_lookup, (2, 2, 2, 2), (1, 3), {"filter": "bicubic"}, "filter: 'bicubic' is not"),
    (volume_lookup, (2, 2, 2, 2), (1, 3), {"wrap": "tile"}, "wrap: 'tile' is not known"),
    (volume_lookup, (2, 2, 2), (1, 3), {}, "volume: the shape"),
    (volume_lookup, (2, 2, 2, 2), (1, 2), {}, "points: the shape"),
    (ramp_lookup, (0, 3), (2,), {}, "stops: the shape"),
    (ramp_lookup, (2, 3), (2, 2), {}, "values: the shape"),
])  # fmt: skip
def test_wrong_input_is_an_error(function, source, points, options, message):
    with pytest.raises(OptionError, match=message):
        function(np.zeros(source, np.float32), np.zeros(points), **options)


def test_nan_counts_as_0(image):
    points = np.array([[np.nan, 0.3], [0.3, np.nan]])
    zeros = np.array([[0.0, 0.3], [0.3, 0.0]])
    for wrap in WRAPS:
        np.testing.assert_array_equal(
            lookup(image, points, wrap=wrap), lookup(image, zeros, wrap=wrap)
        )
