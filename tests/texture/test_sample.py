import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.rendering.scene import textures
from texbake.texture.lookup import WRAPS, lookup, texel_coordinates
from texbake.texture.mipmaps import mip_chain, single_level
from texbake.texture.sample import (
    FILTERS,
    FILTERS_WITH_FOOTPRINT,
    mip_levels,
    sample,
    sample_texture,
)

ODD = [np.nan, np.inf, -np.inf, 1e300, -1e300, -1e-300, 1e18, -1e9, 0.0, 0.5, 1.0]


def random_image(height=20, width=33, n_channels=3, seed=3):
    shape = (height, width, n_channels)
    return np.random.default_rng(seed).random(shape, dtype=np.float32)


def random_points(n=2000, low=-2.0, high=3.0):
    return np.random.default_rng(5).uniform(low, high, (n, 2))


def changes(n, du_dx=0.0, dv_dx=0.0, du_dy=0.0, dv_dy=0.0):
    """(n, 4) float32 derivatives, the same everywhere."""
    return np.tile(np.float32([du_dx, dv_dx, du_dy, dv_dy]), (n, 1))


def plane_to_the_horizon(width, height, *, turned_deg):
    """Coordinates and derivatives of a ground plane 1 below an eye that sees it up to the top."""
    focal = width / 2 / np.tan(np.radians(30.0))
    x, y = np.meshgrid(np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5)
    ground = np.stack([x / y, focal / y], axis=-1)
    right = np.stack([1.0 / y, 0.0 * y], axis=-1)
    down = -ground / y[..., None]
    cos, sin = np.cos(np.radians(turned_deg)), np.sin(np.radians(turned_deg))
    turn = np.array([[cos, -sin], [sin, cos]])
    derivatives = np.concatenate([right @ turn.T, down @ turn.T], axis=-1)
    return (ground @ turn.T).reshape(-1, 2), derivatives.reshape(-1, 4).astype(np.float32)


