from dataclasses import replace

import numpy as np
import pytest

from texbake import Lighting, Material, OptionError, RenderOptions, Scene, SceneObject, render_scene
from texbake.core import core
from texbake.mesh.shapes import plane, uv_sphere
from texbake.rendering.effect import Plan
from texbake.rendering.fragments import DrawnObject, Fragments
from texbake.rendering.rasterize import VisibilityBuffer
from texbake.rendering.resolve import Frame, Sums, expose, find_exposure
from texbake.rendering.results import Costs
from texbake.rendering.studio import STUDIO
from texbake.texture.encoding import encode_srgb, quantize_srgb


def fragments(pixels, counts, light, normals=None):
    n = len(pixels)
    mesh = plane()
    return Fragments(
        target=0,
        drawn=DrawnObject(
            mesh=mesh, material=Material(), positions=mesh.positions, faces=mesh.faces,
        ),
        drawn_faces=np.zeros(n, np.int32), drawn_weights=np.zeros((n, 2)),
        faces=np.zeros(n, np.int32), weights=np.zeros((n, 2)), changes=np.empty((0, 4), np.float32),
        places=np.zeros((n, 2), np.float32), pixels=np.array(pixels, np.int32),
        counts=np.array(counts, np.float32), back_facing=np.zeros(n, bool),
        normals=np.array([] if normals is None else normals, np.float32).reshape(-1, 3),
        light=np.array(light, np.float32),
    )  # fmt: skip


def test_a_pixel_is_the_mean_of_its_samples_over_what_is_behind():
    def summed():
        sums = Sums.empty(1, 2, n_samples=4, keeps_normals=True)
        sums.add(fragments([1, 1], [1, 1], [[1, 0, 0], [0, 0.5, 0]], [[1, 0, 0], [0, 1, 0]]))
        return sums

    color, coverage, normals = summed().finish(np.array([0.0, 0.0, 1.0], np.float32))
    np.testing.assert_allclose(color[0], [[0, 0, 1, 1], [0.25, 0.125, 0.5, 1.0]])
    np.testing.assert_array_equal(coverage, [[0, 0.5]])
    np.testing.assert_allclose(normals[0, 1], [0.5**0.5, 0.5**0.5, 0], rtol=1e-6)
    np.testing.assert_array_equal(normals[0, 0], 0.0)
    clear, _, _ = summed().finish(None)
    np.testing.assert_allclose(clear[0], [[0, 0, 0, 0], [0.5, 0.25, 0, 0.5]])
    # A picture behind: each pixel over its own.
    picture = np.array([[[0.0, 0.5, 0.0], [1.0, 1.0, 1.0]]], np.float32)
    over, _, _ = summed().finish(picture)
    np.testing.assert_allclose(over[0], [[0, 0.5, 0, 1], [0.75, 0.625, 0.5, 1.0]])


@pytest.mark.parametrize("n_samples", [1, 9, 49])
def test_a_full_pixel_is_fully_covered(n_samples):
    # 49 times 1 / 49 is not 1: samples have to be counted, and the sum divided.
    sums = Sums.empty(1, 1, n_samples=n_samples, keeps_normals=False)
    for _ in range(n_samples):
        sums.add(fragments([0], [1], [[0.25] * 3]))
    color, coverage, normals = sums.finish(np.ones(3, np.float32))
    assert coverage[0, 0] == 1.0
    np.testing.assert_array_equal(color[0, 0], [0.25, 0.25, 0.25, 1.0])
    assert normals is None


def test_normals_that_cancel_leave_none():
    sums = Sums.empty(1, 1, n_samples=4, keeps_normals=True)
    sums.add(fragments([0, 0], [2, 2], np.zeros((2, 3)), [[0, 0, 1], [0, 0, -1]]))
    _, _, normals = sums.finish(None)
    np.testing.assert_array_equal(normals[0, 0], 0.0)


def test_a_frame_tells_the_nearest_triangle_of_a_pixel_and_its_distance():
    ids = np.array([[7, 3, -1, -1], [-1, -1, -1, -1]], np.int32)
    depths = np.array([[0.25, 0.5, 0, 0], [0, 0, 0, 0]], np.float32)
    frame = Frame(
        color=np.zeros((1, 2, 4), np.float32), coverage=np.zeros((1, 2), np.float32),
        plan=Plan((), ()), costs=Costs(), _visibility=VisibilityBuffer(ids, depths), _near=0.1,
    )  # fmt: skip
    np.testing.assert_array_equal(frame.face_ids, [[3, -1]])
    np.testing.assert_array_equal(frame.depths, np.float32([[0.1 / 0.5, np.inf]]))
    with pytest.raises(OptionError, match="has no normals"):
        _ = frame.normals


# Exposing pictures in texbake's built-in light.
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


def test_darker_light_stays_as_it_is():
    dim = scene(0.5)
    before, after = render_scene(dim, PLAIN), render_scene(dim, AUTO)
    dark = (before.color[..., :3].max(axis=2) <= 0.8) & (before.coverage % 1.0 == 0.0)
    assert after.exposure == 1.0
    assert dark.mean() > 0.8
    np.testing.assert_array_equal(after.color[dark], before.color[dark])


@pytest.mark.parametrize("exposure", [1.0, 0.7, 0.1])
def test_differences_of_light_up_to_white_do_not_grow_in_codes(exposure):
    """So the error bound of adaptive samples holds. More light is never darker, however bright."""
    light = np.concatenate([np.linspace(0.0, 1.0, 4001), np.linspace(1.0, 100.0, 1000)])
    color = np.repeat(light.astype(np.float32)[None, :, None], 4, axis=2)
    before = encode_srgb(color[0, :, 0])
    core.expose_pixels(color, np.ones_like(color[..., 0]), None, exposure, 0, 1)
    after = encode_srgb(color[0, :, 0])
    assert (np.diff(after) >= 0.0).all() and after.max() < 1.0
    assert (np.diff(after)[:4000] <= np.diff(before)[:4000] + 1e-6).all()


def test_pictures_share_one_exposure():
    frames = [render_scene(scene(gray, brightness=3.0), PLAIN) for gray in (0.3, 1.0)]
    dark, bright = expose(frames, AUTO)
    assert dark.exposure == bright.exposure == find_exposure(frames) < 1.0
    assert find_exposure(frames[:1]) > find_exposure(frames[1:])


def test_at_most_a_quarter_of_the_surface_is_above_white():
    frame = render_scene(scene(1.0, brightness=5.0), PLAIN)
    peaks = frame.color[frame.coverage == 1.0][:, :3].max(axis=1)
    above = (find_exposure([frame]) * peaks > 1.0).mean()
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


@pytest.mark.parametrize("change", [{"buffer": "depth"}, {"mapping_order": "texture"}])
def test_buffers_and_textures_are_not_exposed(change):
    assert not replace(AUTO, **change).exposes


def test_adaptive_pictures_are_exposed():
    white = scene(1.0, brightness=3.0)
    frame = render_scene(white, replace(AUTO, max_error=8 / 255))
    assert frame.exposure == pytest.approx(render_scene(white, AUTO).exposure, rel=0.02)
    assert (quantize_srgb(frame.color[frame.coverage == 1.0][:, :3], 8) < 255).all()
