"""Lookups in cube maps, and panoramas converted to cube maps and back."""

import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.texture.cube_map import (
    CUBE_FILTERS,
    CubeMap,
    cube_chain,
    face_directions,
    from_latitude_longitude,
    locate_directions,
    resize_cube,
    sample_cube,
    solid_angles,
    texel_directions,
    to_latitude_longitude,
)


@pytest.fixture
def noise():
    return CubeMap(np.random.default_rng(5).random((6, 8, 8, 3)).astype(np.float32))


@pytest.fixture
def directions():
    return np.random.default_rng(2).normal(size=(5000, 3)).astype(np.float32)


@pytest.mark.parametrize("filter_name", CUBE_FILTERS)
@pytest.mark.parametrize("size", [1, 3, 8])
def test_through_a_texels_center_it_gives_the_texel(filter_name, size):
    cube = CubeMap(np.random.default_rng(0).random((6, size, size, 2)).astype(np.float32))
    found = sample_cube(cube, face_directions(size).reshape(-1, 3), filter=filter_name)
    # Float32 directions move by 1e-7 of a texel's value, times the size.
    np.testing.assert_allclose(found, cube.faces.reshape(-1, 2), atol=1e-6)


def test_nearest_is_the_texel_that_holds_the_direction(noise, directions):
    faces, st = locate_directions(directions.astype(np.float64))
    columns, rows = np.floor(st * 8).astype(int).T
    found = sample_cube(noise, directions, filter="nearest")
    np.testing.assert_array_equal(found, noise.faces[faces, rows, columns])


def edge_points(n):
    """Points on all twelve edges of the cube (12 n, 3), corners among them, and two axes each."""
    points, inward = [], []
    along = np.linspace(-1, 1, n)
    for axis in range(3):
        for signs in (1, 1), (1, -1), (-1, 1), (-1, -1):
            point = np.zeros((n, 3))
            point[:, axis] = along
            point[:, [axis - 1, axis - 2]] = signs
            points.append(point)
            inward.append(np.broadcast_to([axis - 1, axis - 2], (n, 2)) % 3)
    return np.concatenate(points), np.concatenate(inward)


@pytest.mark.parametrize("size", [1, 2, 5, 8])
def test_both_sides_of_an_edge_agree_even_for_noise(size):
    cube = CubeMap(np.random.default_rng(3).random((6, size, size, 3)).astype(np.float32))
    points, others = edge_points(101)
    step = 1e-6
    sides = []
    for which in 0, 1:
        moved = points.copy()
        np.put_along_axis(
            moved, others[:, [which]],
            np.take_along_axis(moved, others[:, [which]], axis=1) * (1 - step), axis=1,
        )  # fmt: skip
        sides.append(sample_cube(cube, moved))
    # A step of 1e-6 of half a face is size / 2 * 1e-6 texels, over differences of at most 1 a
    # texel; and the rounding of float32 directions.
    np.testing.assert_allclose(sides[0], sides[1], atol=size * 2e-6)


def test_a_smooth_function_is_followed_everywhere(directions):
    size = 64
    cube = CubeMap(smooth(texel_directions(size)).astype(np.float32))
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    error = np.abs(sample_cube(cube, directions) - smooth(unit))
    _, st = locate_directions(directions.astype(np.float64))
    at_edge = (np.abs(st - 0.5) > 0.5 - 0.5 / size).any(axis=1)
    # Linear interpolation: h²/8 of each second derivative, |k|² = 5.25, h = 2/64.
    assert error[~at_edge].max() < 2 * 5.25 * (2 / size) ** 2 / 8
    # Around an edge rows of texels bend: their directions are up to half a texel, 1/64, to the
    # side, at a weight of 1/2; in a corner the fourth texel is the mean of three.
    assert at_edge.any()
    assert error[at_edge].max() < 1.5 * np.sqrt(5.25) / size / 2


def test_a_constant_stays_exactly_that(directions):
    value = np.array([0.1, 12345.678], np.float32)
    chain = cube_chain(CubeMap(np.broadcast_to(value, (6, 9, 9, 2))))
    levels = np.random.default_rng(0).uniform(-1, 9, len(directions))
    for filter_name in CUBE_FILTERS:
        assert (sample_cube(chain, directions, levels, filter=filter_name) == value).all()