@pytest.mark.parametrize("turned_deg", [0.0, 25.0, 45.0])
@pytest.mark.parametrize("size", [512, 500])
def test_on_a_checkered_plane_to_the_horizon_each_filter_is_better_than_the_last(size, turned_deg):
    x, y = np.meshgrid(np.arange(size), np.arange(size))
    checker = ((x * 8 // size + y * 8 // size) % 2).astype(np.float32)[..., None]
    chain = mip_chain(checker)
    uvs, derivatives = plane_to_the_horizon(160, 80, turned_deg=turned_deg)
    reference = sample(chain, uvs, derivatives, filter="supersampled")
    errors = [
        np.sqrt(np.mean((sample(chain, uvs, derivatives, filter=name) - reference) ** 2))
        for name in ("nearest", "bilinear", "trilinear", "ewa")
    ]
    nearest, bilinear, trilinear, ewa = errors
    assert nearest > bilinear > trilinear > ewa
    # And not by a hair where the next one adds something.
    assert trilinear < 0.6 * bilinear
    assert ewa < 0.5 * trilinear


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("size", [(1, 1), (1, 5), (64, 2)])
@pytest.mark.parametrize("levels", ["all", "one"])
def test_whatever_the_coordinates_and_derivatives_no_texel_outside_is_read(name, size, levels):
    image = np.ones((*size, 1), np.float32)
    chain = mip_chain(image) if levels == "all" else single_level(image)
    points = np.array([[u, v] for u in ODD for v in ODD])
    for size_of_change in (0.0, 1e-40, 0.01, 1.0, 1e9, 1e38, np.inf, np.nan):
        for shape in ((1, 0, 0, 1), (1, 1, 1, 1), (0, 1e-3, 1, 0), (0, 0, 0, -1)):
            derivatives = changes(len(points), *(size_of_change * k if k else 0.0 for k in shape))
            for wrap in WRAPS:
                values = sample(
                    chain, points, derivatives, filter=name, wrap=wrap, border=1.0, threads=1
                )
                assert (values == 1.0).all()


@pytest.mark.parametrize("name", FILTERS)
def test_a_linear_ramp_is_reproduced(name):
    """But for nearest, which is off by up to half a texel."""
    height, width = 32, 64
    slope = np.array([2.0, -3.0])
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height)
    chain = mip_chain((np.stack([u, v], axis=-1) @ slope)[..., None])
    uvs = random_points(1000, 0.3, 0.7)
    # Footprints of up to five texels either way, which stay inside the border of the ramp.
    derivatives = np.random.default_rng(1).uniform(-0.03, 0.03, (1000, 4)).astype(np.float32)
    error = abs(sample(chain, uvs, derivatives, filter=name)[:, 0] - uvs @ slope)
    if name == "nearest":
        assert error.max() <= 0.5 * abs(slope) @ (1 / width, 1 / height)
    elif name == "ewa":
        # Weights of a lattice about a point between its nodes are not symmetric: a share of the
        # step from texel to texel remains.
        assert error.max() < 0.15 * abs(slope) @ (4 / width, 4 / height)
        assert error.mean() < 0.005
    else:
        # Float32 rounding of values up to 2 in a few sums.
        assert error.max() < 2e-6


@pytest.mark.parametrize("wrap", WRAPS)
def test_nearest_reads_as_numpy_pads_and_bilinear_as_in_single_precision(wrap):
    modes = {"repeat": "wrap", "mirror": "symmetric", "clamp": "edge", "border": "constant"}
    image = random_image(5, 7, 2)
    sides = ((40, 40), (40, 40), (0, 0))
    border = {"constant_values": 0.75} if wrap == "border" else {}
    around = np.pad(image, sides, mode=modes[wrap], **border)
    uvs = random_points(4000, -4.0, 5.0)
    columns, rows = np.floor(texel_coordinates(uvs, 7, 5)).astype(int).T
    found = sample(single_level(image), uvs, filter="nearest", wrap=wrap, border=0.75)
    np.testing.assert_array_equal(found, around[rows + 40, columns + 40])
    image, uvs = random_image(), random_points()
    expected = lookup(image, uvs, wrap=wrap, border=0.5)
    for chain in single_level(image), mip_chain(image):
        found = sample(chain, uvs, filter="bilinear", wrap=wrap, border=0.5)
        np.testing.assert_allclose(found, expected, atol=3e-7)


@pytest.mark.parametrize("name", FILTERS)
def test_mirrored_is_repeated_of_an_image_mirrored_both_ways(name):
    image = random_image(16, 16)
    # v from 0 to 1, the lower half, is the image as it is.
    lower = np.concatenate([image, image[:, ::-1]], axis=1)
    twice = np.concatenate([lower[::-1], lower])
    uvs = random_points(500)
    derivatives = np.random.default_rng(4).normal(0, 0.1, (500, 4)).astype(np.float32)
    mirrored = sample(mip_chain(image), uvs, derivatives, filter=name, wrap="mirror")
    # Levels of the doubled image are those of the image, doubled.
    repeated = sample(mip_chain(twice), uvs / 2, derivatives / 2, filter=name, wrap="repeat")
    np.testing.assert_allclose(mirrored, repeated, atol=3e-6)


def test_mip_levels_of_known_footprints():
    derivatives = np.float32(
        [
            [1 / 64, 0, 0, 1 / 32],  # one texel in each direction
            [4 / 64, 0, 0, 1 / 32],  # the longer step counts
            [0, 2 / 32, 0, 0],
            [3 / 64, 4 / 32, 0, 1 / 32],  # Pythagoras: 5 texels
            [0.25 / 64, 0, 0, 0],  # magnified
            [0, 0, 0, 0],
            [np.nan, 0, 2 / 64, np.nan],
        ]
    )
    expected = [0.0, 2.0, 1.0, np.log2(5.0), -2.0, -np.inf, -np.inf]
    np.testing.assert_allclose(mip_levels(derivatives, 64, 32), expected, atol=1e-6)


def test_a_texture_is_sampled_at_coordinates_of_any_shape():
    image = random_image(8, 8)
    uvs = random_points(24).reshape(2, 3, 4, 2)
    derivatives = changes(24, 0.2, 0, 0, 0.2).reshape(2, 3, 4, 4)
    for name in FILTERS:
        found = sample_texture(image, uvs, derivatives, filter=name)
        assert found.shape == (2, 3, 4, 3)
        rows = sample(mip_chain(image), uvs.reshape(-1, 2), derivatives.reshape(-1, 4), filter=name)
        np.testing.assert_array_equal(found.reshape(-1, 3), rows)
    assert sample_texture(mip_chain(image), np.array([0.5, 0.5])).shape == (3,)
    assert sample_texture(image, np.empty((0, 5, 2))).shape == (0, 5, 3)


@pytest.mark.parametrize(("options", "message"), [
    ({"filter": "cubic"}, "filter: 'cubic' is not known"),
    ({"wrap": "tile"}, "wrap: 'tile' is not known"),
    ({"filter": "trilinear"}, "derivatives: trilinear filtering needs them"),
    ({"max_anisotropy": 0.5}, "max_anisotropy: 0.5 is too small"),
    ({"max_anisotropy": np.nan}, "max_anisotropy: nan is too small"),
    ({"border": (1, 2)}, r"border: .* is not one number or 3"),
    ({"filter": "ewa", "derivatives": np.zeros((3, 4))}, "derivatives: 3 rows for 5"),
    ({"filter": "ewa", "derivatives": np.zeros((5, 3))}, "derivatives: the shape"),
    ({"uvs": np.zeros((5, 3))}, "uvs: the shape"),
])  # fmt: skip
def test_wrong_options_are_errors(options, message):
    arguments = {"uvs": np.zeros((5, 2)), "filter": "bilinear"} | options
    with pytest.raises(OptionError, match=message):
        sample(mip_chain(random_image(4, 4)), **arguments)


def test_shapes_that_do_not_fit_a_texture_are_errors():
    image = random_image(4, 4)
    with pytest.raises(OptionError, match="uvs: the shape"):
        sample_texture(image, np.zeros((2, 3)))
    with pytest.raises(OptionError, match="derivatives: the shape"):
        sample_texture(image, np.zeros((2, 2)), np.zeros((1, 4)), filter="ewa")
    with pytest.raises(OptionError, match="derivatives: the shape"):
        mip_levels(np.zeros((3, 2)), 4, 4)


def test_filters_and_wraps_are_those_of_scenes():
    assert FILTERS == textures.FILTERS
    assert FILTERS_WITH_FOOTPRINT == textures.FILTERS_WITH_FOOTPRINT
    assert set(WRAPS) == set(textures.WRAPS)


def test_nearest_gives_borders_between_texels_to_the_right_and_upper_one():
    image = np.arange(12, dtype=np.float32).reshape(3, 4, 1)
    corners = np.array([[0.0, 0.0], [0.25, 0.0], [0.5, 1 / 3], [0.0, 0.5]])
    found = sample(single_level(image), corners, filter="nearest")[:, 0]
    assert found.tolist() == [8.0, 9.0, 6.0, 4.0]
