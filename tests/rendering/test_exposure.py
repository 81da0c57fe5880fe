"""Exposed light: white does not clip, black stays black, and pictures share one exposure."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from texbake.core import core
from texbake.mesh.shapes import uv_sphere
from texbake.rendering.exposure import exposed, exposure_of
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render_scene
from texbake.rendering.scene.lights import Lighting
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.studio import STUDIO
from texbake.texture.encoding import encode_srgb, quantize_srgb

AUTO = RenderOptions(width=96, height=96, exposure="auto")
PLAIN = replace(AUTO, exposure="none")
BALL = uv_sphere(24, 48)


def scene(gray, *, brightness=1.0, **material):
    lamps = tuple(replace(light, intensity=brightness) for light in STUDIO.lights)
    material = Material(base_color=(gray, gray, gray), roughness=0.5, **material)
    return Scene(
        objects=(SceneObject(mesh=BALL, material=material),),
        lighting=Lighting(lights=lamps, ambient=STUDIO.ambient),
    )


def codes(frame):
    return quantize_srgb(frame.color[frame.coverage == 1.0][:, :3], 8)


@pytest.mark.parametrize("brightness", [1.0, 3.0, 30.0])
def test_white_does_not_clip(brightness):
    white = scene(1.0, brightness=brightness)
    clipped = (codes(render_scene(white, PLAIN)) == 255).any(axis=1).mean()
    assert clipped > 0.1
    assert (codes(render_scene(white, AUTO)) == 255).any(axis=1).mean() <= 0.01


def test_black_stays_black():
    unlit = scene(0.0, shading="blinn-phong", specular=(0.0, 0.0, 0.0))
    assert (codes(render_scene(unlit, AUTO)) == 0).all()


def test_darker_light_stays_as_it_is():
    dim = scene(0.5)
    before, after = render_scene(dim, PLAIN), render_scene(dim, AUTO)
    dark = (before.color[..., :3].max(axis=2) <= 0.8) & (before.coverage % 1.0 == 0.0)
    assert after.exposure == 1.0
    assert dark.mean() > 0.8
    np.testing.assert_array_equal(after.color[dark], before.color[dark])


def test_grays_keep_their_order():
    """Each step of gray is brighter in every pixel, up to white."""
    frames = exposed([render_scene(scene(g), PLAIN) for g in (0.0, 0.1, 0.3, 0.6, 1.0)], AUTO)
    for darker, brighter in pairwise(frames):
        inside = darker.coverage == 1.0
        lit = inside & (brighter.color[..., 1] > 0.01)
        assert lit.sum() > 0.5 * inside.sum()
        assert (darker.color[lit][:, :3] < brighter.color[lit][:, :3]).all()


@pytest.mark.parametrize("exposure", [1.0, 0.7, 0.1])
def test_differences_of_light_up_to_white_do_not_grow_in_codes(exposure):
    """So the error bound of adaptive samples holds. More light is never darker, however bright."""
    light = np.concatenate([np.linspace(0.0, 1.0, 4001), np.linspace(1.0, 100.0, 1000)])
    color = np.repeat(light.astype(np.float32)[None, :, None], 4, axis=2)
    before = encode_srgb(color[0, :, 0])
    core.expose_pixels(color, np.ones_like(color[..., 0]), None, exposure, 0, 1)
    after = encode_srgb(color[0, :, 0])
    assert (np.diff(after) >= 0.0).all()
    assert after.max() < 1.0
    assert (np.diff(after)[:4000] <= np.diff(before)[:4000] + 1e-6).all()


def test_pictures_share_one_exposure():
    frames = [render_scene(scene(gray, brightness=3.0), PLAIN) for gray in (0.3, 1.0)]
    dark, bright = exposed(frames, AUTO)
    assert dark.exposure == bright.exposure == exposure_of(frames) < 1.0
    assert exposure_of(frames[:1]) > exposure_of(frames[1:])


def test_at_most_a_quarter_of_the_surface_is_above_white():
    frame = render_scene(scene(1.0, brightness=5.0), PLAIN)
    peaks = frame.color[frame.coverage == 1.0][:, :3].max(axis=1)
    above = (exposure_of([frame]) * peaks > 1.0).mean()
    assert 0.24 < above <= 0.25


@pytest.mark.parametrize("background", [None, (1.0, 1.0, 1.0), (0.15, 0.16, 0.18)])
def test_the_background_stays_as_it_is(background):
    """Over any background, the surface's own light is the same."""
    white = scene(1.0, brightness=3.0)
    options = replace(AUTO, background=background)
    frame = render_scene(white, options)
    plain = render_scene(white, replace(options, exposure="none"))
    nothing = frame.coverage == 0.0
    np.testing.assert_array_equal(frame.color[nothing], plain.color[nothing])
    transparent = render_scene(white, replace(AUTO, background=None))
    alpha = transparent.color[..., 3:]
    behind = plain.color[0, 0, :3] if background else 0.0
    over = alpha * transparent.color[..., :3] + (1.0 - alpha) * behind
    shown = frame.color[..., :3] * (alpha if background is None else 1.0)
    np.testing.assert_allclose(shown, over, atol=2e-5)


def test_threads_do_not_matter():
    white = scene(1.0, brightness=3.0)
    one, two = (render_scene(white, AUTO, threads=n) for n in (1, 2))
    np.testing.assert_array_equal(one.color, two.color)


@pytest.mark.parametrize("change", [{"buffer": "depth"}, {"mapping_order": "texture"}])
def test_buffers_and_textures_are_not_exposed(change):
    assert not replace(AUTO, **change).exposes


def test_adaptive_pictures_are_exposed():
    white = scene(1.0, brightness=3.0)
    frame = render_scene(white, replace(AUTO, max_error=8 / 255))
    assert frame.exposure == pytest.approx(render_scene(white, AUTO).exposure, rel=0.02)
    assert (codes(frame) < 255).all()
