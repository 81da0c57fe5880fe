import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.texture.lookup import VOLUME_FILTERS, WRAPS, lookup, volume_lookup

MODES = {"repeat": "wrap", "mirror": "symmetric", "clamp": "edge", "border": "constant"}


def random_volume(depth, height, width, n_channels=2):
    return np.random.default_rng(0).random((depth, height, width, n_channels), dtype=np.float32)


@pytest.mark.parametrize("wrap", WRAPS)
@pytest.mark.parametrize("size", [(4, 3, 5), (1, 1, 1), (1, 2, 1)])
@pytest.mark.parametrize("name", VOLUME_FILTERS)
def test_it_reads_what_numpy_pads_with(name, size, wrap):
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


def test_a_slice_is_an_image():
    volume = random_volume(6, 4, 5)
    uvs = np.random.default_rng(2).random((500, 2))
    for k in range(6):
        points = np.concatenate([uvs, np.full((500, 1), (k + 0.5) / 6)], axis=1)
        np.testing.assert_allclose(volume_lookup(volume, points), lookup(volume[k], uvs), atol=1e-6)


def test_a_linear_volume_is_reproduced():
    axes = [(np.arange(n) + 0.5) / n for n in (8, 9, 10)]
    r, t, s = np.meshgrid(axes[0], axes[1][::-1], axes[2], indexing="ij")
    volume = (1.0 + s - 2.0 * t + 3.0 * r)[..., None]
    points = np.random.default_rng(0).uniform(0.1, 0.9, (1000, 3))
    expected = 1.0 + points @ [1.0, -2.0, 3.0]
    np.testing.assert_allclose(volume_lookup(volume, points)[:, 0], expected, atol=2e-6)


@pytest.mark.parametrize("name", VOLUME_FILTERS)
@pytest.mark.parametrize("wrap", WRAPS)
def test_a_constant_stays_exactly_constant_wherever_it_is_read(name, wrap):
    odd = [np.nan, np.inf, -np.inf, 1e300, -1e300, -1e-300, 1e18, 0.0, 0.4, 1.0]
    points = np.array([[s, t, r] for s in odd for t in odd for r in odd])
    volume = np.full((3, 4, 2, 1), np.float32(0.1))
    values = volume_lookup(volume, points, filter=name, wrap=wrap, border=np.float32(0.1))
    assert (values == np.float32(0.1)).all()


def test_threads_change_nothing():
    volume, points = random_volume(8, 8, 8), np.random.default_rng(0).random((300_000, 3))
    one, two = (volume_lookup(volume, points, threads=threads) for threads in (1, 2))
    assert one.tobytes() == two.tobytes()


def test_wrong_input_is_an_error():
    volume, points = random_volume(2, 2, 2), np.zeros((1, 3))
    with pytest.raises(OptionError, match="filter: 'bicubic' is not known"):
        volume_lookup(volume, points, filter="bicubic")
    with pytest.raises(OptionError, match="wrap: 'tile' is not known"):
        volume_lookup(volume, points, wrap="tile")
    with pytest.raises(OptionError, match="volume: the shape"):
        volume_lookup(volume[0], points)
    with pytest.raises(OptionError, match="points: the shape"):
        volume_lookup(volume, np.zeros((1, 2)))