def test_levels(noise, directions):
    chain = cube_chain(noise)
    n = len(directions)

    def at(level, filter_name):
        return sample_cube(chain, directions, np.full(n, level), filter=filter_name)

    for filter_name in "nearest", "bilinear":
        for level, own in (0.4, 0), (0.6, 1), (-3, 0), (99, 3), (np.nan, 0):
            expected = sample_cube(chain.level(own), directions, filter=filter_name)
            np.testing.assert_array_equal(at(level, filter_name), expected)
    for level in range(4):
        np.testing.assert_array_equal(at(level, "trilinear"), at(level, "bilinear"))
    fine, coarse = at(1, "bilinear"), at(2, "bilinear")
    # Float32 roundings of numbers below 1.
    np.testing.assert_allclose(at(1.25, "trilinear"), 0.75 * fine + 0.25 * coarse, atol=2e-7)
    np.testing.assert_array_equal(at(np.inf, "trilinear"), at(3, "trilinear"))
    np.testing.assert_array_equal(
        sample_cube(chain, directions, filter="trilinear"), sample_cube(noise, directions)
    )


def test_directions_without_a_face_get_0_and_extreme_ones_their_own():
    cube = CubeMap(np.arange(1, 7, dtype=np.float32).reshape(6, 1, 1, 1))
    nowhere = [(0, 0, 0), (np.nan, 1, 0), (0, np.nan, 1), (1, 0, np.nan), (np.inf, 0, 0)]
    nowhere += [(np.inf, -np.inf, 1), (-0.0, 0, -0.0)]
    tiny, huge = np.float32(1e-45), np.finfo(np.float32).max
    somewhere = [(tiny, 0, 0), (0, -tiny, 0), (0, 0, huge), (0, 0, -huge)]
    for filter_name in CUBE_FILTERS:
        found = sample_cube(cube, np.array(nowhere, np.float32), filter=filter_name)
        assert (found == 0).all()
        found = sample_cube(cube, np.array(somewhere, np.float32), filter=filter_name)
        assert found.ravel().tolist() == [1, 4, 5, 6]


def test_resizing(noise):
    assert resize_cube(noise, 8) is noise
    assert resize_cube(noise, 3).size == 3
    larger = resize_cube(noise, 24)
    # The middle one of each 3 x 3 has the direction of the old texel, to float32.
    np.testing.assert_allclose(larger.faces[:, 1::3, 1::3], noise.faces, atol=2e-6)
    with pytest.raises(OptionError, match="size: 0"):
        resize_cube(noise, 0)


def test_wrong_arguments_are_one_clear_error(noise):
    with pytest.raises(OptionError, match="filter: 'cubic' is not known"):
        sample_cube(noise, np.zeros((1, 3)), filter="cubic")
    with pytest.raises(OptionError, match=r"directions: the shape \(3,\) is not \(n, 3\)"):
        sample_cube(noise, np.zeros(3))
    with pytest.raises(OptionError, match=r"levels: the shape \(2,\) is not \(1,\)"):
        sample_cube(noise, np.zeros((1, 3)), np.zeros(2))
    assert sample_cube(noise, np.zeros((0, 3))).shape == (0, 3)


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


def test_a_panorama_has_its_directions():
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


def test_a_smooth_panorama_survives_the_way_to_a_cube_and_back():
    image = smooth(image_directions(128, 256)).astype(np.float32)
    back = to_latitude_longitude(from_latitude_longitude(image))
    assert back.shape == image.shape
    # As above, and once more on the way back over the texels of the cube.
    bound = 2 * 5.25 * ((2 * np.pi / 256) ** 2 / 8 + (2 / 64) ** 2 * (1 / 24 + 1 / 8 + 1 / 24))
    np.testing.assert_allclose(back, image, atol=2 * bound)


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


def test_the_panorama_of_a_noisy_cube_has_no_seam():
    rng = np.random.default_rng(8)
    cube = CubeMap(rng.random((6, 4, 4, 1)).astype(np.float32))
    image = to_latitude_longitude(cube, height=256)
    steps = np.abs(np.diff(np.concatenate([image, image[:, :1]], axis=1), axis=1))
    # The steepest that four texels a quarter turn allow: 1 over the narrowest, 0.67 / 4 rad, in
    # steps of 2 pi / 512 rad; a seam would be up to 1.
    assert steps.max() < 1.5 * (2 * np.pi / 512) / (0.67 / 4)
    assert np.abs(np.diff(image, axis=0)).max() < 1.5 * (np.pi / 256) / (0.67 / 4)


def test_texels_that_are_not_finite_count_as_0():
    image = np.ones((8, 16, 1), np.float32)
    image[0, 0], image[4, 3], image[7, 7] = np.nan, np.inf, -np.inf
    cube = from_latitude_longitude(image)
    assert cube.faces.max() <= 1.0 and cube.faces.min() >= 0.0
    assert cube.faces.min() < 0.9


def test_sizes_of_panoramas():
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
