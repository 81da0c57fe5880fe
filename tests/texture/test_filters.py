"""Texture filters: trilinear, bicubic and supersampled lookups against their definitions."""

import numpy as np
import pytest

from texbake.texture.lookup import texel_coordinates
from texbake.texture.mipmaps import mip_chain, single_level
from texbake.texture.sample import sample


@pytest.fixture(scope="module")
def chain():
    return mip_chain(np.random.default_rng(2).random((32, 64, 3), dtype=np.float32))


@pytest.fixture(scope="module")
def uvs():
    return np.random.default_rng(3).uniform(-1.0, 2.0, (500, 2))


def steps(n, texels):
    """Derivatives of square footprints on 64 x 32 texels."""
    return np.tile(np.float32([texels / 64, 0, 0, -texels / 32]), (n, 1))


@pytest.mark.parametrize("wrap", ["repeat", "mirror", "clamp", "border"])
@pytest.mark.parametrize("level", range(7))
def test_trilinear_with_a_pixel_of_2_to_the_k_texels_reads_level_k_alone(chain, uvs, level, wrap):
    found = sample(chain, uvs, steps(500, 2.0**level), wrap=wrap)
    alone = single_level(chain.level(level))
    np.testing.assert_array_equal(found, sample(alone, uvs, filter="bilinear", wrap=wrap))


@pytest.mark.parametrize("share", [0.25, 0.5, 0.9])
def test_trilinear_mixes_two_levels_by_the_logarithm(chain, uvs, share):
    found = sample(chain, uvs, steps(500, 2.0 ** (2.0 + share)))
    fine, coarse = (sample(chain, uvs, steps(500, 2.0**level)) for level in (2, 3))
    # The level has an error of some 1e-7 of float32.
    np.testing.assert_allclose(found, fine + share * (coarse - fine), atol=1e-6)


@pytest.mark.parametrize("texels", [0.0, 1e-30, 0.3, 1.0, np.nan])
def test_trilinear_is_bilinear_where_magnified(chain, uvs, texels):
    found = sample(chain, uvs, steps(500, texels))
    np.testing.assert_array_equal(found, sample(chain, uvs, filter="bilinear"))


@pytest.mark.parametrize("texels", [64.0, 1e6, 1e30, np.inf])
def test_trilinear_with_a_pixel_larger_than_the_image_gives_its_mean(chain, uvs, texels):
    mean = chain.level(0).mean(axis=(0, 1), dtype=np.float64)
    found = sample(chain, uvs, steps(500, texels))
    np.testing.assert_allclose(found, np.broadcast_to(mean, (500, 3)), atol=1e-6)


def test_trilinear_level_follows_the_longer_step(chain, uvs):
    long_across, long_down = np.zeros((2, 500, 4), np.float32)
    long_across[:, 0], long_across[:, 3] = 8 / 64, 1 / 32
    long_down[:, 0], long_down[:, 3] = 1 / 64, 8 / 32
    expected = sample(chain, uvs, steps(500, 8.0))
    np.testing.assert_array_equal(sample(chain, uvs, long_across), expected)
    np.testing.assert_array_equal(sample(chain, uvs, long_down), expected)


def bicubic(image, uvs, **options):
    return sample(single_level(image), uvs, filter="bicubic", **options)


def catmull_rom(x):
    """Keys' kernel with a = -1/2, as he writes it."""
    x = abs(x)
    near = 1.5 * x**3 - 2.5 * x**2 + 1.0
    far = -0.5 * x**3 + 2.5 * x**2 - 4.0 * x + 2.0
    return np.where(x < 1.0, near, np.where(x < 2.0, far, 0.0))


@pytest.mark.parametrize(
    ("wrap", "mode"),
    [("repeat", "wrap"), ("mirror", "symmetric"), ("clamp", "edge"), ("border", "constant")],
)
@pytest.mark.parametrize("size", [(6, 9), (1, 1), (2, 1)])
def test_bicubic_is_the_convolution_with_keys_kernel(size, wrap, mode):
    height, width = size
    image = np.random.default_rng(0).random((*size, 2)).astype(np.float32)
    points = np.random.default_rng(1).uniform(-3.0, 4.0, (1000, 2))
    around = np.pad(image, ((40, 40), (40, 40), (0, 0)), mode=mode).astype(np.float64)
    places = texel_coordinates(points, width, height) - 0.5 + 40
    taps = np.floor(places).astype(int)[:, :, None] + np.arange(-1, 3)
    across, down = np.moveaxis(catmull_rom(places[:, :, None] - taps), 1, 0)
    texels = around[taps[:, 1, :, None], taps[:, 0, None, :]]
    expected = np.einsum("nr,nk,nrkc->nc", down, across, texels)
    np.testing.assert_allclose(bicubic(image, points, wrap=wrap), expected, atol=1e-6)


def test_bicubic_overshoots_an_edge_by_no_more_than_its_bound():
    image = np.random.default_rng(0).integers(0, 2, (64, 64, 1)).astype(np.float32)
    values = bicubic(image, np.random.default_rng(1).random((200_000, 2)))
    assert -9 / 32 <= values.min() < -0.15
    assert 1.15 < values.max() <= 1 + 9 / 32


def test_supersampled_wave_is_the_mean_over_the_parallelogram():
    """Of cos(2π k·x) that is sinc(k·a) sinc(k·b) of the value at the middle, a and b the sides."""
    size = 256
    u, v = np.meshgrid((np.arange(size) + 0.5) / size, 1 - (np.arange(size) + 0.5) / size)
    uvs = np.random.default_rng(0).random((400, 2))
    sides = np.random.default_rng(1).uniform(-0.12, 0.12, (400, 4)).astype(np.float32)
    waves = np.array([3.0, -2.0])
    image = np.cos(2 * np.pi * (u * waves[0] + v * waves[1]))[..., None]
    found = sample(single_level(image), uvs, sides, filter="supersampled")[:, 0]
    along = np.sinc(sides[:, :2] @ waves) * np.sinc(sides[:, 2:] @ waves)
    expected = along * np.cos(2 * np.pi * uvs @ waves)
    # 256 points leave up to 0.004 over waves longer than a pixel; bilinear interpolation up to
    # (2π |k| / 256)² / 4 of the amplitude, 0.002.
    np.testing.assert_allclose(found, expected, atol=0.006)
