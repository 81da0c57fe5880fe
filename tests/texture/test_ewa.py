import numpy as np
import pytest

from texbake.texture.mipmaps import mip_chain, single_level
from texbake.texture.sample import EWA_WEIGHTS, PIXEL_RADIUS_SQUARED, sample

SIZE = 256


@pytest.fixture(scope="module")
def noise():
    """Image with detail at all sizes, as photographs have it: amplitudes that fall as 1 / f."""
    rng = np.random.default_rng(1)
    f = np.hypot(np.fft.fftfreq(SIZE)[:, None], np.fft.fftfreq(SIZE)[None])
    f[0, 0] = 1.0
    image = np.fft.ifft2(np.fft.fft2(rng.normal(size=(SIZE, SIZE))) / f).real
    return mip_chain((image / image.std())[..., None])


def footprints(n, long, short, seed=0):
    """Derivatives of ellipses of `long` and `short` texels an axis, turned anyhow.

    The two steps are not the axes: they are turned against each other and sheared.
    """
    rng = np.random.default_rng(seed)
    turn, roll = rng.uniform(0, 2 * np.pi, (2, n))
    major = np.stack([np.cos(turn), np.sin(turn)], axis=1) * long
    minor = np.stack([-np.sin(turn), np.cos(turn)], axis=1) * short
    cos, sin = np.cos(roll)[:, None], np.sin(roll)[:, None]
    steps = np.concatenate([cos * major + sin * minor, cos * minor - sin * major], axis=1)
    return (steps / SIZE).astype(np.float32)


def rms(values):
    return np.sqrt(np.mean(np.square(values, dtype=np.float64)))


def test_the_filter_has_the_variance_of_a_square_pixel():
    """Along an axis 1/12, found by integrating the weights over the ellipse's own disk."""
    squared = (np.arange(len(EWA_WEIGHTS)) + 0.5) / len(EWA_WEIGHTS)
    # d(r²) is proportional to the area of a ring; half of r² belongs to each axis.
    variance = 0.5 * (EWA_WEIGHTS * squared).sum() / EWA_WEIGHTS.sum(dtype=np.float64)
    assert variance * PIXEL_RADIUS_SQUARED == pytest.approx(1 / 12, rel=1e-6)
    # Closed form of the untabulated one: ∫ t w / ∫ w for w = exp(-2t) - exp(-2), t from 0 to 1.
    e = np.exp(-2.0)
    closed = 0.5 * (0.25 - 0.75 * e - 0.5 * e) / (0.5 - 0.5 * e - e)
    assert variance == pytest.approx(closed, rel=1e-5)


@pytest.mark.parametrize("ratio", [2.0, 4.0, 8.0, 16.0])
@pytest.mark.parametrize("short", [1.0, 3.0])
def test_the_longer_the_ellipse_the_more_it_gains_on_trilinear(noise, ratio, short):
    uvs = np.random.default_rng(0).random((1500, 2))
    derivatives = footprints(1500, short * ratio, short)
    reference = sample(noise, uvs, derivatives, filter="supersampled")
    trilinear, ewa = (
        rms(sample(noise, uvs, derivatives, filter=name) - reference)
        for name in ("trilinear", "ewa")
    )
    assert ewa < trilinear * (0.75 if ratio == 2.0 else 0.5)


@pytest.mark.parametrize("long", [0.0, 0.3, 1.0])
def test_magnified_it_is_bilinear(noise, long):
    uvs = np.random.default_rng(0).random((500, 2))
    # A hair less than one texel: rounded to float32, a step may be longer.
    derivatives = footprints(500, long * 0.9999, 0.1 * long)
    found = sample(noise, uvs, derivatives, filter="ewa")
    np.testing.assert_array_equal(found, sample(noise, uvs, filter="bilinear"))


def test_it_changes_gradually_as_the_footprint_grows(noise):
    """Across the end of magnification, levels, and the bound on the ratio of axes."""
    uvs = np.random.default_rng(0).random((100, 2))
    sizes = np.geomspace(0.5, 4096.0, 400)
    for ratio in 1.0, 5.0, 40.0:
        shape = footprints(100, 1.0, 1.0 / ratio)
        values = [
            sample(noise, uvs, (shape * size).astype(np.float32), filter="ewa") for size in sizes
        ]
        # A step is 2.3 % of the size; texels that enter at the ellipse's edge have weight 0.
        assert abs(np.diff(values, axis=0)).max() < 0.12


def test_a_pixel_larger_than_the_image_sees_its_mean(noise):
    uvs = np.random.default_rng(0).random((50, 2))
    mean = noise.level(0).mean(dtype=np.float64)
    for size in 1e3, 1e9, 1e30, np.inf:
        derivatives = np.tile(np.float32([size, 0, 0, size]), (50, 1))
        found = sample(noise, uvs, derivatives, filter="ewa")
        np.testing.assert_allclose(found, mean, atol=1e-5)


def test_steps_along_one_line_are_an_ellipse_too(noise):
    """A plane seen exactly edge-on: the minor axis is 0 and is lengthened to the bound."""
    uvs = np.random.default_rng(0).random((500, 2))
    derivatives = footprints(500, 32.0, 0.0)
    bounded = footprints(500, 32.0, 2.0)
    np.testing.assert_allclose(
        sample(noise, uvs, derivatives, filter="ewa"),
        sample(noise, uvs, bounded, filter="ewa"),
        atol=2e-4,  # float32 derivatives
    )


def test_more_anisotropy_is_sharper(noise):
    uvs = np.random.default_rng(0).random((1000, 2))
    derivatives = footprints(1000, 32.0, 1.0)
    reference = sample(noise, uvs, derivatives, filter="supersampled")
    errors = [
        rms(sample(noise, uvs, derivatives, filter="ewa", max_anisotropy=bound) - reference)
        for bound in (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
    ]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.3 * errors[0]


def test_without_smaller_levels_the_ellipse_is_cut(noise):
    """Its time stays bounded whatever the footprint: the last level's texels are its measure."""
    uvs = np.random.default_rng(0).random((200, 2))
    finest = single_level(noise.level(0))
    huge, texel = footprints(200, 1e5, 1e5), footprints(200, 1.0, 1.0)
    found = sample(finest, uvs, huge * 1.0, filter="ewa", max_anisotropy=1.0)
    # A round footprint of one texel is still interpolated.
    np.testing.assert_allclose(found, sample(noise, uvs, texel * 0.999, filter="ewa"), atol=1e-6)
