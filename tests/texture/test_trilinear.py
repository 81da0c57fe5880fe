import numpy as np
import pytest

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
def test_a_pixel_of_2_to_the_k_texels_reads_level_k_alone(chain, uvs, level, wrap):
    found = sample(chain, uvs, steps(500, 2.0**level), wrap=wrap)
    alone = single_level(chain.level(level))
    np.testing.assert_array_equal(found, sample(alone, uvs, filter="bilinear", wrap=wrap))


@pytest.mark.parametrize("share", [0.25, 0.5, 0.9])
def test_between_two_levels_it_mixes_by_the_logarithm(chain, uvs, share):
    found = sample(chain, uvs, steps(500, 2.0 ** (2.0 + share)))
    fine, coarse = (sample(chain, uvs, steps(500, 2.0**level)) for level in (2, 3))
    # The level has an error of some 1e-7 of float32.
    np.testing.assert_allclose(found, fine + share * (coarse - fine), atol=1e-6)


@pytest.mark.parametrize("texels", [0.0, 1e-30, 0.3, 1.0, np.nan])
def test_magnified_it_is_bilinear(chain, uvs, texels):
    found = sample(chain, uvs, steps(500, texels))
    np.testing.assert_array_equal(found, sample(chain, uvs, filter="bilinear"))


@pytest.mark.parametrize("texels", [64.0, 1e6, 1e30, np.inf])
def test_a_pixel_larger_than_the_image_sees_its_mean(chain, uvs, texels):
    mean = chain.level(0).mean(axis=(0, 1), dtype=np.float64)
    found = sample(chain, uvs, steps(500, texels))
    np.testing.assert_allclose(found, np.broadcast_to(mean, (500, 3)), atol=1e-6)


def test_the_longer_step_decides(chain, uvs):
    long_across, long_down = np.zeros((2, 500, 4), np.float32)
    long_across[:, 0], long_across[:, 3] = 8 / 64, 1 / 32
    long_down[:, 0], long_down[:, 3] = 1 / 64, 8 / 32
    expected = sample(chain, uvs, steps(500, 8.0))
    np.testing.assert_array_equal(sample(chain, uvs, long_across), expected)
    np.testing.assert_array_equal(sample(chain, uvs, long_down), expected)
