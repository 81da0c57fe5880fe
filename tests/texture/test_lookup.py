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


def centers(width, height):
    """(H, W, 2) texture coordinates of texel centers, from the definition."""
    u = (np.arange(width) + 0.5) / width
    v = 1.0 - (np.arange(height) + 0.5) / height
    return np.stack(np.meshgrid(u, v), axis=2)


@pytest.mark.parametrize("wrap", WRAPS)
def test_at_texel_centers_it_gives_the_texels(image, wrap):
    # 1e-6: (i + 0.5) / 7 * 7 - 0.5 is off an integer by some 1e-16, times differences below 1.
    np.testing.assert_allclose(lookup(image, centers(7, 5), wrap=wrap), image, atol=1e-6)


PADDED = {"repeat": "wrap", "mirror": "symmetric", "clamp": "edge", "border": "constant"}


def padded(image, wrap, border=0.0, *, by=64):
    """The image with what lies around it, as numpy has it."""
    sides = ((by, by), (by, by), (0, 0))
    around = {"constant_values": border} if wrap == "border" else {}
    return np.pad(image, sides, mode=PADDED[wrap], **around)


@pytest.mark.parametrize("wrap", WRAPS)
@pytest.mark.parametrize("size", [(5, 7), (1, 1), (1, 4), (2, 1)])
def test_outside_it_agrees_with_the_padding_of_numpy(wrap, size):
    height, width = size
    image = np.random.default_rng(1).random((*size, 2)).astype(np.float32)
    points = np.random.default_rng(2).uniform(-4.0, 5.0, (3000, 2))
    places = texel_coordinates(points, width, height) - 0.5
    first = np.floor(places).astype(int)
    along = (places - first)[..., None]
    around = padded(image, wrap, 0.25).astype(np.float64)
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


@pytest.mark.parametrize("wrap", WRAPS)
@pytest.mark.parametrize("size", [(1, 1), (1, 4), (6, 5)])
def test_a_constant_stays_exactly_constant_wherever_it_is_read(size, wrap):
    image = np.full((*size, 1), np.float32(0.1))
    odd = [np.nan, np.inf, -np.inf, 1e300, -1e300, -1e-300, 1e18, -1e9, 0.0, 1.0]
    points = np.array([[u, v] for u in odd for v in odd])
    points = np.concatenate([points, np.random.default_rng(0).uniform(-2, 2, (2000, 2))])
    assert (lookup(image, points, wrap=wrap, border=np.float32(0.1)) == np.float32(0.1)).all()


def test_a_border_has_one_value_or_one_per_channel(image):
    outside = np.array([[-3.0, 0.5], [0.5, 7.0]])
    found = lookup(image, outside, wrap="border", border=(1.0, 2.0, 3.0))
    np.testing.assert_array_equal(found, [[1.0, 2.0, 3.0]] * 2)
    assert (lookup(image, outside, wrap="border") == 0.0).all()
    with pytest.raises(OptionError, match=r"border: .* is not one number or 3"):
        lookup(image, outside, wrap="border", border=(1.0, 2.0))


def test_wrong_options_are_errors(image):
    with pytest.raises(OptionError, match="'tile' is not known"):
        lookup(image, np.zeros((1, 2)), wrap="tile")
    with pytest.raises(OptionError, match="shape"):
        lookup(np.zeros((4, 4), np.float32), np.zeros((1, 2)))


MODES = {"repeat": "wrap", "mirror": "symmetric", "clamp": "edge", "border": "constant"}


def random_volume(depth, height, width, n_channels=2):
    return np.random.default_rng(0).random((depth, height, width, n_channels), dtype=np.float32)


