"""Texture order against a computation texel by texel, and counts that are known beforehand."""

import math

import numpy as np
import pytest

from texbake import ImageTexture, Material, OptionError, RenderOptions, Scene, SceneObject
from texbake.mesh.shapes import plane, uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.texture.encoding import decode_srgb

SIZE = 48
CAMERA = Camera.looking_at((0.5, 0.5, 2.0), (0.5, 0.5, 0.0), fov=2 * math.atan(0.25), near=0.01)
SLANTED = Camera.looking_at((0.9, -1.0, 1.6), (0.5, 0.5, 0.0), fov=math.radians(40), near=0.01)


def texture(n, seed=0):
    return np.random.default_rng(seed).random((n, n, 3)).astype(np.float32)


def drawn(pixels, order, camera=CAMERA, mesh=None, **options):
    material = Material(
        shading="lambert", base_color=ImageTexture(image=pixels, filter="nearest", wrap="clamp")
    )
    scene = Scene(objects=(SceneObject(mesh=mesh or plane(2, 2), material=material),))
    given = RenderOptions(width=SIZE, height=SIZE, mapping_order=order, **options)
    return draw(prepare(scene, given), camera)


def screen_places(n, camera):
    """(n, n) columns and rows of the pixels of texels of the unit square z = 0."""
    s, t = np.meshgrid((np.arange(n) + 0.5) / n, 1.0 - (np.arange(n) + 0.5) / n)
    points = np.stack([s, t, np.zeros_like(s), np.ones_like(s)])
    x, y, _, w = np.einsum("ij,jrc->irc", camera.clip_from_world(1.0), points)
    return (0.5 + 0.5 * x / w) * SIZE, (0.5 - 0.5 * y / w) * SIZE


@pytest.mark.parametrize("order", ["texture", "texture-coverage"])
def test_a_texel_per_pixel_is_the_picture_in_screen_order(order):
    # The camera sees just the unit square.
    pixels = texture(SIZE)
    frame = drawn(pixels, order)
    np.testing.assert_allclose(frame.color[..., :3], pixels, atol=1e-6)
    report = frame.texels
    assert (report.texels, report.hidden, report.outside) == (SIZE**2, 0, 0)
    assert (report.pixels, report.gaps, report.double_writes) == (SIZE**2, 0, 0)


def test_a_magnified_texture_leaves_gaps_that_can_be_counted():
    frame = drawn(texture(SIZE // 4), "texture")
    # One pixel of each 4 x 4 is written.
    assert frame.texels.gaps == SIZE**2 * 15 // 16
    assert frame.texels.double_writes == 0
    gaps = (frame.color[..., :3] == decode_srgb(RenderOptions().background).astype(np.float32)).all(
        -1
    )
    assert np.count_nonzero(gaps) == frame.texels.gaps and (frame.color[..., 3] == 1.0).all()
    whole = drawn(texture(SIZE // 4), "texture-coverage")
    assert whole.texels.gaps == 0
    np.testing.assert_allclose(
        whole.color[..., :3], np.repeat(np.repeat(texture(SIZE // 4), 4, 0), 4, 1), atol=1e-6
    )


def test_a_minified_texture_is_written_twice_or_averaged():
    pixels = texture(SIZE * 2)
    frame = drawn(pixels, "texture")
    assert (frame.texels.gaps, frame.texels.double_writes) == (0, SIZE**2)
    means = pixels.reshape(SIZE, 2, SIZE, 2, 3).mean(axis=(1, 3))
    found = drawn(pixels, "texture-coverage").color[..., :3]
    np.testing.assert_allclose(found, means, atol=1e-6)


@pytest.mark.parametrize("n", [20, 48, 150])
def test_a_slanted_plane_against_texel_after_texel(n):
    pixels = texture(n)
    frame = drawn(pixels, "texture", SLANTED)
    columns, rows = screen_places(n, SLANTED)
    inside = (columns >= 0) & (columns < SIZE) & (rows >= 0) & (rows < SIZE)
    # Within rounding of a border either pixel is right.
    sure = np.minimum(np.abs(columns - np.round(columns)), np.abs(rows - np.round(rows))) > 1e-4
    counts = np.zeros((SIZE, SIZE), int)
    np.add.at(counts, (rows[inside].astype(int), columns[inside].astype(int)), 1)
    assert sure[inside].mean() > 0.99
    seen = drawn(pixels, "screen", SLANTED, supersampling=1).coverage > 0.0
    middle = np.zeros_like(seen)
    middle[2:-2, 2:-2] = True
    report = frame.texels
    assert (report.texels, report.hidden) == (n * n, 0)
    assert report.outside == (~inside).sum()
    assert abs(report.gaps - (seen & (counts == 0)).sum()) <= 0.02 * SIZE**2
    assert abs(report.double_writes - (seen & (counts > 1)).sum()) <= 0.02 * SIZE**2
    one = (counts == 1) & seen & middle
    at = {}
    for r in range(n):
        for c in range(n):
            if inside[r, c] and sure[r, c]:
                at[int(rows[r, c]), int(columns[r, c])] = pixels[r, c]
    wrong = [
        place for place, value in at.items()
        if one[place] and np.abs(frame.color[place][:3] - value).max() > 1e-6
    ]  # fmt: skip
    assert len(wrong) <= 0.02 * one.sum()


def test_the_far_side_of_a_ball_is_hidden():
    camera = Camera.looking_at((0, 0, 5.0), (0, 0, 0), fov=math.radians(30), near=0.01)
    frame = drawn(texture(64), "texture", camera, uv_sphere(16, 32))
    report = frame.texels
    assert 0.5 < report.hidden / report.texels < 0.65
    by_screen = drawn(texture(64), "screen", camera, uv_sphere(16, 32))
    assert report.pixels == pytest.approx((by_screen.coverage > 0.5).sum(), rel=0.1)


def test_only_base_colors_are_shown_and_objects_without_an_image_as_always():
    scene = Scene(
        objects=(
            SceneObject(mesh=plane(), material=Material(base_color=(0.2, 0.4, 0.6)), name="plain"),
        )
    )
    options = RenderOptions(width=SIZE, height=SIZE, mapping_order="texture")
    frame = draw(prepare(scene, options), CAMERA)
    np.testing.assert_allclose(frame.color[24, 24, :3], (0.2, 0.4, 0.6), atol=1e-6)
    assert frame.texels.texels == 0
    assert drawn(texture(8), "screen").texels is None


@pytest.mark.parametrize("other", [{"buffer": "uv"}, {"max_error": 0.01}])
def test_texels_are_not_samples(other):
    with pytest.raises(OptionError, match=r"mapping_order, .*: texels are not samples of a pixel"):
        RenderOptions(width=8, height=8, mapping_order="texture", **other)
