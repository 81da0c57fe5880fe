import numpy as np

from texbake.texture.filters import SUPERSAMPLES
from texbake.texture.mipmaps import single_level
from texbake.texture.sample import sample


def test_its_points_all_differ_in_both_coordinates():
    # So an axis-aligned pattern of less than 256 periods a pixel is seen in 256 phases.
    for coordinates in SUPERSAMPLES.T:
        np.testing.assert_array_equal(np.sort(coordinates), (np.arange(256) + 0.5) / 256 - 0.5)


def test_its_points_are_mirrored_about_the_middle():
    points = set(map(tuple, SUPERSAMPLES))
    assert len(points) == 256
    assert {(-x, -y) for x, y in points} == points


def test_of_a_wave_it_is_the_mean_over_the_parallelogram():
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
