"""Parallax occlusion against ray intersections in closed form or by brute force."""

from dataclasses import replace

import numpy as np
import pytest

from texbake.errors import UvError
from texbake.rendering.effect import Activation, Effect
from texbake.rendering.effects import EFFECTS
from texbake.rendering.scene.material import Material, Parallax
from texbake.rendering.scene.textures import ImageTexture
from texbake.texture.lookup import lookup

DEPTH = 0.03


def heights(values, **fields):
    return ImageTexture(
        image=np.asarray(values, np.float32), **{"filter": "bilinear", "wrap": "repeat"} | fields
    )


def moved_to(wall, holder, **fields):
    """(16, 24, 2): texture coordinates after parallax, and the fragments' other arrays."""
    kept = []
    probe = Effect(
        name="probe", does="looks",
        activations=lambda request: [Activation(0, "the test", "it looks")],
        left_out="nothing is shaded", shade=lambda fragments, picture: kept.append(fragments),
    )  # fmt: skip
    wall.frame(Material(shading="unlit", parallax=holder), effects=(*EFFECTS, probe), **fields)
    uvs = np.empty((16 * 24, 2))
    for fragments in kept:
        uvs[fragments.pixels], _ = fragments.coordinates[None]
    assert sum(map(len, kept)) == 16 * 24
    return uvs.reshape(16, 24, 2)


def ways(wall, depth=DEPTH):
    """(16, 24, 2): how far in (u, v) the eye's ray gets on its way down."""
    return -wall.to_eye[..., :2] / wall.to_eye[..., 2:] * depth


@pytest.mark.parametrize("height", [0.0, 0.25, 1.0, 3.0, -1.0])
def test_a_constant_height_shifts_by_its_depth(wall, height):
    found = moved_to(wall, Parallax(texture=heights(np.full((8, 8), height)), depth=DEPTH))
    # Below black there is nothing: the ray ends there. Above white it never sets out.
    share = 1.0 - min(max(height, 0.0), 1.0)
    # Unit vectors to the eye are float32.
    np.testing.assert_allclose(found, wall.uvs + share * ways(wall), atol=1e-8)
    if height >= 1.0:
        np.testing.assert_allclose(found, wall.uvs, atol=1e-15)
    else:
        assert np.abs(found - wall.uvs).max() > 0.02


@pytest.mark.parametrize("slopes", [(0.4, 0.1), (-1.0, 0.8)])
@pytest.mark.parametrize("layers", [1, 32])
def test_on_a_ramp_the_ray_meets_the_plane(wall, slopes, layers):
    n = 256
    u, v = np.meshgrid((np.arange(n) + 0.5) / n, 1 - (np.arange(n) + 0.5) / n)
    ramp = 0.5 + slopes[0] * (u - 0.5) + slopes[1] * (v - 0.5)
    found = moved_to(wall, Parallax(texture=heights(ramp), depth=DEPTH, layers=layers))
    way = ways(wall)
    above = 0.5 - (wall.uvs - 0.5) @ slopes  # at the surface, as share of the depth
    share = above / (1.0 + way @ slopes)
    # float32 heights; the ramp is linear away from the border of the map.
    np.testing.assert_allclose(found, wall.uvs + share[..., None] * way, atol=1e-8)


@pytest.mark.parametrize("scale", [(2.0, 1.0), (1.0, -0.5)])
def test_depth_is_that_of_a_square_where_coordinates_are_stretched(wall, scale):
    flat = heights(np.full((8, 8), 0.5))
    uvs = wall.mesh().uvs * scale
    found = moved_to(wall, Parallax(texture=flat, depth=DEPTH), uvs=uvs)
    # One unit square of the texture covers 100 / |scale| units of area.
    side = 10.0 / np.sqrt(abs(scale[0] * scale[1]))
    world = -wall.to_eye[..., :2] / wall.to_eye[..., 2:] * 0.5 * DEPTH * side
    np.testing.assert_allclose(found, wall.uvs * scale + world / 10.0 * scale, atol=1e-8)


def test_the_first_hill_on_the_way_hides_what_is_behind(wall):
    values = np.random.default_rng(5).random((32, 32)).astype(np.float32)
    found = moved_to(wall, Parallax(texture=heights(values), depth=0.1, layers=1000))
    way = ways(wall, 0.1)
    # Followed in steps of 1/4000 of the way.
    shares = np.linspace(0.0, 1.0, 4001)
    points = wall.uvs[..., None, :] + shares[:, None] * way[..., None, :]
    below = lookup(values[..., None], points)[..., 0] >= 1.0 - shares
    first = below.argmax(axis=-1)
    expected = wall.uvs + shares[first][..., None] * way
    off = np.linalg.norm(found - expected, axis=-1)
    # A step of a texel may pass over the very top of a hill.
    same = off <= 2 * np.linalg.norm(way, axis=-1) / 4000 + 1e-7
    assert same.mean() > 0.97
    # It is not merely where the surface is, nor where one lookup would put it.
    single = wall.uvs + (1 - lookup(values[..., None], wall.uvs)) * way
    assert (np.linalg.norm(single - expected, axis=-1) > 0.01).mean() > 0.2


