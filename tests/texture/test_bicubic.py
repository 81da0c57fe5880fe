import numpy as np
import pytest

from texbake.texture.lookup import texel_coordinates
from texbake.texture.mipmaps import single_level
from texbake.texture.sample import sample


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
def test_it_is_the_convolution_with_keys_kernel(size, wrap, mode):
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


def test_a_parabola_is_reproduced():
    x, y = np.meshgrid((np.arange(16) + 0.5) / 16, 1 - (np.arange(12) + 0.5) / 12)

    def surface(u, v):
        return 1.0 + u - 2.0 * v + 3.0 * u * v - u * u + 2.0 * v * v

    points = np.random.default_rng(0).uniform(0.2, 0.8, (1000, 2))
    found = bicubic(surface(x, y)[..., None], points)[:, 0]
    np.testing.assert_allclose(found, surface(*points.T), atol=2e-6)  # float32, values up to 3


def test_it_is_smooth_from_texel_to_texel():
    """Its first derivative has no jump where the texels that are read change."""
    image = np.random.default_rng(4).random((1, 16, 1)).astype(np.float64)
    step = 1e-3 / 16
    borders = (np.arange(2, 14) + 0.5) / 16
    u = borders[:, None] + step * np.array([-2, -1, 1, 2])
    values = bicubic(image, np.stack([u.ravel(), np.full(u.size, 0.5)], axis=1)).reshape(u.shape)
    before, after = values[:, 1] - values[:, 0], values[:, 3] - values[:, 2]
    # In steps of a thousandth of a texel: curvature and float32 rounding.
    np.testing.assert_allclose(before / 1e-3, after / 1e-3, atol=0.04)


def test_it_overshoots_an_edge_by_no_more_than_it_says():
    image = np.random.default_rng(0).integers(0, 2, (64, 64, 1)).astype(np.float32)
    values = bicubic(image, np.random.default_rng(1).random((200_000, 2)))
    assert -9 / 32 <= values.min() < -0.15
    assert 1.15 < values.max() <= 1 + 9 / 32
