import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.texture.mipmaps import MIP_FILTERS, MipChain, mip_chain, single_level

SIZES = [(1, 1), (2, 2), (8, 8), (1, 9), (16, 2), (5, 7), (33, 20), (31, 63), (3, 100)]


def random_image(height, width, n_channels=3):
    return np.random.default_rng(height * 1000 + width).random(
        (height, width, n_channels), dtype=np.float32
    )


@pytest.mark.parametrize("size", SIZES)
def test_each_level_is_half_of_the_last_rounded_down_to_one_texel(size):
    chain = mip_chain(random_image(*size))
    expected = [size]
    while expected[-1] != (1, 1):
        expected.append(tuple(max(side // 2, 1) for side in expected[-1]))
    assert [tuple(row) for row in chain.sizes.tolist()] == expected
    assert chain.n_levels == len(expected)
    assert (chain.height, chain.width, chain.n_channels) == (*size, 3)
    # Without gaps, one after another.
    counts = chain.sizes.prod(axis=1)
    assert chain.offsets.tolist() == (np.cumsum(counts) - counts).tolist()
    assert len(chain.texels) == counts.sum()


def test_the_finest_level_is_the_image_and_each_level_its_own_texels():
    image = random_image(6, 4)
    chain = mip_chain(image)
    np.testing.assert_array_equal(chain.level(0), image)
    for index in range(chain.n_levels):
        level = chain.level(index)
        assert level.shape == (*chain.sizes[index], 3)
        assert np.shares_memory(level, chain.texels) and not level.flags.writeable


@pytest.mark.parametrize("size", [(5, 7), (3, 1), (9, 4), (2, 31)])
def test_of_odd_sizes_a_texel_is_the_mean_over_its_area(size):
    height, width = size
    smaller = max(height // 2, 1), max(width // 2, 1)
    image = random_image(*size)
    # Every texel cut into so many that the borders of both levels lie between them.
    cut = np.repeat(np.repeat(image.astype(np.float64), smaller[0], axis=0), smaller[1], axis=1)
    areas = cut.reshape(smaller[0], height, smaller[1], width, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(mip_chain(image).level(1), areas, atol=3e-7)


def test_kaiser_keeps_more_of_what_the_smaller_level_can_show_and_less_of_what_it_cannot():
    x = (np.arange(128) + 0.5) / 128
    shown, beyond = (
        np.broadcast_to(np.cos(2 * np.pi * periods * x)[None, :, None], (128, 128, 1))
        for periods in (20, 44)  # the smaller level shows up to 32
    )
    kept = {
        (name, wave): np.ptp(mip_chain(image, filter=name).level(1))
        for name in MIP_FILTERS
        for wave, image in (("shown", shown), ("beyond", beyond))
    }
    assert kept["kaiser", "shown"] > 1.05 * kept["box", "shown"]
    assert kept["kaiser", "beyond"] < 0.25 * kept["box", "beyond"]


@pytest.mark.parametrize("name", MIP_FILTERS)
@pytest.mark.parametrize("size", SIZES)
def test_a_mirrored_image_has_mirrored_levels(size, name):
    image = random_image(*size)
    plain, mirrored = (mip_chain(each, filter=name) for each in (image, image[::-1, ::-1]))
    for level in range(plain.n_levels):
        expected = plain.level(level)[::-1, ::-1]
        np.testing.assert_allclose(mirrored.level(level), expected, atol=2e-6)


def test_kaiser_follows_the_wrap_mode_across_the_border():
    ramp = np.broadcast_to(np.arange(64, dtype=np.float32)[None, :, None], (64, 64, 1))
    first = {
        wrap: mip_chain(ramp, filter="kaiser", wrap=wrap).level(1)[0, 0, 0]
        for wrap in ("repeat", "mirror", "clamp", "border")
    }
    # The texel covers 0 and 1. To its left lie 63, 62 ..., 0, 1 ..., and 0, 0 ...
    assert abs(first["repeat"] - 0.5) > 1.0
    assert abs(first["mirror"] - 0.5) < 0.5 and abs(first["clamp"] - 0.5) < 0.5
    assert first["mirror"] != first["clamp"] == first["border"]


def tilted(degrees):
    """(4, 4, 3) unit normals, columns tilted to either side by turns."""
    angles = np.radians(np.where(np.arange(4) % 2, degrees, -degrees))
    normals = np.stack([np.sin(angles), np.zeros(4), np.cos(angles)], axis=-1)
    return np.broadcast_to(normals, (4, 4, 3)).astype(np.float32)


@pytest.mark.parametrize("degrees", [0.0, 10.0, 45.0, 80.0])
def test_the_length_lost_by_normals_is_kept(degrees):
    chain = mip_chain(tilted(degrees), kind="normal", roughness=True)
    assert chain.n_channels == 4
    np.testing.assert_allclose(chain.level(0)[..., 3], 1.0, atol=1e-6)
    for index in 1, 2:
        mean = np.array([0.0, 0.0, 1.0, 1.0]) * np.cos(np.radians(degrees))
        np.testing.assert_allclose(
            chain.level(index), np.broadcast_to(mean, chain.level(index).shape), atol=1e-6
        )


def test_normals_are_averaged_as_unit_vectors():
    normals = tilted(30.0)
    longer = normals * np.linspace(0.2, 3.0, 16, dtype=np.float32).reshape(4, 4, 1)
    np.testing.assert_allclose(
        mip_chain(longer, kind="normal").texels, mip_chain(normals).texels, atol=1e-6
    )
    # One without length has no say.
    without = normals.copy()
    without[0, 0] = 0.0
    chain = mip_chain(without, kind="normal", roughness=True)
    assert (chain.level(0)[0, 0] == 0.0).all() and np.isfinite(chain.texels).all()


def test_a_single_level_shares_the_memory_of_its_image():
    image = random_image(5, 3)
    chain = single_level(image)
    assert isinstance(chain, MipChain) and chain.n_levels == 1
    assert np.shares_memory(chain.texels, image)
    np.testing.assert_array_equal(chain.level(0), image)


@pytest.mark.parametrize(("options", "message"), [
    ({"kind": "vector"}, "kind: 'vector' is not known"),
    ({"filter": "lanczos"}, "filter: 'lanczos' is not known"),
    ({"wrap": "tile"}, "wrap: 'tile' is not known"),
    ({"roughness": True}, "roughness: only normal maps have it"),
])  # fmt: skip
def test_wrong_options_are_errors(options, message):
    with pytest.raises(OptionError, match=message):
        mip_chain(random_image(4, 4), **options)


@pytest.mark.parametrize("shape", [(4, 4), (0, 4, 3), (4, 4, 0)])
def test_an_image_without_texels_or_channels_is_an_error(shape):
    for make in mip_chain, single_level:
        with pytest.raises(OptionError, match=r"is not \(height, width, channels\)"):
            make(np.zeros(shape, np.float32))
