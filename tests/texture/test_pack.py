"""Images packed into one, and meshes that look the same in it as before."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from texbake.errors import OptionError, UvError
from texbake.mesh.shapes import cube, plane, uv_sphere
from texbake.texture.lookup import lookup
from texbake.texture.pack import PackOptions, _without, pack_textures, place_rectangles

Array = np.ndarray


def noise(height, width, channels=3, seed=0):
    return np.random.default_rng(seed).random((height, width, channels), dtype=np.float32)


def points_on(mesh, n=400):
    """Texture coordinates of random points of a mesh, and of all its corners."""
    rng = np.random.default_rng(3)
    shares = rng.dirichlet((1, 1, 1), n)
    corners = mesh.corner_uvs()
    inner = np.einsum("nc,nck->nk", shares, corners[rng.integers(0, mesh.n_faces, n)])
    return np.concatenate([inner, corners.reshape(-1, 2)])


sides = st.integers(1, 60)


@given(st.lists(st.tuples(sides, sides), min_size=1, max_size=12), sides, sides)
def test_rectangles_lie_inside_and_never_overlap(sizes, width, height):
    places = place_rectangles(sizes, width, height)
    if places is None:
        return
    taken = np.zeros((height, width), np.int64)
    for (left, top), (w, h) in zip(places, sizes, strict=True):
        assert left >= 0 and top >= 0 and left + w <= width and top + h <= height
        taken[top : top + h, left : left + w] += 1
    assert taken.max() == 1


@pytest.mark.parametrize("edges", ["clamp", "repeat"])
def test_a_packed_mesh_looks_up_the_same_colors(edges):
    images = [noise(32, 48), noise(64, 16, seed=1), noise(17, 33, seed=2)]
    # Rounded by a packed texture's coordinates alone: 1e-12 texels.
    packed = pack_textures(images, PackOptions(edges=edges))
    assert packed.scale == 1.0
    for i, (mesh, image) in enumerate(
        zip((plane(3, 2), uv_sphere(8, 8), plane()), images, strict=True)
    ):
        moved = packed.remapped(mesh, i)
        np.testing.assert_array_equal(moved.positions, mesh.positions)
        np.testing.assert_array_equal(moved.uv_faces, mesh.uv_faces)
        before = lookup(image, points_on(mesh) * (1 - 1e-15), wrap=edges)
        after = lookup(packed.pixels, points_on(moved))
        np.testing.assert_allclose(after, before, atol=1e-6)


def test_texels_are_copies_with_padding_from_the_edge():
    image = noise(5, 7)
    packed = pack_textures([image], PackOptions(padding=2))
    (place,) = packed.places
    whole = packed.pixels[place.top - 2 : place.top + 7, place.left - 2 : place.left + 9]
    np.testing.assert_array_equal(whole, np.pad(image, ((2, 2), (2, 2), (0, 0)), "edge"))
    assert packed.pixels.shape == (16, 16, 3)  # 11 x 9 with padding: 8 are too few
    assert packed.filled == 35 / 256


def test_images_that_do_not_fit_are_made_smaller_alike():
    ramp = np.tile(np.linspace(0, 1, 128, dtype=np.float32)[:, None, None], (1, 128, 1))
    ramp = ramp * [1.0, 0.5, 0.25]
    packed = pack_textures([ramp, ramp[:64]], PackOptions(size=(96, 64), padding=1))
    # Side by side they are 2 x 46 wide and 4 texels of padding.
    assert abs(packed.scale * 128 - 46) <= 0.5
    assert packed.pixels.shape == (64, 96, 3)
    np.testing.assert_allclose(packed.pixels, packed.pixels[..., :1] * [1.0, 0.5, 0.25], atol=1e-7)
    first, second = packed.places
    assert first.width == second.width == first.height
    assert abs(first.height - 2 * second.height) <= 1
    values = packed.pixels[first.top : first.top + first.height, first.left, 0]
    # A filter that neither rings nor moves: each texel has the mean of those that it covers.
    expected = (np.arange(first.height) + 0.5) / first.height
    np.testing.assert_allclose(values[2:-2], (expected * 128 - 0.5)[2:-2] / 127, atol=2e-3)
    assert values.min() >= 0.0 and values.max() <= 1.0


def test_channels_are_as_many_as_any_image_needs():
    gray, color, clear = noise(4, 4, 1), noise(4, 4, 3, 1), noise(4, 4, 4, 2)
    packed = pack_textures([gray, color, clear], PackOptions(padding=0))
    assert packed.pixels.shape[2] == 4
    parts = [packed.pixels[p.top : p.top + 4, p.left : p.left + 4] for p in packed.places]
    np.testing.assert_array_equal(parts[0], np.concatenate([gray] * 3 + [np.ones_like(gray)], 2))
    np.testing.assert_array_equal(parts[1][..., :3], color)
    np.testing.assert_array_equal(parts[2], clear)
    assert pack_textures([gray], PackOptions(padding=0)).pixels.shape[2] == 1
    assert pack_textures([gray, noise(2, 2, 2)]).pixels.shape[2] == 2


def test_a_tiling_mesh_is_an_error_that_names_it():
    packed = pack_textures([noise(8, 8)])
    mesh = plane().replace(uvs=plane().uvs * 2.0, name="wall.obj")
    with pytest.raises(UvError, match=r"wall\.obj: .* outside the unit square, such as \(2, 0\)"):
        packed.remapped(mesh, 0)
    bare = cube().replace(uvs=None, uv_faces=None)
    with pytest.raises(UvError, match="no texture coordinates"):
        packed.remapped(bare, 0)


def test_float32_coordinates_on_the_border_are_inside():
    packed = pack_textures([noise(8, 8)], PackOptions(padding=0))
    mesh = plane().replace(uvs=plane().uvs * (1 + 1e-7))
    assert packed.remapped(mesh, 0).uvs.max() <= 1.0


def test_wrong_input_is_one_clear_error():
    with pytest.raises(OptionError, match="images: there is none"):
        pack_textures([])
    with pytest.raises(OptionError, match="image 2: the shape"):
        pack_textures([noise(2, 2), noise(2, 2)[..., 0]])
    with pytest.raises(OptionError, match="has no room for 3 images"):
        pack_textures([noise(4, 4)] * 3, PackOptions(size=16, padding=6))


@given(st.lists(st.tuples(*[st.integers(0, 5)] * 2, *[st.integers(1, 4)] * 2), max_size=5))
def test_free_places_are_the_largest_rectangles_of_empty_texels(taken):
    empty, free = np.ones((7, 8), bool), [(0, 0, 8, 7)]
    for left, top, width, height in taken:
        empty[top : top + height, left : left + width] = False
        free = _without(free, (left, top, left + width, top + height))
    found = {
        (left, top, right, bottom)
        for top, bottom in combinations(range(8), 2)
        for left, right in combinations(range(9), 2)
        if empty[top:bottom, left:right].all()
    }
    sides = (-1, 0, 0, 0), (0, -1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)
    wider = {one: [tuple(np.add(one, side).tolist()) for side in sides] for one in found}
    largest = {one for one in found if not found.intersection(wider[one])}
    assert set(free) == largest and len(free) == len(largest)
