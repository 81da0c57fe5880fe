import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.texture.cube_lookup import from_latitude_longitude, sample_cube, to_latitude_longitude
from texbake.texture.cube_map import CubeMap, solid_angles, texel_directions


def image_directions(height, width):
    """(H, W, 3) directions of texel centers, from the definition."""
    longitude = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    latitude = (0.5 - (np.arange(height) + 0.5) / height) * np.pi
    longitude, latitude = np.meshgrid(longitude, latitude)
    x, z = np.cos(latitude) * np.sin(longitude), -np.cos(latitude) * np.cos(longitude)
    return np.stack([x, np.sin(latitude), z], axis=2)


def image_energy(image):
    height, width, _ = image.shape
    areas = -np.diff(np.sin((0.5 - np.arange(height + 1) / height) * np.pi)) * 2 * np.pi / width
    return (image * areas[:, None, None]).sum((0, 1), dtype=np.float64)


def cube_energy(cube):
    return (cube.faces * solid_angles(cube.size)[None, ..., None]).sum((0, 1, 2), dtype=np.float64)


def smooth(directions):
    """Waves with |k|² = 5.25, so that no second derivative is above that."""
    return np.sin(directions @ np.array([[1.0], [-2.0], [0.5]])) + 1.5


def test_the_image_is_where_it_says():
    image = np.zeros((64, 128, 1), np.float32)
    image[31:33, 63:65] = 1.0  # the middle
    image[31:33, 95:97] = 2.0  # three quarters to the right
    image[31:33, [0, -1]] = 3.0  # the left and the right edge
    image[31:33, 31:33] = 4.0
    image[0], image[-1] = 5.0, 6.0
    found = sample_cube(
        from_latitude_longitude(image, size=64),
        np.concatenate(
            [-np.eye(3)[[2]], np.eye(3)[[0, 2]], -np.eye(3)[[0]], np.eye(3)[[1]], -np.eye(3)[[1]]]
        ),
    )
    # The directions hit the middle of 2 x 2 texels; what lookups reach beyond them is 0.
    assert found.ravel().round().tolist() == [1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize("size", [3, 32, 100])
@pytest.mark.parametrize("shape", [(64, 128), (33, 65), (1, 1), (2, 1), (40, 30)])
def test_a_constant_stays_exactly_that(shape, size):
    value = np.array([0.1, 1234.567], np.float32)
    cube = from_latitude_longitude(np.broadcast_to(value, (*shape, 2)), size=size)
    assert (cube.faces == value).all()
    assert (to_latitude_longitude(cube, height=17) == value).all()


def test_to_a_cube_a_smooth_function_is_followed():
    cube = from_latitude_longitude(smooth(image_directions(128, 256)), size=64)
    # Linear interpolation over 2 pi / 256 and the mean over 2 / 64: h²/8 and h²/24 of two second
    # derivatives of at most 5.25; near the poles a first derivative in longitude adds to them.
    bound = 2 * 5.25 * ((2 * np.pi / 256) ** 2 / 8 + (2 / 64) ** 2 / 24)
    np.testing.assert_allclose(cube.faces, smooth(texel_directions(64)), atol=2 * bound)


def test_there_and_back_a_smooth_function_stays():
    image = smooth(image_directions(128, 256)).astype(np.float32)
    back = to_latitude_longitude(from_latitude_longitude(image))
    assert back.shape == image.shape
    # As above, and once more on the way back over the texels of the cube.
    bound = 2 * 5.25 * ((2 * np.pi / 256) ** 2 / 8 + (2 / 64) ** 2 * (1 / 24 + 1 / 8 + 1 / 24))
    np.testing.assert_allclose(back, image, atol=2 * bound)


@pytest.mark.parametrize("size", [4, 16, 64])
def test_energy_is_kept_of_noise(size):
    image = np.random.default_rng(4).random((128, 256, 3)).astype(np.float32)
    cube = from_latitude_longitude(image, size=size)
    # Noise of 32,768 texels with a deviation of 0.29 around 0.5: the mean of as many others would
    # be off by 3e-3 of it.
    np.testing.assert_allclose(cube_energy(cube), image_energy(image), rtol=4e-4)
    np.testing.assert_allclose(
        image_energy(to_latitude_longitude(cube, height=20)), cube_energy(cube), rtol=2e-3
    )


@pytest.mark.parametrize("size", [8, 32, 128])
def test_a_small_sun_keeps_its_energy_wherever_it_is(size):
    """A single bright texel is what point sampling would find or lose."""
    rng = np.random.default_rng(9)
    for row, column in zip(rng.integers(2, 62, 12), rng.integers(0, 128, 12), strict=True):
        image = np.zeros((64, 128, 1), np.float32)
        image[row, column] = 1000.0
        energy = cube_energy(from_latitude_longitude(image, size=size))
        # Lookups half a texel apart see a tent of a texel's width with at most
        # 2 (1 / 2 pi)² = 5 % too much or too little each way; texels are of finite solid angle.
        np.testing.assert_allclose(energy, image_energy(image), rtol=0.07)


def test_stripes_too_fine_for_the_cube_become_gray():
    image = np.zeros((256, 512, 1), np.float32)
    image[:, ::2] = 1.0
    cube = from_latitude_longitude(image, size=16)
    # Aliased stripes would be anything from 0 to 1. The mean over a texel leaves 1 / (pi n) of an
    # amplitude of 2/pi over n stripes, at least 2 in the narrowest; interpolating took 60 % of it.
    np.testing.assert_allclose(cube.faces, 0.5, atol=0.4 * 2 / np.pi / (np.pi * 2))


def test_the_poles_are_one_value():
    """Rows of stripes at a pole are a spot that no lookup may resolve."""
    image = np.zeros((64, 128, 1), np.float32)
    image[:, ::2] = 1.0
    cube = from_latitude_longitude(image, size=32)
    # The middle four texels of the top lie within 1.5 rows of the pole, where a stripe is 1/128 of
    # a circle.
    np.testing.assert_allclose(cube.faces[2:4, 15:17, 15:17], 0.5, atol=0.02)


def test_from_a_noisy_cube_there_is_no_seam():
    rng = np.random.default_rng(8)
    cube = CubeMap(rng.random((6, 4, 4, 1)).astype(np.float32))
    image = to_latitude_longitude(cube, height=256)
    steps = np.abs(np.diff(np.concatenate([image, image[:, :1]], axis=1), axis=1))
    # The steepest that four texels a quarter turn allow: 1 over the narrowest, 0.67 / 4 rad, in
    # steps of 2 pi / 512 rad; a seam would be up to 1.
    assert steps.max() < 1.5 * (2 * np.pi / 512) / (0.67 / 4)
    assert np.abs(np.diff(image, axis=0)).max() < 1.5 * (np.pi / 256) / (0.67 / 4)


def test_what_is_not_finite_counts_as_0():
    image = np.ones((8, 16, 1), np.float32)
    image[0, 0], image[4, 3], image[7, 7] = np.nan, np.inf, -np.inf
    cube = from_latitude_longitude(image)
    assert cube.faces.max() <= 1.0
    assert cube.faces.min() >= 0.0
    assert cube.faces.min() < 0.9


def test_the_same_bytes_for_any_number_of_threads():
    image = np.random.default_rng(4).random((256, 512, 3)).astype(np.float32)
    one, two = (from_latitude_longitude(image, threads=threads) for threads in (1, 2))
    np.testing.assert_array_equal(one.faces, two.faces)
    np.testing.assert_array_equal(
        to_latitude_longitude(one, threads=1), to_latitude_longitude(two, threads=2)
    )


def test_sizes():
    image = np.zeros((30, 60, 1), np.float32)
    assert from_latitude_longitude(image).size == 15
    assert from_latitude_longitude(np.zeros((1, 1, 4), np.float32)).faces.shape == (6, 1, 1, 4)
    cube = from_latitude_longitude(image, size=5)
    assert to_latitude_longitude(cube).shape == (10, 20, 1)
    for wrong in (
        lambda: from_latitude_longitude(image, size=0),
        lambda: to_latitude_longitude(cube, height=0),
    ):
        with pytest.raises(OptionError, match=r"0 is too small; it must be at least 1"):
            wrong()
    with pytest.raises(OptionError, match="image: the shape"):
        from_latitude_longitude(image[..., 0])


@pytest.mark.realdata
def test_a_real_environment_keeps_its_light(data_dir):
    from texbake import read_image

    image = read_image(data_dir / "textures" / "venice_sunset_1k.hdr", color=True).pixels
    cube = from_latitude_longitude(image)
    # A sun of 6,496 times white in a few texels.
    np.testing.assert_allclose(cube_energy(cube), image_energy(image), rtol=2e-3)
    np.testing.assert_allclose(
        image_energy(to_latitude_longitude(cube)), cube_energy(cube), rtol=2e-3
    )