@pytest.mark.parametrize("wrap", WRAPS)
@pytest.mark.parametrize("size", [(4, 3, 5), (1, 1, 1), (1, 2, 1)])
@pytest.mark.parametrize("name", VOLUME_FILTERS)
def test_a_volume_outside_agrees_with_the_padding_of_numpy(name, size, wrap):
    volume = random_volume(*size)
    points = np.random.default_rng(1).uniform(-2.0, 3.0, (3000, 3))
    border = {"constant_values": 0.25} if wrap == "border" else {}
    around = np.pad(volume, ((16, 16),) * 3 + ((0, 0),), mode=MODES[wrap], **border)
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


def test_a_slice_of_a_volume_is_an_image():
    volume = random_volume(6, 4, 5)
    uvs = np.random.default_rng(2).random((500, 2))
    for k in range(6):
        points = np.concatenate([uvs, np.full((500, 1), (k + 0.5) / 6)], axis=1)
        np.testing.assert_allclose(volume_lookup(volume, points), lookup(volume[k], uvs), atol=1e-6)


@pytest.mark.parametrize("name", VOLUME_FILTERS)
@pytest.mark.parametrize("wrap", WRAPS)
def test_a_constant_volume_stays_exactly_constant_wherever_it_is_read(name, wrap):
    odd = [np.nan, np.inf, -np.inf, 1e300, -1e300, -1e-300, 1e18, 0.0, 0.4, 1.0]
    points = np.array([[s, t, r] for s in odd for t in odd for r in odd])
    volume = np.full((3, 4, 2, 1), np.float32(0.1))
    values = volume_lookup(volume, points, filter=name, wrap=wrap, border=np.float32(0.1))
    assert (values == np.float32(0.1)).all()


def test_wrong_input_of_a_volume_lookup_is_an_error():
    volume, points = random_volume(2, 2, 2), np.zeros((1, 3))
    with pytest.raises(OptionError, match="filter: 'bicubic' is not known"):
        volume_lookup(volume, points, filter="bicubic")
    with pytest.raises(OptionError, match="wrap: 'tile' is not known"):
        volume_lookup(volume, points, wrap="tile")
    with pytest.raises(OptionError, match="volume: the shape"):
        volume_lookup(volume[0], points)
    with pytest.raises(OptionError, match="points: the shape"):
        volume_lookup(volume, np.zeros((1, 2)))


STOPS = np.array([[0.0, 1.0], [2.0, 0.5], [3.0, 4.0], [-1.0, 0.0]], np.float32)


def at(values, **options):
    return ramp_lookup(STOPS, np.asarray(values, np.float32), **options)


def test_stops_of_a_ramp_are_evenly_spaced_from_0_to_1():
    np.testing.assert_allclose(at([0, 1 / 3, 2 / 3, 1]), STOPS, atol=1e-6)


def test_a_ramp_between_stops_agrees_with_interpolation_in_numpy():
    values = np.random.default_rng(0).random(1000).astype(np.float32)
    expected = np.stack([np.interp(values, np.arange(4) / 3, c) for c in STOPS.T], axis=1)
    np.testing.assert_allclose(at(values), expected, atol=1e-6)


@pytest.mark.parametrize("wrap", WRAPS)
def test_a_ramp_outside_follows_its_wrap_mode(wrap):
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


def test_wrong_input_of_a_ramp_lookup_is_an_error():
    with pytest.raises(OptionError, match="stops: the shape"):
        ramp_lookup(np.zeros(3), np.zeros(2))
    with pytest.raises(OptionError, match="stops: the shape"):
        ramp_lookup(np.zeros((0, 3)), np.zeros(2))
    with pytest.raises(OptionError, match="values: the shape"):
        ramp_lookup(STOPS, np.zeros((2, 2)))
    with pytest.raises(OptionError, match="wrap: 'tile'"):
        ramp_lookup(STOPS, np.zeros(2), wrap="tile")


def test_nan_counts_as_0(image):
    points = np.array([[np.nan, 0.3], [0.3, np.nan]])
    zeros = np.array([[0.0, 0.3], [0.3, 0.0]])
    for wrap in WRAPS:
        np.testing.assert_array_equal(
            lookup(image, points, wrap=wrap), lookup(image, zeros, wrap=wrap)
        )