def test_the_map_is_scaled_turned_and_multiplied_like_any_other(wall):
    n = 64
    u = np.broadcast_to((np.arange(n) + 0.5) / n, (n, n))
    turned = heights(u, scale=(0.25, 0.25), rotate=90.0, offset=(0.9, 0.1), factor=0.5)
    found = moved_to(wall, Parallax(texture=turned, depth=DEPTH))
    # Turned by a right angle, the map's u is 0.9 - v / 4.
    way, v = ways(wall), wall.uvs[..., 1]
    share = (1.0 - 0.5 * (0.9 - v / 4)) / (1.0 - 0.125 * way[..., 1])
    np.testing.assert_allclose(found, wall.uvs + share[..., None] * way, atol=1e-8)


@pytest.mark.parametrize("tiles", [1, 3000])
def test_seen_small_the_ray_follows_a_smaller_level(wall, tiles):
    stripes = np.zeros((512, 512), np.float32)
    stripes[:, ::2] = 1.0
    holder = Parallax(texture=heights(stripes, filter="trilinear"), depth=DEPTH)
    found = moved_to(wall, holder, uvs=tiles * wall.mesh().uvs)
    # A pixel covers several stripes, or more than the whole map: their mean is 1/2.
    np.testing.assert_allclose(found, tiles * wall.uvs + 0.5 * ways(wall), atol=1e-7)


def test_all_lookups_move_and_only_they(wall):
    values = np.random.default_rng(5).random((32, 32)).astype(np.float32)
    holder = Parallax(texture=heights(values), depth=0.05)
    n = 512
    u, v = np.meshgrid((np.arange(n) + 0.5) / n, 1 - (np.arange(n) + 0.5) / n)
    ramps = np.stack([u, v, 0 * u], axis=-1)
    colored = Material(
        shading="unlit",
        base_color=ImageTexture(image=np.float32(ramps), filter="bilinear"),
        emission=ImageTexture(image=np.float32(ramps[..., [2, 2, 0]]), filter="bilinear"),
    )
    found = wall.light(replace(colored, parallax=holder))
    uvs = moved_to(wall, holder)
    np.testing.assert_allclose(found[..., :2], uvs, atol=1e-6)
    np.testing.assert_allclose(found[..., 2], uvs[..., 0], atol=1e-6)
    assert np.abs(uvs - wall.uvs).max() > 0.02
    kept = [wall.frame(material) for material in (colored, replace(colored, parallax=holder))]
    np.testing.assert_array_equal(kept[0].face_ids, kept[1].face_ids)


@pytest.mark.parametrize(
    "fields",
    [
        {"uvs": np.full((4, 2), 0.4)},
        {"uvs": np.array([[0, 0], [1, 1], [2, 2], [3, 3.0]])},
        {"normal": (0.0, 0.0, -1.0)},
    ],
    ids=["a point", "a line", "facing away"],
)
def test_what_has_no_direction_does_not_move(wall, fields):
    still = moved_to(wall, Parallax(texture=heights(np.zeros((4, 4))), depth=1e-300), **fields)
    found = moved_to(wall, Parallax(texture=heights(np.zeros((4, 4))), depth=0.5), **fields)
    np.testing.assert_array_equal(found, still)


def test_grazing_rays_end_after_a_unit_of_texture(wall):
    # Normals that are nearly across the view: the way down is endless.
    across = np.cross(wall.to_eye[8, 12], (0.0, 1.0, 0.0))
    holder = Parallax(texture=heights(np.zeros((4, 4))), depth=0.5)
    normal = across + 1e-4 * wall.to_eye[8, 12]
    found = moved_to(wall, holder, normal=normal)
    assert np.isfinite(found).all()
    distances = np.linalg.norm(found - wall.uvs, axis=-1)
    assert distances.max() <= 1.0 + 1e-6 and distances[8, 12] > 0.999


def test_a_way_that_is_cut_is_followed_in_steps_of_a_texel(wall):
    # As many steps as the unit that is followed has texels, however many layers there may be: this
    # would take hours otherwise.
    holder = Parallax(texture=heights(np.zeros((4, 4))), depth=1e9, layers=1_000_000_000)
    found = moved_to(wall, holder)
    assert np.linalg.norm(found - wall.uvs, axis=-1).max() <= 1.0 + 1e-6


def test_what_cannot_be_a_parallax_map_is_one_line(wall):
    texture = heights(np.zeros((4, 4)))
    with pytest.raises(UvError):
        wall.frame(
            Material(shading="unlit", base_color=texture, parallax=Parallax(texture=texture)),
            uvs=None,
            uv_faces=None,
        )
